"""The control laws of a study, from their names and settings."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mrwork.buildings.devices import Device
from mrwork.control.designs.problem import DesignProblem
from mrwork.control.designs.registry import SETTINGS, LawSettings, law_of
from mrwork.control.laws import ControlLaw, control_laws
from mrwork.study.declared import built, said_at, suggestion
from mrwork.study.print_schema import key_lines
from mrwork.study.schema import ControllerTable

PASSIVE_OFF, PASSIVE_ON, BEST_PASSIVE = "passive_off", "passive_on", "best_passive"
_CONSTANT = {
    PASSIVE_OFF: "i = 0",
    PASSIVE_ON: "Largest command",
    BEST_PASSIVE: "Best constant command",
}
_WIDTH = 110


def chosen_law(table: ControllerTable, problem: DesignProblem) -> tuple[str, ControlLaw | None]:
    """Title and law of a table; none for the best constant command, which only runs can tell.

    Raises
    ------
    SettingError
        If there is no such law, it has no such setting, or it cannot be made; the message has the line.
    """
    place = table.place
    if table.law in _CONSTANT:
        for name in table.settings or {}:
            place.within("settings", name).refuse(f"{table.law} has no settings; leave {name} out")
        largest = min(device.largest_command for device in problem.devices)
        command = largest if table.law == PASSIVE_ON else 0.0
        law = None if table.law == BEST_PASSIVE else constant_command(problem.devices, command)
        return _CONSTANT[table.law], law
    specs = {spec.name: spec for spec in control_laws()}
    if table.law not in specs:
        known = [*specs, *_CONSTANT]
        near = suggestion(table.law, known)
        place.within("law").refuse(f"no control law is called {table.law!r}{near}")
    settings: LawSettings = built(SETTINGS[table.law], table.settings or {}, place.within("settings"))
    with said_at(place.within("settings")):
        return specs[table.law].title, law_of(table.law, settings, problem)


def constant_command(devices: Sequence[Device], command: float) -> ControlLaw:
    """The law that gives always the same command."""
    return constant_commands(devices, [command])


def constant_commands(devices: Sequence[Device], commands: ArrayLike) -> ControlLaw:
    """One candidate for each constant command."""
    rows = np.outer(np.asarray(commands, dtype=np.float64), np.ones(len(devices)))
    return ControlLaw(name="passive", gains={"command": rows})


def laws_text() -> str:
    """Every law with its settings, as people read it."""
    blocks = []
    for spec in control_laws():
        prose = [
            line
            for text in (spec.description, spec.source)
            for line in textwrap.wrap(text, width=_WIDTH, initial_indent="  ", subsequent_indent="  ")
        ]
        lines = [f"{spec.name}: {spec.title}", *(f"  {line}" for line in spec.equation.splitlines()), *prose]
        settings = [f"  {line}" for line in key_lines(SETTINGS[spec.name])]
        blocks.append("\n".join([*lines, *(["  settings", *settings] if settings else [])]))
    blocks.append(f"{PASSIVE_OFF}, {PASSIVE_ON}: no command, the largest; no settings")
    blocks.append(f"{BEST_PASSIVE}: the constant command of the least score over all motions; no settings")
    return "\n\n".join(blocks)
