"""Detector of a delay between force and displacement, from the corner of the force at motion reversals."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.checks import half_range
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import SmoothMotion, turning_points

# All in periods of the dominant frequency.
_LONGEST: Final = 0.05
_STEP: Final = 0.001
_BEFORE: Final = (0.05, 0.1)
_FOLDED: Final = 0.25
# End of the fit: fall of the force from the branch before the turn, in half ranges.
_FALL: Final = 0.3
_FEWEST: Final = 12
_FEWEST_TURNS: Final = 2
_ALIKE: Final = 0.1
# Ratio of the mean square residual with a corner to that of a smooth curve with one more parameter: 0.1 to 0.7 for
# models with displacement hysteresis, 0.9 to 1.1 if the force is a smooth function of the motion.
_SHARPNESS: Final = 0.7
# Largest rms residual relative to the half range of the force; the rest must be noise.
_LARGEST_RESIDUAL: Final = 0.02
_AGREEMENT: Final = 0.006
_SIGNIFICANT: Final = 3.0
# Fall of the force at the turn, in half ranges, required for a lead.
_PASSED: Final = 1.0


def force_delay(test: DamperTest, motion: SmoothMotion) -> Measured | None:
    """Delay of the force behind the displacement [s], or `None` if the force has no corner at the turns.

    When the motion reverses, a hysteretic force leaves its branch at once, and its slope over time has a corner. Folded
    over all turns, the force is fitted by

        p(s) + q2 max(s - tau, 0)^2 + q3 max(s - tau, 0)^3,    p a parabola, s the time since the turn,

    in two windows that start a twentieth and a tenth of a period before the corner and end when the force has fallen
    by 0.3 of its half range. The tau of least residual is the delay, provided that both windows agree to 0.6 % of a
    period and no smooth curve fits as well. A force that falls smoothly with the velocity has no such corner, and
    averaging over time removes it. If the force falls steeply with the velocity before the turn, the corner is early:
    a lag is then underestimated, and a lead counts only if the force has passed its middle at the turn. Compliance in
    series with the damper delays the corner in the same way as a slow channel. A varying command changes the force
    between turns, which can then not be folded.
    """
    if test.has_varying_command or test.smoothing is not None:
        return None
    period = 1.0 / motion.frequency
    place, direction = turning_points(motion.displacement, motion.velocity)
    # Turns with different accelerations have corners of different widths and cannot be averaged.
    sharp = np.abs(np.interp(place, np.arange(test.n_time), motion.acceleration))
    if place.size < _FEWEST_TURNS or np.std(sharp) > _ALIKE * np.mean(sharp):
        return None
    branch = _folded(test.force, place, direction, period / test.dt)
    if branch is None:
        return None
    corners = [_corner(*branch, before) for before in _BEFORE]
    sharpness = float(np.mean([residual for _, residual in corners]))
    delays = np.array([delay for delay, _ in corners])
    if not (sharpness < _SHARPNESS and np.ptp(delays) <= _AGREEMENT):
        return None
    # The windows may agree exactly, and a corner may lie anywhere between two samples.
    between = test.dt / (np.sqrt(12.0) * period)
    error = float(np.linalg.norm([np.ptp(delays) / 2.0, _STEP, between]))
    delay = float(delays.mean())
    time, force, _ = branch
    if delay < -_SIGNIFICANT * error and np.interp(0.0, time, force) > -_PASSED:
        return None
    return Measured(value=delay * period, standard_error=error * period, unit="s")


def delay_finding(test: DamperTest, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a delay of more than three standard errors and half a sample."""
    delay = force_delay(test, motion)
    if delay is None or delay.standard_error is None:
        return ()
    if abs(delay.value) < max(_SIGNIFICANT * delay.standard_error, 0.5 * test.dt):
        return ()
    lags = "lags" if delay.value > 0.0 else "leads"
    message = (
        f"the force {lags} the displacement by {1e3 * abs(delay.value):.3g} +- {1e3 * delay.standard_error:.2g} ms "
        f"({abs(delay.value) / test.dt:.1f} samples), measured at motion reversals"
    )
    return (Finding.warning("force_delay", message, action="correct it by --repair delay", measured=delay),)


