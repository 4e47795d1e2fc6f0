"""Parsed tables of buildings: typed access to their entries, and the additions that they describe."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Final, NoReturn

import numpy as np
from numpy.typing import NDArray

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
from mrwork.buildings.passive_devices import (
    with_friction_damper,
    with_lead_rubber_bearings,
    with_liquid_column,
    with_optimal_liquid_column,
    with_yielding_damper,
)
from mrwork.buildings.tuned_mass import with_optimal_tuned_mass, with_tuned_mass
from mrwork.keys import Place, shown

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Entries:
    """A parsed table and its place in a document.

    Every method raises a SettingError if a value is missing or of another type.
    """

    table: Mapping[str, object]
    place: Place

    def __contains__(self, key: str) -> bool:
        return key in self.table

    def refuse(self, sentence: str, *keys: str) -> NoReturn:
        """Raise an error that begins with the place of a key."""
        self.place.within(*keys).refuse(sentence)

    def allow(self, known: Sequence[str]) -> None:
        """Check that all keys are among those known."""
        for key in self.table:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
                self.refuse(f"there is no key {key!r}; {hint}", key)

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number."""
        value = self._get(key, "a number", default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(f"{key} is {shown(value)}; give a number", key)
        return float(value)

    def whole(self, key: str, default: int | None = None) -> int:
        """Return a whole number."""
        value = self._get(key, "a whole number", default)
        if isinstance(value, bool) or not isinstance(value, int):
            self.refuse(f"{key} is {shown(value)}; give a whole number", key)
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text."""
        value = self._get(key, "a text", default)
        if not isinstance(value, str):
            self.refuse(f"{key} is {shown(value)}; give a text in quotes", key)
        return value

    def floor(self, key: str) -> int | str:
        """Return the number or name of a floor or storey."""
        value = self._get(key, "its number from 1 or its name")
        if isinstance(value, bool) or not isinstance(value, int | str):
            self.refuse(f"{key} is {shown(value)}; give its number from 1 or its name", key)
        return value

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return an array of numbers."""
        value = self._get(key, "numbers, as [1.0, 2.0]")
        if not isinstance(value, list) or not all(_is_number(each) for each in value):
            self.refuse(f"{key} is {shown(value)}; give numbers, as [1.0, 2.0]", key)
        return tuple(float(each) for each in value)

    def texts(self, key: str) -> tuple[str, ...]:
        """Return an array of texts."""
        value = self._get(key, 'texts, as ["a", "b"]')
        if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
            self.refuse(f'{key} is {shown(value)}; give texts, as ["a", "b"]', key)
        return tuple(value)

    def rows(self, key: str) -> Floats:
        """Return a matrix, given row by row."""
        value = self._get(key, "rows of numbers")
        example = "give rows of numbers, as [[2.0, -1.0], [-1.0, 1.0]]"
        if not isinstance(value, list) or not value or not all(isinstance(row, list) for row in value):
            self.refuse(f"{key} is {shown(value)}; {example}, or the name of a file", key)
        for number, row in enumerate(value, start=1):
            if len(row) != len(value[0]) or not all(_is_number(each) for each in row):
                self.refuse(f"row {number} of {key} is not {len(value[0])} numbers; {example}", key)
        return np.array(value, dtype=np.float64)

    def inner(self, key: str) -> Entries:
        """Return a nested table."""
        value = self._get(key, "a table")
        if not isinstance(value, dict):
            self.refuse(f"{key} is {shown(value)}; give a table, as [{key}]", key)
        return Entries(value, self.place.within(key))

    def inner_all(self, key: str) -> tuple[Entries, ...]:
        """Return the tables of an array, none if the key is absent; a single table counts as an array of one."""
        value = self.table.get(key, [])
        tables = [value] if isinstance(value, dict) else value
        if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
            self.refuse(f"{key} is {shown(value)}; give one or more tables, as [[{key}]]", key)
        if isinstance(value, dict):
            return (Entries(value, self.place.within(key)),)
        return tuple(Entries(each, self.place.within(key, number)) for number, each in enumerate(tables))

    def _get(self, key: str, expected: str, default: object = None) -> object:
        value = self.table.get(key, default)
        if value is None:
            self.refuse(f"{key} is missing; give {expected}")
        return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rayleigh(building: Building, entries: Entries) -> Building:
    entries.allow(("ratios", "modes", "a0", "a1"))
    if "ratios" not in entries:
        a0, a1 = entries.number("a0"), entries.number("a1")
        with entries.place.prefixed():
            return with_rayleigh_coefficients(building, a0=a0, a1=a1)
    if "a0" in entries or "a1" in entries:
        entries.refuse("Rayleigh damping is given by ratios in two modes or by a0 and a1; keep one", "ratios")
    ratios = entries.numbers("ratios")
    modes = entries.numbers("modes") if "modes" in entries else (1.0, 2.0)
    if len(ratios) != 2 or len(modes) != 2 or not all(mode.is_integer() for mode in modes):
        entries.refuse(
            "Rayleigh damping takes two ratios and two modes, as ratios = [0.02, 0.02], modes = [1, 3]",
            "ratios",
        )
    with entries.place.prefixed():
        return with_rayleigh_damping(
            building, ratios=(ratios[0], ratios[1]), modes=(int(modes[0]), int(modes[1]))
        )


def _modal(building: Building, entries: Entries) -> Building:
    entries.allow(("ratios",))
    ratios = entries.numbers("ratios")
    with entries.place.prefixed():
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
        with entries.place.prefixed():
            return with_base_isolation_of_period(building, mass=mass, period=period, ratio=ratio)
    stiffness, damping = entries.number("stiffness"), entries.number("damping")
    with entries.place.prefixed():
        return with_base_isolation(building, mass=mass, stiffness=stiffness, damping=damping)


def _viscous(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "damping"))
    storey, damping = entries.floor("storey"), entries.number("damping")
    with entries.place.prefixed():
        return with_viscous_damper(building, storey=storey, damping=damping)


