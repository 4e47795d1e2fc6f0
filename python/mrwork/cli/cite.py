"""`mrwork cite`: what to cite for a run, as BibTeX."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.errors import RecordError
from mrwork.identification.settings import is_synthetic
from mrwork.references import (
    Reference,
    reference_of_file,
    reference_of_motion,
    reference_of_package,
    references_in,
    references_of,
)
from mrwork.store.input_file import is_file, make_stored_kind, text_of
from mrwork.store.parse import json_value, toml_table
from mrwork.store.run_folder import ADDITIONS, FIT, MANIFEST, RANKING, RESULTS, STUDY, read_manifest

# A part of a run in words, and the works it rests on.
_Part = tuple[str, tuple[Reference, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cited:
    """A reference and the parts of the run that rest on it."""

    reference: Reference
    reasons: Sequence[str]


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Print what to cite for a run as BibTeX: the package, models, control laws, methods and records."
    )
    parser.epilog = examples("mrwork cite out/demo", "mrwork cite out/demo --json")
    parser.add_argument(
        "folder",
        nargs="?",
        type=named_path,
        metavar="RUN",
        help="folder of a run of any verb; without it, the package alone",
    )
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the entries."""
    from mrwork import __version__

    parts: list[_Part] = [("mrwork", (reference_of_package(__version__),))]
    if options.folder is not None:
        parts += _parts(options.folder)
    cited = _once(parts)
    document = {"entries": [asdict(each.reference) | {"used_for": list(each.reasons)} for each in cited]}
    text = "\n\n".join(f"% {'; '.join(each.reasons)}\n{each.reference.bibtex}" for each in cited)
    print_result(options, document, text)
    return 0


def _once(parts: Sequence[_Part]) -> list[_Cited]:
    """Each reference once, in order, with everything it is cited for."""
    reasons: dict[str, list[str]] = {}
    references: dict[str, Reference] = {}
    for reason, works in parts:
        for work in works:
            references[work.key] = work
            reasons.setdefault(work.key, []).append(reason)
    return [_Cited(reference=references[key], reasons=reasons[key]) for key in references]


def _parts(folder: Path) -> list[_Part]:
    """Parts of a run, each with the works it rests on; a part without a published source is left out."""
    manifest = read_manifest(folder, verb="identify")
    if manifest is None:
        raise RecordError(
            f"{folder} has no {MANIFEST} and is no run folder; give the folder that a verb has written with --out"
        )
    names = dict.fromkeys(_texts(manifest.get("model")))
    if is_file(folder / STUDY):
        names |= dict.fromkeys(_texts(_stored(folder / STUDY, toml_table)))
    settings = manifest.get("settings")
    if isinstance(settings, Mapping):
        names |= dict.fromkeys(_texts([settings.get("search"), settings.get("engine")]))
    names |= dict.fromkeys(name for name in sorted({*ADDITIONS, RANKING}) if is_file(folder / name))
    sources = _sources()
    parts = [(part, references_in(source, name)) for name in names for part, source in sources.get(name, ())]
    parts += [(f"method: {name}", references_of([name])) for name in names]
    return parts + _records(folder, manifest)


def _records(folder: Path, manifest: Mapping[str, Any]) -> list[_Part]:
    """Measured tests of a fit and recorded motions of a study; what was computed is none."""
    inputs = manifest.get("inputs") if is_file(folder / FIT) else None
    tests = inputs if isinstance(inputs, Mapping) else {}
    parts: list[_Part] = [
        (f"record: {name}", (reference_of_file(Path(name).name, digest),))
        for name, digest in tests.items()
        if isinstance(digest, str) and not is_synthetic(name)
    ]
    if is_file(folder / RESULTS):
        results = _stored(folder / RESULTS, json_value)
        motions = results.get("motions") if isinstance(results, Mapping) else None
        parts += [
            (f"record: {each['name']}", (reference_of_motion(str(each["name"]), str(each.get("source"))),))
            for each in (motions if isinstance(motions, list) else ())
            if isinstance(each, Mapping) and "name" in each and not each.get("synthetic")
        ]
    return parts


def _stored(path: Path, read: Callable[[str], Any]) -> Any:
    """The document of a file of the run."""
    try:
        return read(text_of(path, make_stored_kind("respond", name="the file of the study")))
    except ValueError as reason:
        raise RecordError(f"{path} is damaged ({reason}); run `mrwork respond` again") from None


def _sources() -> dict[str, list[tuple[str, str]]]:
    """What each name of a model, published set, control law or building stands for, with its source."""
    from mrwork.buildings.shear import buildings
    from mrwork.control.laws import control_laws
    from mrwork.dampers.spec import PUBLISHED_SETS, damper_models

    sources: dict[str, list[tuple[str, str]]] = {}
    for noun, entries in (
        ("model", damper_models()),
        ("published set", PUBLISHED_SETS),
        ("control law", control_laws()),
        ("building", buildings()),
    ):
        for each in entries:
            sources.setdefault(each.name, []).append((f"{noun}: {each.name}", each.source))
    return sources


def _texts(document: object) -> Iterator[str]:
    """Every key and every text of a document."""
    if isinstance(document, str):
        yield document
    elif isinstance(document, Mapping):
        for key, value in document.items():
            yield str(key)
            yield from _texts(value)
    elif isinstance(document, list):
        for each in document:
            yield from _texts(each)