def _folded(
    force: NDArray[np.float64],
    place: NDArray[np.float64],
    direction: NDArray[np.float64],
    period: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Mean force about the turns: time [periods], force [half ranges, falling], and number of samples in each mean."""
    reach = _FOLDED * period
    inside = (place - reach >= 0.0) & (place + reach <= force.size - 1.0)
    place, direction = place[inside], direction[inside]
    scale = half_range(force)
    if place.size < _FEWEST_TURNS or scale == 0.0:
        return None
    offsets = np.arange(-int(reach), int(reach) + 1)
    rows = np.round(place).astype(np.intp)[:, np.newaxis] + offsets
    rows = np.clip(rows, 0, force.size - 1)
    since = (rows - place[:, np.newaxis]) / period
    falling = direction[:, np.newaxis] * force[rows] / scale
    # Offset and stiffness shift the turns at one end of the stroke relative to the other.
    ahead = (since <= -_BEFORE[0]) & (since > -_BEFORE[1])
    if not ahead.any(axis=1).all():
        return None
    falling -= (np.sum(falling * ahead, axis=1) / ahead.sum(axis=1))[:, np.newaxis]
    bins = np.floor(since / _STEP).astype(np.intp)
    bins -= bins.min()
    count = np.bincount(bins.ravel()).astype(np.float64)
    kept = count > 0.0
    mean_time = np.bincount(bins.ravel(), since.ravel())[kept] / count[kept]
    mean_force = np.bincount(bins.ravel(), falling.ravel())[kept] / count[kept]
    return mean_time, mean_force, count[kept]


def _corner(
    time: NDArray[np.float64], force: NDArray[np.float64], count: NDArray[np.float64], before: float
) -> tuple[float, float]:
    """Delay of the corner [periods], and its mean square residual relative to that of a smooth curve."""
    delays = np.arange(-_LONGEST, _LONGEST + 0.5 * _STEP, _STEP)
    windows = [_until_fallen(time, force, count, delay, before) for delay in delays]
    residual = np.full(delays.size, np.inf)
    for trial, (delay, window) in enumerate(zip(delays, windows, strict=True)):
        if np.count_nonzero(window) >= _FEWEST:
            s = (time[window] - delay) / before
            past = np.maximum(s, 0.0)
            columns = np.stack([np.ones_like(s), s, s**2, past**2, past**3], axis=1)
            residual[trial] = _mean_square(columns, force[window], count[window])
    best = int(np.argmin(residual))
    if not residual[best] < _LARGEST_RESIDUAL**2 or best in (0, delays.size - 1):
        return float(delays[best]), np.inf
    window = windows[best]
    columns = np.vander((time[window] - delays[best]) / before, 6)
    smooth = _mean_square(columns, force[window], count[window])
    return float(delays[best]), float(residual[best] / smooth)


def _until_fallen(
    time: NDArray[np.float64],
    force: NDArray[np.float64],
    count: NDArray[np.float64],
    delay: float,
    before: float,
) -> NDArray[np.bool_]:
    """Samples from `before` the corner until the force has fallen enough from its branch, a parabola."""
    ahead = (time > delay - before) & (time <= delay)
    if np.count_nonzero(ahead) < _FEWEST // 2:
        return np.zeros_like(ahead)
    weight = np.sqrt(count[ahead])[:, np.newaxis]
    columns = np.vander(time - delay, 3)
    branch = np.linalg.lstsq(columns[ahead] * weight, force[ahead] * weight[:, 0], rcond=None)[0]
    fallen = (time > delay) & (np.abs(columns @ branch - force) > _FALL)
    end = time[np.argmax(fallen)] if fallen.any() else time[-1]
    return np.asarray((time > delay - before) & (time <= end))


def _mean_square(
    columns: NDArray[np.float64], force: NDArray[np.float64], count: NDArray[np.float64]
) -> float:
    """Mean square of the weighted least-squares residual."""
    weight = np.sqrt(count)
    weighted = columns * weight[:, np.newaxis]
    coefficients = np.linalg.lstsq(weighted, force * weight, rcond=None)[0]
    misfit = force * weight - weighted @ coefficients
    return float(misfit @ misfit / count.sum())
