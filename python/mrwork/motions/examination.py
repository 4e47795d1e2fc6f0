"""What a colleague would ask about a ground motion: its step, its size, its mean, wild samples and clipped peaks.

Of a road: kerbs, a slope at its start, its step and the unit of its heights. A motion without such faults has no
remarks. Limits lie between measured records with their processing, and the slips and faults of loggers, units and
tables.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.errors import RecordError

# The strongest accelerograms reach 43 m/s^2; values far beyond indicate a wrong unit, half a gal triggers no recorder.
_LARGEST = 200.0
_STRONGEST, _WEAKEST = 45.0, 0.005
# Steps of accelerograms are 1 to 20 ms; shaking tables are sampled at up to 10 kHz.
_LONGEST_STEP, _SHORTEST_STEP = 0.1, 5e-5
# Samples of a record of which a shape is told.
_FEWEST_WITH_SHAPE = 250
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


_STEP_UNLIKELY: Final = RemarkKind(
    "step_unusual",
    "ground motion {0}: its step is {value:.3g} s, and accelerograms have 1 to 20 ms",
    "check whether the times are seconds, milliseconds or sample numbers",
)
_CONSTANT: Final = RemarkKind(
    "acceleration_constant",
    "ground motion {0}: it is {value:.4g} m/s2 throughout",
    "check the column and the channel",
)
_PEAK: Final = RemarkKind(
    "acceleration_unusual",
    f"ground motion {{0}}: its peak is {{value:.3g}} m/s2, and accelerograms have {_WEAKEST:g} to {_STRONGEST:g} m/s2",
    "check the unit of the acceleration",
)
_WILD: Final = RemarkKind(
    "samples_wild",
    "ground motion {0}: a sample leaps away from both neighbours at {at:.6g} s by {value:.3g} m/s2, more than any "
    "other (such samples: {count})",
    "correct what the recorder did not measure",
)
_CLIPPED: Final = RemarkKind(
    "acceleration_clipped",
    "ground motion {0}: {count} samples are at its peak of {value:.4g} m/s2 exactly, so the record is clipped",
    "take one of a recorder with a wider range",
)
_OFFSET: Final = RemarkKind(
    "acceleration_offset",
    "ground motion {0}: its mean of {value:.3g} m/s2 is an offset, with which the ground drifts by {drift:.3g} m",
    "take it off, by baseline = 0 of the [[motion]] or mr.motions.baseline_corrected(motion, order=0)",
)


# Peak forces of shakers, wind and crowds over the weight.
_LEAST_SHARE, _MOST_SHARE = 1e-6, 10.0
_FORCE: Final = RemarkKind(
    "floor_force_unusual",
    "motion {0}: the peak of its forces is {value:.3g} N, {share:.3g} times the weight of the structure",
    "check the unit of the forces, as kN for N, and the masses",
)


# A force that sets in at once moves a structure up to twice as far as it does in the end.
_OVERSHOOT = 2.0
# Steps of a force in first periods of the structure, beyond which no wind or crowd is recorded.
_LONG_STEP = 10.0
_SUDDEN: Final = RemarkKind(
    "force_sudden",
    "motion {0}: its forces set in at once with {value:.3g} N, {percent:.0f} % of their peak, so that peak responses "
    "may be those of the start",
    "let the forces rise from zero over some periods of the structure",
)
_FORCE_WILD: Final = RemarkKind(
    "force_wild",
    "motion {0}: a force leaps away from both neighbours at {at:.6g} s by {value:.3g} N, more than any other (such "
    "samples: {count})",
    "take it out of the file if it is a fault of the recorder",
)
_FORCE_STEP: Final = RemarkKind(
    "force_step_long",
    "motion {0}: the step of its forces is {value:.3g} s, and the first period of the structure {period:.3g} s",
    "check whether the times are seconds, milliseconds or sample numbers",
)


def force_remarks(name: str, forces: Floats, dt: float, weight: float, period: float) -> Iterator[Remark]:
    """Remarks on forces on floors [N], shape (n_floors, n_time), every `dt` [s].

    The structure has this weight [N] and first period [s].
    """
    total = forces.sum(axis=0)
    if not (peak := float(np.abs(total).max(initial=0.0))) > 0.0:
        return
    if not _LEAST_SHARE <= peak / weight <= _MOST_SHARE:
        yield _FORCE.remark(name, measured=Measured(peak, "N"), share=peak / weight)
    if dt > _LONG_STEP * period:
        yield _FORCE_STEP.remark(name, measured=Measured(dt, "s"), period=period)
    first = abs(float(total[0]))
    if _OVERSHOOT * first > peak:
        yield _SUDDEN.remark(name, measured=Measured(first, "N"), percent=100.0 * first / peak)
    if total.size >= _FEWEST_WITH_SHAPE and (wild := _wild_samples(total)).size:
        at = int(wild[0])
        leap = float(np.abs(total[at] - total[[at - 1, at + 1]]).min())
        yield _FORCE_WILD.remark(name, measured=Measured(leap, "N"), at=dt * at, count=wild.size)


_UNFELT: Final = RemarkKind(
    "ground_unfelt",
    "motion {0}: its ground accelerates to {value:.3g} m/s2, and nothing of the structure follows the ground, because "
    "its influence is zero",
    "give the influence of [building], or forces in place of the ground",
)


def unfelt_ground(name: str, peak: float, *, follows: bool) -> Iterator[Remark]:
    """Warn of a ground motion [m/s^2] under a structure of which nothing follows the ground."""
    if peak > 0.0 and not follows:
        yield _UNFELT.remark(name, measured=Measured(peak, "m/s^2"))


def motion_remarks(
    name: str, acceleration: Floats, velocity: Floats, dt: float, *, scaled: bool = False
) -> Iterator[Remark]:
    """Remarks on a motion [m/s^2], [m/s], [s], shape (n_time,); on a scaled motion, none on its size."""
    peak = float(np.abs(acceleration).max())
    if not _SHORTEST_STEP <= dt <= _LONGEST_STEP:
        yield _STEP_UNLIKELY.remark(name, measured=Measured(dt, "s"))
    if np.ptp(acceleration) <= 1e-9 * peak:
        yield _CONSTANT.remark(name, measured=Measured(float(acceleration[0]), "m/s^2"))
        return
    if acceleration.size < _FEWEST_WITH_SHAPE:
        return
    if not scaled and not _WEAKEST <= peak <= _STRONGEST:
        yield _PEAK.remark(name, measured=Measured(peak, "m/s^2"))
    if (wild := _wild_samples(acceleration)).size:
        first = int(wild[0])
        leap = float(np.abs(acceleration[first] - acceleration[[first - 1, first + 1]]).min())
        yield _WILD.remark(name, measured=Measured(leap, "m/s^2"), at=dt * first, count=wild.size)
    if (count := _at_top(acceleration)) > 0:
        yield _CLIPPED.remark(name, measured=Measured(peak, "m/s^2"), count=count)
    if (drift := _drift(velocity, dt)) > 0.0:
        yield _OFFSET.remark(name, measured=Measured(float(np.mean(acceleration)), "m/s^2"), drift=drift)


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


# Wheels hop at 10 to 15 Hz, and the spline needs several samples of a wave [s].
_COARSE = 1.0 / 120.0
# Vertical velocities [m/s]: 1 % of 36 km/h at the start, and more than wheels follow anywhere.
_FIRST_RISE, _STEEPEST = 0.1, 20.0
# A kerb: a step [m] that is so many times those beside it, and those of all but one sample in a hundred.
_KERB, _OVER_NEXT, _OVER_MOST = 1e-3, 5.0, 3.0

_ROAD_COARSE: Final = RemarkKind(
    "road_coarse",
    "road {0}: its step is {value:.3g} s, and the hop of wheels at 10 to 15 Hz takes 1/120 s or less",
    "give heights at a spacing of the speed / 120 Hz or less",
)
_ROAD_KERB: Final = RemarkKind(
    "road_kerb",
    "road {0}: at {at:.4g} s it changes by {value:.3g} m from one sample to the next, as at a kerb; the spline "
    "overshoots by 11 %, and peaks of the tyre are some 10 % too large (such steps: {count})",
    "round the kerb over the length in which the tyre touches the road, about 0.1 m",
)
_ROAD_SLOPE: Final = RemarkKind(
    "road_slope",
    "road {0}: it begins with a slope, on which it rises or falls by {value:.3g} m/s, and the spline begins level",
    "let the profile begin level: cut it where it is, or fade its heights in",
)
_ROAD_STEEP: Final = RemarkKind(
    "road_steep",
    "road {0}: it rises or falls by up to {value:.3g} m/s, more than wheels follow",
    "check the unit of its heights, and the speed",
)


def road_remarks(name: str, heights: Floats, dt: float) -> Iterator[Remark]:
    """Remarks on a road of these heights [m], shape (n_time,), every `dt` [s]."""
    steps = np.abs(np.diff(heights))
    if dt > _COARSE * (1.0 + 1e-9):
        yield _ROAD_COARSE.remark(name, measured=Measured(dt, "s"))
    if (rise := float(steps[0]) / dt) > _FIRST_RISE:
        yield _ROAD_SLOPE.remark(name, measured=Measured(rise, "m/s"))
    beside = np.maximum(np.append(0.0, steps[:-1]), np.append(steps[1:], 0.0))
    least = max(_KERB, _OVER_MOST * float(np.quantile(steps, 0.99)))
    kerbs = np.flatnonzero((steps > _OVER_NEXT * beside) & (steps > least))
    if kerbs.size:
        first = int(kerbs[0])
        measured = Measured(float(steps[first]), "m")
        yield _ROAD_KERB.remark(name, measured=measured, at=dt * (first + 1), count=kerbs.size)
    elif (fastest := float(steps.max()) / dt) > _STEEPEST:
        yield _ROAD_STEEP.remark(name, measured=Measured(fastest, "m/s"))
