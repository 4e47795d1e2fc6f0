"""What a colleague would ask about a ground motion: its step, its size, its mean, wild samples and clipped peaks.

The questions are sentences; a motion that has none is silent. Limits lie between measured records with their
processing, and the slips and faults of loggers, units and tables.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.errors import RecordError

# The strongest accelerograms reach 43 m/s^2; values far beyond indicate a wrong unit, half a gal triggers no recorder.
_LARGEST = 200.0
_STRONGEST, _WEAKEST = 45.0, 0.005
# Steps of accelerograms are 1 to 20 ms; shaking tables are sampled at up to 10 kHz.
_LONGEST_STEP, _SHORTEST_STEP = 0.1, 5e-5
# Samples of a record of which a shape is told.
_FEWEST = 250
# Wild samples: how many at most, their height over the peak, and over the next extreme. Of sixty measured and synthetic
# records the ratio is up to 2 for low extremes, and up to 1.7 for such high ones.
_MOST_WILD, _HEIGHT, _ABOVE_NEXT = 10, 0.5, 2.2
# Clipped peaks: samples at the extreme value, over those at any other value beyond half of it.
_AT_TOP, _OVER_OTHERS = 4, 3.0
# An offset: the displacement that it makes [m], and the share of the variance of the velocity that its slope explains.
_DRIFT, _EXPLAINED = 1.0, 0.8


def refuse_absurd(acceleration: Floats, *, source: str) -> None:
    """Refuse accelerations [m/s^2] beyond any earthquake."""
    peak = float(np.abs(acceleration).max(initial=0.0))
    if not peak <= _LARGEST:
        raise RecordError(
            f"{source}: a peak of {peak:.4g} m/s2 is beyond any earthquake; check the unit of the acceleration"
        )


def questions_of(acceleration: Floats, velocity: Floats, dt: float, *, scaled: bool = False) -> Iterator[str]:
    """Questions about a motion [m/s^2], [m/s], [s], shape (n_time,); about a scaled motion, none on its size."""
    peak = float(np.abs(acceleration).max())
    if not _SHORTEST_STEP <= dt <= _LONGEST_STEP:
        yield (
            f"its step is {dt:.3g} s, and accelerograms have 1 to 20 ms; check whether the times are seconds, "
            "milliseconds or sample numbers"
        )
    if np.ptp(acceleration) <= 1e-9 * peak:
        yield f"it is {acceleration[0]:.4g} m/s2 throughout; check the column and the channel"
        return
    if acceleration.size < _FEWEST:
        return
    if not scaled and not _WEAKEST <= peak <= _STRONGEST:
        yield (
            f"its peak is {peak:.3g} m/s2, and accelerograms have {_WEAKEST:g} to {_STRONGEST:g} m/s2; check the unit "
            "of the acceleration"
        )
    if (wild := _wild_samples(acceleration)).size:
        first = wild[0]
        leap = np.abs(acceleration[first] - acceleration[[first - 1, first + 1]]).min()
        yield (
            f"a sample leaps away from both neighbours at {dt * first:.6g} s by {leap:.3g} m/s2, more than any other "
            f"(such samples: {wild.size}); correct what the recorder did not measure"
        )
    if (count := _at_top(acceleration)) > 0:
        yield (
            f"{count} samples are at its peak of {peak:.4g} m/s2 exactly, so the record is clipped; take one of a "
            "recorder with a wider range"
        )
    if (drift := _drift(velocity, dt)) > 0.0:
        yield (
            f"its mean of {np.mean(acceleration):.3g} m/s2 is an offset, with which the ground drifts by {drift:.3g} "
            "m; take it off, by baseline = 0 of the [[motion]] or mr.motions.baseline_corrected(motion, order=0)"
        )


def _wild_samples(acceleration: Floats) -> NDArray[np.intp]:
    """Indices of the extremes that leap from both neighbours as no other does."""
    steps = np.diff(acceleration)
    leaps = np.where(steps[:-1] * steps[1:] < 0.0, np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])), 0.0)
    order = np.argsort(leaps)[::-1][: _MOST_WILD + 1]
    high = leaps[order]
    apart = (high[:-1] > _ABOVE_NEXT * high[1:]) & (high[:-1] > _HEIGHT * np.abs(acceleration).max())
    return np.sort(order[: int(np.flatnonzero(apart).max(initial=-1)) + 1]) + 1


def _at_top(acceleration: Floats) -> int:
    """Number of samples at the extreme value; 0 where as many are at others, as of coarse digits or a sine."""
    size = np.round(np.abs(acceleration) / np.abs(acceleration).max(), 9)
    counts = np.unique(size[size > 0.5], return_counts=True)[1]
    others = counts[:-1].max(initial=1)
    return int(counts[-1]) if counts[-1] >= max(_AT_TOP, _OVER_OTHERS * others) else 0


def _drift(velocity: Floats, dt: float) -> float:
    """Displacement that a constant offset makes [m]; 0 where the velocity shows no such offset."""
    (spread, common), (_, total) = np.cov(dt * np.arange(velocity.size), velocity)
    drift = 0.5 * abs(float(common / spread)) * (dt * velocity.size) ** 2
    return drift if drift > _DRIFT and common**2 > _EXPLAINED * spread * total else 0.0
