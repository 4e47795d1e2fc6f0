"""Pages of searches, noise models, and formats of records and motions, from their registries."""

from __future__ import annotations

from dataclasses import fields

from generate.markdown import code, document, prose, table
from generate.study_keys import documentation
from mrwork.base.units import FACTORS, OTHER_COMMAND_UNITS
from mrwork.files.open_table import EXTENSIONS
from mrwork.motions.read import FORMATS
from mrwork.search import OPTIMISERS, PEERS, Optimiser
from mrwork.uncertainty.noise import NOISES


def search_page() -> str:
    """Every search with its settings."""
    sections = [_search(name, search, "") for name, search in OPTIMISERS.items()]
    peers = [_search(name, search, "Needs the extra `peers`.") for name, search in PEERS.items()]
    return document(
        "(searches)=\n# Searches",
        "The default of `identify` is a race of unlike routes; `--search NAME` takes one of these in its "
        'place, as do `search="NAME"` in Python and `search` in a `[[tune]]` of a study.',
        *sections,
        *peers,
    )


def _search(name: str, search: Optimiser, note: str) -> str:
    rows = [
        (code(each.name), prose(str(each.type)), code(str(getattr(search, each.name))))
        for each in fields(search)
    ]
    return document(
        f"## {code(name)}", documentation(type(search)), note, table(("setting", "type", "value"), rows)
    ).rstrip()


def noise_page() -> str:
    """Every noise model with its parameters."""
    sections = [
        document(
            f"## {code(noise.name)}: {prose(noise.title)}",
            documentation(type(noise)),
            table(
                ("parameter", "meaning", "lower", "upper", "prior"),
                [
                    (
                        code(f"noise.{each.name}"),
                        prose(each.description),
                        f"{each.lower:g}",
                        f"{each.upper:g}",
                        "uniform in the logarithm" if each.log else "uniform",
                    )
                    for each in noise.parameters
                ],
            ),
        ).rstrip()
        for noise in NOISES.values()
    ]
    return document(
        "(noise-models)=\n# Noise models",
        "A noise model is the probability density of the residuals between measured force and model, in units of the "
        "standard deviation of the test's force. `--noise NAME` of [`mrwork intervals --posterior`]"
        "(verbs/intervals.md) chooses one.",
        *sections,
    )


def format_page() -> str:
    """Formats of records and motions, and the units of their columns."""
    return document(
        "(record-formats)=\n# Formats and units of files",
        "## Damper tests",
        f"Extensions: {', '.join(map(code, EXTENSIONS))}. A column is recognised by its name, and its unit by what "
        "stands in the name or in the row below.",
        "## Ground motions",
        "The format of a ground motion is recognised by the content of the file:",
        table(
            ("format", "keys and options that it takes"),
            [(prose(each.name), ", ".join(map(code, sorted(each.needs)))) for each in FORMATS],
        ),
        "## Units",
        "The first unit of a quantity is that of SI, in which all numbers are inside.",
        table(
            ("quantity", "units"),
            [(prose(quantity), ", ".join(map(code, units))) for quantity, units in FACTORS.items()],
        ),
        f"A command of a test may also be in {', '.join(map(code, OTHER_COMMAND_UNITS))}; these are not converted.",
    )
