"""Steps of the times of a file: which are equal, and the uniform grid of times in rounded decimals."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats

JITTER: Final = 1e-3
"""Steps that differ by less, relative to their median, count as equal."""


def regular_steps(time: Floats) -> tuple[Floats, float, NDArray[np.bool_]]:
    """Steps of times, shape (n_time,), their median, and which of them are equal to it but for jitter."""
    steps = np.diff(time)
    median = float(np.median(steps))
    # In a long record, times written with few digits differ in the last digit.
    return steps, median, np.abs(steps - median) <= JITTER * median + 2.0 * np.spacing(np.abs(time).max())


def rounded_grid(time: Floats) -> Floats | None:
    """The uniform grid of which these times are rounded values, shape (n_time,); `None` if they are not.

    The grid is the regression of the time on the number of the sample, which rounding does not bias, unlike the
    median step. Each time may differ from it by half of the last digit with which it is written, more is jitter: one
    column may have times of different numbers of decimals, as a format with a fixed number of significant digits
    prints them. A digit above half a step could equally be a missing sample.
    """
    index = np.arange(time.size) - 0.5 * (time.size - 1)
    slope = float(index @ time) / float(index @ index)
    grid = np.asarray(np.mean(time) + slope * index, dtype=np.float64)
    digit = last_digit(time)
    typical = float(np.median(digit))
    if typical > 0.5 * slope:
        return None
    # The regression of a short record is itself uncertain by a fifth of the typical digit.
    allowed = np.minimum(0.5 * digit + 0.25 * typical, 0.5 * slope)
    return grid if np.all(np.abs(time - grid) <= allowed) else None


def last_digit(values: Floats) -> Floats:
    """Power of ten of the last decimal with which each value can be written, shape of `values`, 1 to 1e-12."""
    digit = np.full(values.shape, 1e-12)
    for power in range(12, -1, -1):
        scaled = values * 10.0**power
        # Values that were converted from another unit are a few roundings away from their decimals.
        written = np.abs(scaled - np.round(scaled)) <= 1e-9 + 8.0 * np.spacing(np.abs(scaled))
        digit = np.where(written, 10.0**-power, digit)
    return digit
