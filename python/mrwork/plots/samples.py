"""Samples that figures draw: a few cycles of a record, points along a curve, and the peaks of a long signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.records.motion import whole_cycles

CYCLES_SHOWN = 3

_GOLDEN = 0.6180339887498949


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Samples start..stop-1 of a record, with the numbers of their cycles."""

    start: int
    stop: int
    in_words: str = "Middle of the record"


def zoom_window(displacement: Floats) -> Window:
    """A few whole cycles from the middle of a record, or its middle third where it has none.

    At most half of the cycles are shown, so that the window enlarges the record.
    """
    cycles, third = whole_cycles(displacement), displacement.size // 3
    shown = min(CYCLES_SHOWN, (len(cycles) + 1) // 2)
    if shown < 1:
        return Window(start=third, stop=max(displacement.size - third, third + 1))
    first = (len(cycles) - shown) // 2
    last = first + shown
    words = f"Cycles {first + 1} to {last}" if shown > 1 else f"Cycle {last}"
    return Window(start=cycles[first].start, stop=cycles[last - 1].stop + 1, in_words=words)


def even_samples(abscissa: Floats, ordinate: Floats, most: int, *, aspect: float) -> NDArray[np.intp]:
    """At most `most` samples at equal steps along the drawn curve, shape (n_drawn,).

    Equal steps in time would crowd where the curve is flat and leave gaps where it is steep. `aspect`
    is the width of the drawing over its height.
    """
    return _nearest_samples(abscissa, ordinate, np.arange(most) / most, aspect)


def scattered_samples(abscissa: Floats, ordinate: Floats, most: int) -> NDArray[np.intp]:
    """At most `most` samples spread along a loop that is passed many times, shape (n_drawn,).

    Equal steps can coincide with the cycles and draw the same few points repeatedly; a reproducible
    golden-ratio jitter within each step avoids that.
    """
    number = np.arange(most)
    return _nearest_samples(abscissa, ordinate, (number + number * _GOLDEN % 1.0) / most, 1.0)


def _nearest_samples(abscissa: Floats, ordinate: Floats, shares: Floats, aspect: float) -> NDArray[np.intp]:
    if ordinate.size <= shares.size:
        return np.arange(ordinate.size)
    across = aspect * np.diff(abscissa) / (float(np.ptp(abscissa)) or 1.0)
    up = np.diff(ordinate) / (float(np.ptp(ordinate)) or 1.0)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(across, up))))
    return np.unique(np.minimum(np.searchsorted(along, shares * along[-1]), ordinate.size - 1))


def envelope(time: Floats, signal: Floats, bins: int) -> tuple[Floats, Floats]:
    """The minimum and the maximum of a signal in each of `bins` intervals, in their order; keeps the peaks."""
    length = len(time) // bins
    if length < 3:
        return time, signal
    whole = length * bins
    parts = signal[:whole].reshape(bins, length)
    at = np.sort(np.stack([parts.argmin(axis=1), parts.argmax(axis=1)], axis=1), axis=1)
    index = np.append((at + length * np.arange(bins)[:, None]).ravel(), np.arange(whole, len(time)))
    return time[index], signal[index]


def part_about_peak(time: Floats, signal: Floats, seconds: float) -> slice:
    """The samples of an interval of `seconds` around the peak of a signal."""
    at = time[int(np.abs(signal).argmax())]
    end = min(max(at + seconds / 2.0, time[0] + seconds), time[-1])
    first, last = np.searchsorted(time, [end - seconds, end])
    return slice(int(first), int(last) + 1)
