"""Natural frequencies of the published buildings against those stated with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mrwork.buildings import buildings

# By mode [Hz], as their papers state them or as they follow from what these state; utfpr comes without.
STATED: dict[str, dict[int, float]] = {
    "dyke1996": {1: 5.46, 2: 15.81, 3: 23.64},
    "jansen2000": {1: 1.388, 6: 11.18},
    "uts": {1: 3.00, 2: 8.74, 3: 13.76, 4: 17.68, 5: 20.21},
    "frame": {1: 3.0},
    "sac3": {1: 0.990, 2: 3.061, 3: 5.855},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Frequencies:
    """Natural frequencies of one building [Hz]; `deviation` is the largest relative one, `None` if none is stated."""

    building: str
    found: tuple[float, ...]
    stated: dict[int, float]

    @property
    def deviation(self) -> float | None:
        """Largest relative deviation from the stated frequencies."""
        if not self.stated:
            return None
        return max(abs(self.found[mode - 1] / value - 1.0) for mode, value in self.stated.items())


def frequencies() -> Iterator[Frequencies]:
    """Frequencies of every published building."""
    for each in buildings():
        found = tuple(float(value) for value in each.frequencies)
        yield Frequencies(building=each.name, found=found, stated=STATED.get(each.name, {}))
