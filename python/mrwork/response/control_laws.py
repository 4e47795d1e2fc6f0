"""The control laws of a study, from their names and settings."""

from __future__ import annotations

from collections.abc import Sequence

from mrwork.buildings import Building
from mrwork.closed_loop.devices import Device
from mrwork.control.laws import ControlLaw, ControlLawSpec, law_of, laws
from mrwork.response.declared import closest
from mrwork.response.motions import said_at
from mrwork.response.schema import ControllerTable

BEST_PASSIVE = "best_passive"


def chosen_law(
    table: ControllerTable, building: Building, devices: Sequence[Device]
) -> tuple[str, ControlLaw | None]:
    """Title and law of a table; none for the best constant command, which only runs can tell.

    Raises
    ------
    SettingError
        Where there is no such law, it has no such setting, or it cannot be made; the message has the line.
    """
    place = table.place
    settings = table.settings or {}
    if table.law == BEST_PASSIVE:
        for name in settings:
            place.within("settings", name).refuse(f"{BEST_PASSIVE} has no settings; leave {name} out")
        return "Best constant command", None
    spec = _spec(table)
    known = [setting.name for setting in spec.settings]
    for name in settings:
        if name not in known:
            near = closest(name, known) or f"; it has {', '.join(known) or 'none'}"
            place.within("settings", name).refuse(f"{spec.name} has no setting {name!r}{near}")
    with said_at(place):
        return spec.title, law_of(spec.name, building, devices, settings)


def constant_command(building: Building, devices: Sequence[Device], command: float) -> ControlLaw:
    """The law that gives always the same command."""
    return law_of("passive", building, devices, {"command": command})


def passive_off(building: Building, devices: Sequence[Device]) -> ControlLaw:
    """The law that gives none."""
    return law_of("passive_off", building, devices, {})


def laws_text() -> str:
    """Every law with its settings, as people read it."""
    blocks = []
    for spec in laws():
        lines = [f"{spec.name}: {spec.title}", *(f"  {line}" for line in spec.equation.splitlines())]
        lines += [f"  {line}" for line in (spec.description, spec.source) if line]
        for setting in spec.settings:
            default = "required" if setting.default is None else f"default {setting.default:g}"
            unit = f" [{setting.unit}]" if setting.unit else ""
            lines.append(f"    {setting.name}{unit}, {default}: {setting.says}")
        blocks.append("\n".join(lines))
    blocks.append(f"{BEST_PASSIVE}: the constant command of the least score over all motions; no settings")
    return "\n\n".join(blocks)


def _spec(table: ControllerTable) -> ControlLawSpec:
    named = {spec.name: spec for spec in laws()}
    if table.law not in named:
        known = [*named, BEST_PASSIVE]
        near = closest(table.law, known) or f"; choose one of {', '.join(known)}"
        table.place.within("law").refuse(f"no control law is called {table.law!r}{near}")
    return named[table.law]
