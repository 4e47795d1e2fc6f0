"""Detector of spikes: a few samples far beyond all others, as of a loose contact or a lost telegram."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.damper_test import Finding, Measured
from mrwork.records.sampling import Signals

# Samples of the longest spike, and largest share of a record in spikes; what takes longer may be part of the test.
_LONGEST: Final = 5
_MOST: Final = 0.02
_FEWEST: Final = 50
# Percentiles within which a channel lies without its spikes, and the distance beyond, and the leap there and back
# between two samples, of a spike, in ranges between these percentiles. A sine reaches 0.001 beyond.
_WITHIN: Final = (2.0, 98.0)
_BEYOND: Final = 0.5


def spikes_of(samples: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Samples of a channel that lie in a spike, shape (n_time,).

    A spike is at most five samples long and lies beyond the range of the other samples by half of that range; the
    channel leaps by as much from one sample to the next, there and back.
    """
    found = np.zeros(samples.size, dtype=np.bool_)
    low, high = np.percentile(samples, _WITHIN)
    reach = _BEYOND * (high - low)
    far = (samples < low - reach) | (samples > high + reach)
    if reach == 0.0 or samples.size < _FEWEST or np.count_nonzero(far) > _MOST * samples.size:
        return found
    edges = np.flatnonzero(np.diff(np.concatenate([[False], far, [False]])))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        leaps = np.abs(np.diff(samples[max(first - 1, 0) : last + 1]))
        there = first == 0 or leaps[0] > reach
        back = last == samples.size or leaps[-1] > reach
        found[first:last] = last - first <= _LONGEST and there and back
    return found


def without_spikes(signals: Signals) -> tuple[Signals, NDArray[np.bool_], tuple[Finding, ...]]:
    """Signals with straight lines across the spikes of displacement, velocity and force, and which samples these are.

    The commands keep theirs, which may be meant.
    """
    bridged = np.zeros(signals.time.size, dtype=np.bool_)
    findings = []
    for name, samples in signals.channels():
        if name not in _SEARCHED:
            continue
        spiky = spikes_of(samples)
        if not spiky.any():
            continue
        line = np.interp(signals.time, signals.time[~spiky], samples[~spiky])
        findings.append(_finding(name, signals.time[spiky], samples[spiky]))
        signals = replace(signals, **{name: line})
        bridged |= spiky
    return signals, bridged, tuple(findings)


_SEARCHED: Final = {"displacement": "m", "velocity": "m/s", "force": "N"}


def _finding(name: str, time: NDArray[np.float64], samples: NDArray[np.float64]) -> Finding:
    largest = float(samples[np.argmax(np.abs(samples))])
    plural = "a sample" if samples.size == 1 else f"{samples.size} samples, the first"
    return Finding.warning(
        "spikes",
        f"the {name} has spikes to {largest:.4g} {_SEARCHED[name]} in {plural} at {time[0]:.6g} s; they were bridged "
        "by straight lines, and are neither compared nor part of the tested ranges",
        action=f"check the channel of the {name}",
        measured=Measured(value=largest, unit=_SEARCHED[name]),
    )
