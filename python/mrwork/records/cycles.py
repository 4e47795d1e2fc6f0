"""Detectors over whole cycles of the motion.

They find a moving mass (force in phase with the acceleration), drift from cycle to cycle, and a delay between force and
displacement, from the corner of the force at motion reversals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.records.checks import clipped_samples, half_range, static_force
from mrwork.records.damper_test import DamperTest, outside_spans
from mrwork.records.motion import SmoothMotion, fit_residual, turning_points, whole_cycles

_FEWEST_FOR_MASS: Final = 2
_SIGNIFICANT: Final = 4.0
# Inertia below this fraction of the half range of the force is negligible.
_SHARE_OF_RANGE: Final = 0.02
_MOVING_MASS: Final = RemarkKind(
    "moving_mass",
    "the force has a component in phase with the acceleration: a mass of {mass} kg or more between load cell and "
    "damper, or a force that leads the displacement",
    "fit it with tests at several frequencies by --observe mass=free, or give it by --observe mass=KG",
)


def mass_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a significant mass between load cell and damper [kg], by its lower bound.

    Over whole cycles, viscous and friction forces have no component in phase with the acceleration; springs and
    hysteresis have one in opposite phase. A remaining component in phase,

        m = int (F - mean F) a dt / int a^2 dt > 0,

    is inertia, so that the mass is at least m. A force that leads the displacement has the same effect. The standard
    error is of the mean over the cycles. A varying command changes the force within cycles and hides the mass.
    """
    if test.has_varying_command:
        return
    spans = whole_cycles(motion.displacement)
    # At the corners of a motion an acceleration is that of a filter.
    outside = outside_spans(test)
    moving = [np.arange(span.start, span.stop)[outside[span]] for span in spans if outside[span].any()]
    if len(moving) < _FEWEST_FOR_MASS:
        return
    masses = np.array([_in_phase(test.force[samples], motion.acceleration[samples]) for samples in moving])
    mass = float(masses.mean())
    error = float(masses.std(ddof=1) / np.sqrt(masses.size))
    peak = float(np.percentile(np.abs(motion.acceleration), 99.5))
    if mass < _SIGNIFICANT * error or mass * peak < _SHARE_OF_RANGE * half_range(test.force):
        return
    measured = Measured(mass, "kg", standard_error=error)
    yield _MOVING_MASS.remark(measured=measured, mass=measured.in_words())


def _in_phase(force: Floats, acceleration: Floats) -> float:
    varying = acceleration - acceleration.mean()
    return float((force - force.mean()) @ varying / (varying @ varying))


_FEWEST_FOR_DRIFT: Final = 5
# Relative variation below which stroke and duration count as constant; durations are also rounded to samples.
_STEADY: Final = 0.01
# Correlation of stroke and cycle number above which a drift cannot be separated from the stroke.
_COLLINEAR: Final = 0.9
_LEAST_DRIFT: Final = 0.03
_LOOP_DRIFT: Final = RemarkKind(
    "loop_drift",
    "at equal stroke the dissipative force changes by {change} % from the first cycle to the last, {0}",
    "fit a part of the record (--from, --until)",
)


