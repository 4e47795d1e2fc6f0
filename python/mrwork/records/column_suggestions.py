"""The --column options that a message suggests: likely columns with likely units, to be pasted into a shell."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.column_names import TestQuantity
from mrwork.units import FACTORS, quantity_of

ReadColumn = Callable[[str], NDArray[np.float64] | None]
"""Reads a column by its name; `None` where it does not have numbers."""

# Units from the smallest numbers to the largest, each up to a size in it: half the peak to peak of a motion and of a
# force, the step of the time, the largest command. Limits lie between what rigs measure in the two units.
_UP_TO: Final[Mapping[TestQuantity, tuple[tuple[str, float], ...]]] = {
    "time": (("s", 0.1), ("ms", 50.0), ("us", np.inf)),
    "displacement": (("m", 0.2), ("mm", 2000.0), ("um", np.inf)),
    "velocity": (("m/s", 4.0), ("mm/s", np.inf)),
    "force": (("kN", 20.0), ("N", np.inf)),
    "current": (("A", 20.0), ("mA", np.inf)),
    "voltage": (("V", 50.0), ("mV", np.inf)),
}
# A column of so few values is a count or a state, no motion and no force.
_FEWEST_VALUES: Final = 5
_BETWEEN_WORDS: Final = re.compile(r"[\s_()\[\]{},;:|]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """A quantity that has to be told, with its column and its unit as far as they are known."""

    quantity: TestQuantity
    column: str = ""
    unit: str = ""


def no_numbers(name: str) -> None:
    """The numbers of no column are known."""


def column_option(key: str, column: str, unit: str) -> str:
    """A --column option as a shell takes it."""
    return f"--column {shlex.quote(f'{key}={column}:{unit}')}"


def suggested_options(
    missing: Sequence[Missing], free: Sequence[str], units: Mapping[str, str], read: ReadColumn
) -> str:
    """Options for all that is missing, with the likeliest of the `free` columns; empty where one has none.

    They follow "likely" where a column or a unit is judged by its numbers.
    """
    left = [name for name in free if name not in {each.column for each in missing}]
    numbers = {name: samples for name in free for samples in [read(name)] if samples is not None}
    options: list[str] = []
    is_sure = True
    suggested: set[str] = set()
    for each in missing:
        if each.column and each.column in suggested:
            # A command may be a current or a voltage.
            continue
        column = each.column or _likely_column(each.quantity, left, units, numbers)
        if not column:
            return ""
        suggested.add(column)
        left = [name for name in left if name != column]
        unit = each.unit or (
            units.get(column, "") if quantity_of(units.get(column, "")) == each.quantity else ""
        )
        is_sure = is_sure and bool(each.column and unit)
        unit = unit or likely_unit(each.quantity, column, numbers.get(column))
        options.append(column_option(each.quantity, column, unit))
    return f"{'as in' if is_sure else 'likely'} {' '.join(options)}"


def likely_unit(quantity: TestQuantity, name: str, samples: NDArray[np.float64] | None) -> str:
    """The unit that a word of the heading is, or else that with which the numbers have the size of a test."""
    for word in _BETWEEN_WORDS.split(name):
        if len(word) > 1 and quantity_of(word) == quantity:
            return word
    size = None if samples is None else _size(quantity, samples)
    if size is None:
        return next(iter(FACTORS[quantity]))
    return next(unit for unit, limit in _UP_TO[quantity] if size <= limit)


def _size(quantity: TestQuantity, samples: NDArray[np.float64]) -> float | None:
    known = samples[np.isfinite(samples)]
    if known.size < 2:
        return None
    if quantity == "time":
        return float(np.median(np.abs(np.diff(known))))
    if quantity in ("current", "voltage"):
        return float(np.abs(known).max())
    return 0.5 * float(np.ptp(known))


def _likely_column(
    quantity: TestQuantity,
    left: Sequence[str],
    units: Mapping[str, str],
    numbers: Mapping[str, NDArray[np.float64]],
) -> str:
    """A column of its unit, or else without any unit: for the time one that increases, otherwise one that varies."""
    of_unit = [name for name in left if quantity_of(units.get(name, "")) == quantity]
    without = [name for name in left if name in numbers and quantity_of(units.get(name, "")) is None]
    increasing = [name for name in without if np.all(np.diff(numbers[name]) > 0.0)]
    if quantity == "time":
        # A number of the sample increases, too.
        candidates = sorted(increasing, key=lambda name: bool(np.all(np.diff(numbers[name]) == 1.0)))
    else:
        varying = [name for name in without if np.unique(numbers[name]).size >= _FEWEST_VALUES]
        candidates = [name for name in varying if name not in increasing]
    return next(iter([*of_unit, *candidates]), "")