def _brace(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "stiffness", "mass", "damping", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    stiffness, mass, damping = (
        entries.number("stiffness"),
        entries.number("mass"),
        entries.number("damping", 0.0),
    )
    with entries.place.prefixed():
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
        with entries.place.prefixed():
            return with_optimal_tuned_mass(
                building, floor=floor, mass_ratio=mass_ratio, tuning=tuning, mode=mode, name=name
            )
    mass, frequency, ratio = entries.number("mass"), entries.number("frequency"), entries.number("ratio")
    with entries.place.prefixed():
        return with_tuned_mass(building, floor=floor, mass=mass, frequency=frequency, ratio=ratio, name=name)


def _yielding(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "yield_force", "yield_displacement", "post_yield_ratio", "sharpness", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    numbers = {
        "yield_force": entries.number("yield_force"),
        "yield_displacement": entries.number("yield_displacement"),
        **_given(entries, "post_yield_ratio", "sharpness"),
    }
    with entries.place.prefixed():
        return with_yielding_damper(building, storey=storey, name=name, **numbers)


def _friction(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "slip_load", "stiffness", "sharpness", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    slip_load, stiffness = entries.number("slip_load"), entries.number("stiffness")
    numbers = _given(entries, "sharpness")
    with entries.place.prefixed():
        return with_friction_damper(
            building, storey=storey, name=name, slip_load=slip_load, stiffness=stiffness, **numbers
        )


def _lead_rubber(building: Building, entries: Entries) -> Building:
    if "isolation" in building.storey_names:
        entries.refuse("isolation and lead_rubber both stand under the building; keep one")
    entries.allow(("mass", "period", "ratio", "yield_force", "yield_displacement", "sharpness", "name"))
    name = entries.text("name", "lead-rubber bearings")
    mass, period = entries.number("mass"), entries.number("period")
    yield_force = entries.number("yield_force")
    numbers = _given(entries, "yield_displacement", "ratio", "sharpness")
    with entries.place.prefixed():
        return with_lead_rubber_bearings(
            building, mass=mass, period=period, yield_force=yield_force, name=name, **numbers
        )


def _liquid_column(building: Building, entries: Entries) -> Building:
    entries.allow(
        (
            "floor",
            "mass_ratio",
            "width_ratio",
            "rms_velocity",
            "mode",
            "mass",
            "frequency",
            "head_loss",
            "name",
        )
    )
    floor, name = entries.floor("floor"), entries.text("name", "liquid column")
    width_ratio = entries.number("width_ratio")
    if "mass_ratio" in entries:
        for key in ("mass", "frequency", "head_loss"):
            if key in entries:
                entries.refuse(
                    "a liquid column is given by mass_ratio and rms_velocity or by mass, frequency and head_loss; "
                    "keep one",
                    key,
                )
        mass_ratio, rms_velocity = entries.number("mass_ratio"), entries.number("rms_velocity")
        mode = entries.whole("mode", 1)
        with entries.place.prefixed():
            return with_optimal_liquid_column(
                building,
                floor=floor,
                mass_ratio=mass_ratio,
                width_ratio=width_ratio,
                rms_velocity=rms_velocity,
                mode=mode,
                name=name,
            )
    for key in ("rms_velocity", "mode"):
        if key in entries:
            entries.refuse(f"{key} goes with mass_ratio; leave it out, or give mass_ratio", key)
    mass, frequency = entries.number("mass"), entries.number("frequency")
    head_loss = entries.number("head_loss")
    with entries.place.prefixed():
        return with_liquid_column(
            building,
            floor=floor,
            mass=mass,
            frequency=frequency,
            width_ratio=width_ratio,
            head_loss=head_loss,
            name=name,
        )


def _given(entries: Entries, *keys: str) -> dict[str, float]:
    """The numbers of a table that it has; the others are left to the defaults of the function."""
    return {key: entries.number(key) for key in keys if key in entries}


_ONE: Final[Mapping[str, Callable[[Building, Entries], Building]]] = {
    "rayleigh": _rayleigh,
    "modal_damping": _modal,
    "isolation": _isolation,
    "lead_rubber": _lead_rubber,
}
_SEVERAL: Final[Mapping[str, Callable[[Building, Entries], Building]]] = {
    "viscous": _viscous,
    "yielding": _yielding,
    "friction": _friction,
    "brace": _brace,
    "tuned_mass": _tuned_mass,
    "liquid_column": _liquid_column,
}
ADDITIONS: Final = (*_ONE, *_SEVERAL)
"""Keys of additions, in the order in which they are applied."""


def with_additions(building: Building, entries: Entries) -> Building:
    """Return the building with the additions of a table, applied in the order of `ADDITIONS`.

    Damping ratios therefore refer to the bare building, and storey 1 of an isolated building is the isolators.
    """
    if "rayleigh" in entries and "modal_damping" in entries:
        entries.refuse("rayleigh and modal_damping both give the damping; keep one", "modal_damping")
    for key, add in _ONE.items():
        if key in entries:
            building = add(building, entries.inner(key))
    for key, add in _SEVERAL.items():
        for inner in entries.inner_all(key):
            building = add(building, inner)
    return building
