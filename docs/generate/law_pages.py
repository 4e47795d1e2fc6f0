"""Pages of the control laws, from their specifications and the classes of their settings."""

from __future__ import annotations

from pathlib import Path

from generate.equations import tex
from generate.markdown import code, directive, document, fenced, prose, table, toctree
from generate.study_keys import documentation, key_table
from mrwork.control import ControlLawSpec, control_laws
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.laws.weights import WeightWishes
from mrwork.study.schema import CONSTANT_LAWS

_EXPLANATION = Path(__file__).resolve().parents[1] / "explanation"


def law_pages() -> dict[str, str]:
    """Page of each law, and the list of all."""
    return {"index": _index(), **{spec.name: _page(spec) for spec in control_laws()}}


def _index() -> str:
    rows = [
        (f"[{prose(spec.title)}]({spec.name}.md)", code(spec.name), prose(_needs(spec)))
        for spec in control_laws()
    ]
    constant = [(code(name), prose(law.description)) for name, law in CONSTANT_LAWS.items()]
    return document(
        "(control-laws)=\n# Control laws",
        "A law gives the command of each device at every control sample from what its sensors, or an observer, say of "
        "the state. `mrwork help laws` prints these pages. A law of your own in Python runs in the same loop: see "
        "{py:func}`mrwork.own_law`.",
        table(("law", "name", "needs"), rows),
        "## Constant commands",
        "A study takes these as laws too, without settings:",
        table(("name", "command"), constant),
        "(designed-weights)=\n## Designed weights",
        documentation(WeightWishes),
        "The table `designed` among the settings of a law with weights has these keys:",
        key_table(WeightWishes),
        toctree(*(spec.name for spec in control_laws()), hidden=""),
    )


def _needs(spec: ControlLawSpec) -> str:
    """What a law needs beside the state."""
    needs = [
        *(["the damper force as a function of the command"] if spec.needs_curve else []),
        *(["a model of building and dampers, the ground acceleration"] if spec.needs_model else []),
        *(["actuators of any force"] if spec.commands_force else []),
        *(["accelerometers at the ends of the devices"] if spec.reads_acceleration else []),
        *(f"table `{name}`" for name in spec.tables),
    ]
    return ", ".join(needs)


def _page(spec: ControlLawSpec) -> str:
    needs = _needs(spec)
    settings = key_table(SETTINGS[spec.name])
    return document(
        f"(law-{spec.name})=\n# {prose(spec.title)}",
        f"Name: {code(spec.name)}",
        prose(spec.description),
        f"{{doc}}`/explanation/{spec.name}` says more."
        if (_EXPLANATION / f"{spec.name}.md").is_file()
        else "",
        "## Command",
        directive("math", "", tex(spec.equation)),
        f"Source: {prose(spec.source)}" + (f". Needs {prose(needs)}." if needs else ""),
        "## Settings",
        settings or "This law has no settings.",
        "Weights may also follow from limits: see {ref}`designed-weights`."
        if "`designed`" in settings
        else "",
        "## Gains",
        table(
            ("gain", "meaning", "unit", "shape"),
            [
                (code(each.name), prose(each.description), prose(each.unit), _shape(each.shape, each.numbers))
                for each in spec.gains
            ],
        )
        or "The law has no gains.",
        "## Use",
        fenced("toml", f'[[controller]]\nlaw = "{spec.name}"'),
    )


def _shape(shape: str, numbers: int) -> str:
    return {
        "device": "one for each device",
        "state": "one for each device and state",
        "numbers": f"{numbers} for each device",
        "loop": "one",
    }[shape]
