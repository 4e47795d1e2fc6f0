"""Parts of histories that figures show: fewer samples with the same peaks, and the interval about the largest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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


def strong_part(time: Floats, signal: Floats, seconds: float) -> slice:
    """The samples of an interval of `seconds` around the peak of a signal."""
    at = time[int(np.abs(signal).argmax())]
    end = min(max(at + seconds / 2.0, time[0] + seconds), time[-1])
    first, last = np.searchsorted(time, [end - seconds, end])
    return slice(int(first), int(last) + 1)
