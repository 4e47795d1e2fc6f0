"""The times of the rows of a file: one step, times that are rounded, gaps, and rows whose time does not rise."""

from __future__ import annotations

from dataclasses import field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass

JITTER: Final = 1e-3
"""Steps that differ by less, relative to their median, count as equal."""

# Times no further apart than this repeat [s]; slopes between them would overflow.
_SAME_TIME: Final = 1e-12
# Part of the steps of an axis that are equal, and the difference up to which they are: clocks of loggers stumble.
_MOST_EQUAL, _ALIKE = 0.9, 0.1
# A step longer than so many that are ordinary is a gap; steps over which a rate is told, odd for a median.
_GAP_STEPS: Final = 3.0
_PART: Final = 11


@array_dataclass()
class Grid:
    """An account of times or distances, shape (n,): their steps, and which are equal to the median but for jitter.

    `uniform` is the grid on which the samples were taken: the times themselves where all steps are regular, the values
    of which they are rounded, or `None`.
    """

    time: Floats
    steps: Floats
    median: float
    regular: NDArray[np.bool_]
    uniform: Floats | None = field(default=None)

    @property
    def step(self) -> float:
        """Mean step of the uniform grid, or else of the times."""
        grid = self.time if self.uniform is None else self.uniform
        return float(grid[-1] - grid[0]) / self.steps.size

    @property
    def falls(self) -> NDArray[np.intp]:
        """Rows whose time does not rise above that of the row before."""
        return 1 + np.flatnonzero(~(self.steps > _SAME_TIME))

    @property
    def gaps(self) -> NDArray[np.intp]:
        """Steps that are gaps: longer than three that are ordinary, as nine in ten are."""
        return np.flatnonzero(self.steps > _GAP_STEPS * self._ordinary)

    @property
    def share_in_gaps(self) -> float:
        """Share of the time that lies in gaps."""
        return float(np.sum(self.steps[self.gaps])) / float(np.sum(self.steps))

    @property
    def is_uneven(self) -> bool:
        """Whether more than a few steps are half as long as the median or less, or half as long again or more."""
        return float(np.mean(np.abs(self.steps / self.median - 1.0) > 0.5)) > 1.0 - _MOST_EQUAL

    @property
    def rates(self) -> tuple[tuple[int, float], ...]:
        """First row and step of each part that has a step of its own, if the record has such parts alone."""
        if self.uniform is not None or self.steps.size < 2 * _PART:
            return ((0, self.median),)
        windows = np.lib.stride_tricks.sliding_window_view(self.steps, _PART)
        local = np.pad(np.median(windows, axis=1), (_PART // 2, _PART - 1 - _PART // 2), "edge")
        if np.mean(np.abs(self.steps / local - 1.0) <= _ALIKE) < _MOST_EQUAL:
            return ((0, self.median),)
        leaps = 1 + np.flatnonzero(np.abs(np.diff(local)) > 2.0 * _ALIKE * local[1:])
        first = [0, *(int(row) for row in leaps if row >= _PART)]
        parts = [np.median(part) for part in np.split(self.steps, first[1:])]
        kept = [n for n in range(len(first)) if n == 0 or abs(parts[n] / parts[n - 1] - 1.0) > 2.0 * _ALIKE]
        return tuple((first[n], float(parts[n])) for n in kept)

    @property
    def _ordinary(self) -> float:
        return max(self.median, float(np.quantile(self.steps, _MOST_EQUAL)))

    @property
    def runs(self) -> bool:
        """Whether this is an axis: it rises, nine in ten of its steps equal but for rounding."""
        if self.steps.size < 2 or not (self.steps > 0.0).all():
            return False
        alike = np.abs(self.steps / self.median - 1.0) <= _ALIKE
        return bool(np.mean(alike) >= _MOST_EQUAL) or self.uniform is not None


def grid(time: Floats) -> Grid:
    """The account of times or distances, shape (n,)."""
    if time.size < 2:
        return Grid(time=time, steps=np.empty(0), median=0.0, regular=np.empty(0, dtype=np.bool_))
    # Steps that overflow are no grid.
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(time)
        median = float(np.median(steps))
        # In a long record, times written with few digits differ in the last digit.
        regular = np.abs(steps - median) <= JITTER * median + 2.0 * np.spacing(np.abs(time).max())
        uniform = time if regular.all() else _rounded(time)
    return Grid(time=time, steps=steps, median=median, regular=regular, uniform=uniform)


def _rounded(time: Floats) -> Floats | None:
    """The uniform grid of which these times are rounded values, shape (n_time,); `None` if they are not.

    The grid is the regression of the time on the number of the sample, which rounding does not bias, unlike the
    median step. Each time may differ from it by half of the last digit with which it is written, more is jitter: one
    column may have times of different numbers of decimals, as a format with a fixed number of significant digits
    prints them. A digit above half a step could equally be a missing sample.
    """
    index = np.arange(time.size) - 0.5 * (time.size - 1)
    slope = float(index @ time) / float(index @ index)
    line = np.asarray(np.mean(time) + slope * index, dtype=np.float64)
    digit = last_digit(time)
    typical = float(np.median(digit))
    if typical > 0.5 * slope:
        return None
    # The regression of a short record is itself uncertain by a fifth of the typical digit.
    allowed = np.minimum(0.5 * digit + 0.25 * typical, 0.5 * slope)
    return line if np.all(np.abs(time - line) <= allowed) else None


def last_digit(values: Floats) -> Floats:
    """Power of ten of the last decimal with which each value can be written, shape of `values`, 1 to 1e-12."""
    digit = np.full(values.shape, 1e-12)
    for power in range(12, -1, -1):
        scaled = values * 10.0**power
        # Values that were converted from another unit are a few roundings away from their decimals.
        written = np.abs(scaled - np.round(scaled)) <= 1e-9 + 8.0 * np.spacing(np.abs(scaled))
        digit = np.where(written, 10.0**-power, digit)
    return digit
