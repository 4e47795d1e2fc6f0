"""Additions to a building from a table: damping, isolators, viscous dampers, braces and tuned masses."""

from __future__ import annotations

from typing import Final

from mrwork.buildings.additions import (
    with_base_isolation,
    with_base_isolation_of_period,
    with_brace,
    with_modal_damping,
    with_rayleigh_coefficients,
    with_rayleigh_damping,
    with_viscous_damper,
)
from mrwork.buildings.matrices import Building
from mrwork.buildings.table import Entries
from mrwork.buildings.tuned_mass import with_optimal_tuned_mass, with_tuned_mass

ADDITIONS: Final = ("rayleigh", "modal_damping", "isolation", "viscous", "brace", "tuned_mass")


def with_additions(building: Building, entries: Entries) -> Building:
    """Return the building with the additions of a table, applied in the order of `ADDITIONS`.

    Damping ratios therefore refer to the bare building, and storey 1 of an isolated building is the isolators.

    Raises
    ------
    MrworkError
        If an addition is invalid; the message has its place.
    """
    if "rayleigh" in entries and "modal_damping" in entries:
        entries.refuse("rayleigh and modal_damping both give the damping; keep one", "modal_damping")
    for key, add in (("rayleigh", _rayleigh), ("modal_damping", _modal), ("isolation", _isolation)):
        if key in entries:
            building = add(building, entries.inner(key))
    for key, add in (("viscous", _viscous), ("brace", _brace), ("tuned_mass", _tuned_mass)):
        for inner in entries.inner_all(key):
            building = add(building, inner)
    return building


def _rayleigh(building: Building, entries: Entries) -> Building:
    entries.allow(("ratios", "modes", "a0", "a1"))
    if "ratios" not in entries:
        a0, a1 = entries.number("a0"), entries.number("a1")
        with entries.placed():
            return with_rayleigh_coefficients(building, a0=a0, a1=a1)
    if "a0" in entries or "a1" in entries:
        entries.refuse("Rayleigh damping is given by ratios in two modes or by a0 and a1; keep one", "ratios")
    ratios = entries.numbers("ratios")
    modes = entries.numbers("modes") if "modes" in entries else (1.0, 2.0)
    if len(ratios) != 2 or len(modes) != 2 or not all(mode.is_integer() for mode in modes):
        entries.refuse(
            "Rayleigh damping wants two ratios and two modes, as ratios = [0.02, 0.02], modes = [1, 3]",
            "ratios",
        )
    with entries.placed():
        return with_rayleigh_damping(
            building, ratios=(ratios[0], ratios[1]), modes=(int(modes[0]), int(modes[1]))
        )


def _modal(building: Building, entries: Entries) -> Building:
    entries.allow(("ratios",))
    ratios = entries.numbers("ratios")
    with entries.placed():
        return with_modal_damping(building, ratios=ratios)


def _isolation(building: Building, entries: Entries) -> Building:
    entries.allow(("mass", "period", "ratio", "stiffness", "damping"))
    mass = entries.number("mass")
    if "period" in entries:
        if "stiffness" in entries or "damping" in entries:
            entries.refuse(
                "isolators are given by period and ratio or by stiffness and damping; keep one", "period"
            )
        period, ratio = entries.number("period"), entries.number("ratio")
        with entries.placed():
            return with_base_isolation_of_period(building, mass=mass, period=period, ratio=ratio)
    stiffness, damping = entries.number("stiffness"), entries.number("damping")
    with entries.placed():
        return with_base_isolation(building, mass=mass, stiffness=stiffness, damping=damping)


def _viscous(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "damping"))
    storey, damping = entries.floor("storey"), entries.number("damping")
    with entries.placed():
        return with_viscous_damper(building, storey=storey, damping=damping)


def _brace(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "stiffness", "mass", "damping", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    stiffness, mass, damping = (
        entries.number("stiffness"),
        entries.number("mass"),
        entries.number("damping", 0.0),
    )
    with entries.placed():
        return with_brace(building, storey=storey, stiffness=stiffness, mass=mass, damping=damping, name=name)


def _tuned_mass(building: Building, entries: Entries) -> Building:
    entries.allow(("floor", "mass_ratio", "tuning", "mode", "mass", "frequency", "ratio", "name"))
    floor, name = entries.floor("floor"), entries.text("name", "tuned mass")
    if "mass_ratio" in entries:
        for key in ("mass", "frequency", "ratio"):
            if key in entries:
                entries.refuse(
                    "a tuned mass is given by mass_ratio or by mass, frequency and ratio; keep one", key
                )
        mass_ratio, tuning = entries.number("mass_ratio"), entries.text("tuning", "warburton")
        mode = entries.whole("mode", 1)
        with entries.placed():
            return with_optimal_tuned_mass(
                building, floor=floor, mass_ratio=mass_ratio, tuning=tuning, mode=mode, name=name
            )
    mass, frequency, ratio = entries.number("mass"), entries.number("frequency"), entries.number("ratio")
    with entries.placed():
        return with_tuned_mass(building, floor=floor, mass=mass, frequency=frequency, ratio=ratio, name=name)