def drift_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a change of the dissipative force from the first cycle to the last above 3 % and four standard errors.

    The force of a cycle is its dissipated energy per distance travelled, int F v dt / int |v| dt. Its logarithm is
    regressed on the cycle number and, if the stroke varies, on the logarithm of the stroke. The estimate needs five
    cycles of equal duration whose stroke does not change steadily, at a constant command.
    """
    if test.has_varying_command:
        return
    spans = whole_cycles(motion.displacement)
    if len(spans) < _FEWEST_FOR_DRIFT:
        return
    duration = np.array([span.stop - span.start for span in spans])
    if np.std(duration) > _STEADY * np.mean(duration) + 1.0:
        return
    force = test.force - (static_force(test.displacement, test.force, motion.velocity) or 0.0)
    # Cycles without stroke or with negative work have no logarithm.
    tiny = np.finfo(np.float64).tiny
    stroke = np.array([np.ptp(motion.displacement[span]) for span in spans])
    travel = np.array([np.abs(motion.velocity[span]).sum() for span in spans])
    work = np.array([force[span] @ motion.velocity[span] for span in spans])
    if np.any(work <= 0.0) or np.any(stroke <= tiny):
        return
    logarithm = np.log(work / travel)
    progress = np.linspace(0.0, 1.0, len(spans))
    columns = [progress, np.ones_like(progress)]
    if np.std(np.log(stroke)) > _STEADY:
        if abs(np.corrcoef(progress, np.log(stroke))[0, 1]) > _COLLINEAR:
            return
        columns.append(np.log(stroke))
    design = np.stack(columns, axis=1)
    coefficients = np.linalg.lstsq(design, logarithm, rcond=None)[0]
    left = logarithm - design @ coefficients
    variance = float(left @ left) / (len(spans) - design.shape[1])
    change = float(np.expm1(coefficients[0]))
    error = float(np.sqrt(variance * np.linalg.pinv(design.T @ design)[0, 0])) * (1.0 + change)
    if abs(change) >= max(_LEAST_DRIFT, _SIGNIFICANT * error):
        drift = Measured(change, "", standard_error=error)
        likely = "as in a damper that heats up" if change < 0.0 else "as in one that settles in"
        yield _LOOP_DRIFT.remark(likely, measured=drift, change=drift.in_words(100.0))


# All in periods of the dominant frequency.
_LONGEST_TURN: Final = 0.05
_TURN_STEP: Final = 0.001
_BEFORE: Final = (0.05, 0.1)
_FOLDED: Final = 0.25
# End of the fit: fall of the force from the branch before the turn, in half ranges.
_FALL: Final = 0.3
_FEWEST_OF_A_BRANCH: Final = 12
_FEWEST_TURNS: Final = 2
_ALIKE: Final = 0.1
# Ratio of the mean square residuals of a corner and of a smooth curve with one more parameter: 0.1 to 0.7 for
# models with displacement hysteresis, 0.9 to 1.1 if the force is a smooth function of the motion.
_SHARPNESS: Final = 0.7
# Largest rms residual relative to the half range of the force; the rest must be noise.
_LARGEST_RESIDUAL: Final = 0.02
_AGREEMENT: Final = 0.006
_SIGNIFICANT_DELAY: Final = 3.0
# Fall of the force at the turn, in half ranges, required for a lead.
_PASSED: Final = 1.0
_LATE_FORCE: Final = RemarkKind(
    "force_delay",
    "the force {0} the displacement by {late} ms ({samples:.1f} samples), measured at motion reversals",
    "fit it with tests at several frequencies by --observe delay=free, or give it by --observe delay=SECONDS",
)


def delay_remark(test: DamperTest, motion: SmoothMotion) -> Iterator[Remark]:
    """Warn of a delay of the force behind the displacement [s] of more than three standard errors and half a sample.

    When the motion reverses, a hysteretic force leaves its branch at once, and its slope over time has a corner. Folded
    over all turns, the force is fitted by

        p(s) + q2 max(s - tau, 0)^2 + q3 max(s - tau, 0)^3,    p a parabola, s the time since the turn,

    in two windows that start a twentieth and a tenth of a period before the corner and end when the force has fallen by
    0.3 of its half range. The tau of least residual is the delay, provided that both windows agree to 0.6 % of a period
    and no smooth curve fits as well. A force that falls smoothly with the velocity has no such corner, and averaging
    over time removes it; a clipped force has another. If the force falls steeply with the velocity before the turn, the
    corner is early: a lag is then underestimated, and a lead counts only if the force has passed its middle at the
    turn. Compliance in series with the damper delays the corner in the same way as a slow channel. A varying command
    changes the force between turns, which can then not be folded.
    """
    if test.has_varying_command or test.smoothing is not None or clipped_samples(test.force).any():
        return
    period = 1.0 / motion.frequency
    turn, direction = turning_points(motion.displacement, motion.velocity)
    # Turns with different accelerations have corners of different widths and cannot be averaged.
    sharp = np.abs(np.interp(turn, np.arange(test.n_time), motion.acceleration))
    if turn.size < _FEWEST_TURNS or np.std(sharp) > _ALIKE * np.mean(sharp):
        return
    branch = _fold_periods(test.force, turn, direction, period / test.dt)
    if branch is None:
        return
    corners = []
    for before in _BEFORE:
        corner = _corner(*branch, before)
        if corner is None:
            return
        corners.append(corner)
    delays, ratios = np.array(corners).T
    sharpness = float(ratios.mean())
    if not (sharpness < _SHARPNESS and np.ptp(delays) <= _AGREEMENT):
        return
    # The windows may agree exactly, and a corner may lie anywhere between two samples.
    between = test.dt / (np.sqrt(12.0) * period)
    error = float(np.linalg.norm([np.ptp(delays) / 2.0, _TURN_STEP, between]))
    delay = float(delays.mean())
    time, force, _ = branch
    if delay < -_SIGNIFICANT_DELAY * error and np.interp(0.0, time, force) > -_PASSED:
        return
    if abs(delay) * period < max(_SIGNIFICANT_DELAY * error * period, 0.5 * test.dt):
        return
    late = Measured(delay * period, "s", standard_error=error * period)
    yield _LATE_FORCE.remark(
        "lags" if delay > 0.0 else "leads",
        measured=late,
        late=late.in_words(math.copysign(1e3, delay)),
        samples=abs(late.value) / test.dt,
    )


def _fold_periods(
    force: Floats, turn: Floats, direction: Floats, period: float
) -> tuple[Floats, Floats, Floats] | None:
    """Mean force about the turns: time [periods], force [half ranges, falling], and number of samples in each mean."""
    reach = _FOLDED * period
    inside = (turn - reach >= 0.0) & (turn + reach <= force.size - 1.0)
    turn, direction = turn[inside], direction[inside]
    scale = half_range(force)
    if turn.size < _FEWEST_TURNS or scale == 0.0:
        return None
    offsets = np.arange(-int(reach), int(reach) + 1)
    rows = np.round(turn).astype(np.intp)[:, np.newaxis] + offsets
    rows = np.clip(rows, 0, force.size - 1)
    since = (rows - turn[:, np.newaxis]) / period
    falling = direction[:, np.newaxis] * force[rows] / scale
    # Offset and stiffness shift the turns at one end of the stroke relative to the other.
    ahead = (since <= -_BEFORE[0]) & (since > -_BEFORE[1])
    if not ahead.any(axis=1).all():
        return None
    falling -= (np.sum(falling * ahead, axis=1) / ahead.sum(axis=1))[:, np.newaxis]
    bins = np.floor(since / _TURN_STEP).astype(np.intp)
    bins -= bins.min()
    count = np.bincount(bins.ravel()).astype(np.float64)
    mask = count > 0.0
    mean_time = np.bincount(bins.ravel(), since.ravel())[mask] / count[mask]
    mean_force = np.bincount(bins.ravel(), falling.ravel())[mask] / count[mask]
    return mean_time, mean_force, count[mask]


def _corner(time: Floats, force: Floats, count: Floats, before: float) -> tuple[float, float] | None:
    """Delay of the corner [periods], and its mean square residual relative to a smooth curve; `None` without."""
    delays = np.arange(-_LONGEST_TURN, _LONGEST_TURN + 0.5 * _TURN_STEP, _TURN_STEP)
    windows = [_until_fallen(time, force, count, delay, before) for delay in delays]
    residual = [
        _mean_square(_with_corner((time[window] - delay) / before), force[window], count[window])
        if window.stop - window.start >= _FEWEST_OF_A_BRANCH
        else np.inf
        for delay, window in zip(delays, windows, strict=True)
    ]
    best = int(np.argmin(residual))
    if not residual[best] < _LARGEST_RESIDUAL**2 or best in (0, delays.size - 1):
        return None
    window = windows[best]
    smooth = _mean_square(np.vander((time[window] - delays[best]) / before, 6), force[window], count[window])
    # A force that stands still is as smooth as it is cornered.
    return (float(delays[best]), residual[best] / smooth) if smooth > 0.0 else None


def _until_fallen(time: Floats, force: Floats, count: Floats, delay: float, before: float) -> slice:
    """Samples from `before` the corner until the force has fallen enough from the parabola ahead of it."""
    first, turned = np.searchsorted(time, [delay - before, delay], side="right").tolist()
    if turned - first < _FEWEST_OF_A_BRANCH // 2:
        return slice(first, first)
    since = time - delay
    branch = np.polyfit(since[first:turned], force[first:turned], 2, w=np.sqrt(count[first:turned]))
    fallen = np.abs(np.polyval(branch, since[turned:]) - force[turned:]) > _FALL
    return slice(first, turned + int(np.argmax(fallen)) + 1 if fallen.any() else time.size)


def _with_corner(s: Floats) -> Floats:
    """Terms of a parabola and a corner at the time `s` since it, shape (n_time, 5)."""
    past = np.maximum(s, 0.0)
    return np.stack([np.ones_like(s), s, s**2, past**2, past**3], axis=1)


def _mean_square(columns: Floats, force: Floats, count: Floats) -> float:
    weight = np.sqrt(count)
    misfit = fit_residual(columns * weight[:, np.newaxis], force * weight)
    return float(misfit @ misfit / count.sum())
