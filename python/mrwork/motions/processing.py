"""Processing of ground motions: scaling in amplitude and in time, cutting, resampling and baseline correction.

Each function returns a new motion; its `changes` state what was done.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.polynomial import Legendre

from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion, changed


def scaled(motion: GroundMotion, factor: float) -> GroundMotion:
    """Motion with its acceleration multiplied by `factor`.

    Raises
    ------
    SettingError
        The factor is zero or not finite.
    """
    if not math.isfinite(factor) or factor == 0.0:
        raise SettingError(
            f"ground motion {motion.name}: scaled by {factor}; give a finite factor other than 0"
        )
    return changed(motion, factor * motion.acceleration, motion.dt, f"acceleration x {factor:.6g}")


def scaled_to_peak(motion: GroundMotion, peak: float) -> GroundMotion:
    """Motion scaled so that its peak ground acceleration is `peak` [m/s^2].

    Raises
    ------
    SettingError
        The peak is not positive, or the motion is zero throughout.
    """
    if not (math.isfinite(peak) and peak > 0.0):
        raise SettingError(
            f"ground motion {motion.name}: a peak of {peak} m/s2 is asked for; give a positive one"
        )
    if motion.peak == 0.0:
        raise SettingError(f"ground motion {motion.name}: is zero throughout and cannot be scaled to a peak")
    change = f"scaled from a peak of {motion.peak:.6g} to {peak:.6g} m/s2"
    return changed(motion, motion.acceleration * (peak / motion.peak), motion.dt, change)


def time_scaled(motion: GroundMotion, factor: float) -> GroundMotion:
    """Motion with its time axis multiplied by `factor`: 0.2 makes it five times as fast.

    Accelerations stay as they are, as a model of length scale `factor` squared under the same acceleration wants it.

    Raises
    ------
    SettingError
        The factor is not positive.

    Examples
    --------
    >>> from mrwork.motions.synthetic import synthetic_motion
    >>> time_scaled(synthetic_motion(), 0.2).changes[-1]
    'time axis x 0.2'
    """
    if not (math.isfinite(factor) and factor > 0.0):
        raise SettingError(f"ground motion {motion.name}: time axis x {factor}; give a positive factor")
    return changed(motion, motion.acceleration, factor * motion.dt, f"time axis x {factor:.6g}")


def trimmed(motion: GroundMotion, *, start: float = 0.0, end: float = math.inf) -> GroundMotion:
    """Samples from `start` to `end` [s], both included; an end behind the last sample keeps the rest.

    Raises
    ------
    SettingError
        The stretch holds fewer than two samples.
    """
    # A bound that is a multiple of the step but for rounding belongs to its sample.
    slack = 1e-6 * motion.dt
    first = max(0, math.ceil((start - slack) / motion.dt)) if start > 0.0 else 0
    last = motion.n_time - 1
    if end < motion.duration:
        last = math.floor((end + slack) / motion.dt)
    if not (last > first):
        raise SettingError(
            f"ground motion {motion.name}: from {start:g} to {end:g} s it has fewer than two samples; "
            f"it lasts {motion.duration:g} s"
        )
    if (first, last) == (0, motion.n_time - 1):
        return motion
    change = f"cut to {first * motion.dt:.6g} to {last * motion.dt:.6g} s"
    return changed(motion, motion.acceleration[first : last + 1].copy(), motion.dt, change)


# Steps whose ratio needs more than this are not met exactly by the band-limited rule.
_LARGEST_RATIO = 1000


def resampled(motion: GroundMotion, dt: float) -> GroundMotion:
    """Motion every `dt` [s], straight between its samples, as a simulation runs through them.

    A finer grid on which the old samples lie is the same motion. A coarser one lets what is faster than it can
    hold fold back into it: `resampled_band_limited` does not. What is left at the end, less than a step, is dropped.

    Raises
    ------
    SettingError
        The step is not positive, or longer than the motion.
    """
    n_time = _n_time(motion, dt)
    acceleration = np.interp(dt * np.arange(n_time), motion.time, motion.acceleration)
    return changed(
        motion, acceleration, dt, f"resampled from {motion.dt:.6g} to {dt:.6g} s, straight between"
    )


def resampled_band_limited(motion: GroundMotion, dt: float) -> GroundMotion:
    """Motion every `dt` [s] without what is faster than half its rate: for coarser grids.

    A symmetric low-pass filter, hence without delay (`scipy.signal.resample_poly`), takes out what the new grid cannot
    hold. Peaks between the samples of the old grid may come to stand out, others are cut.

    Raises
    ------
    SettingError
        The step is not positive, longer than the motion, or its ratio to the old one is no fraction of
        whole numbers up to 1000.
    """
    n_time = _n_time(motion, dt)
    ratio = Fraction(motion.dt / dt).limit_denominator(_LARGEST_RATIO)
    if ratio.numerator > _LARGEST_RATIO or abs(float(ratio) * dt / motion.dt - 1.0) > 1e-9:
        raise SettingError(
            f"ground motion {motion.name}: {motion.dt:g} s to {dt:g} s is no ratio of whole numbers up to "
            f"{_LARGEST_RATIO}; choose such a step, or `resampled`"
        )
    from scipy.signal import resample_poly  # slow to load, and rarely needed

    filtered = resample_poly(motion.acceleration, ratio.numerator, ratio.denominator)[:n_time]
    change = f"resampled from {motion.dt:.6g} to {dt:.6g} s, limited to {0.5 / max(dt, motion.dt):.4g} Hz"
    return changed(motion, np.ascontiguousarray(filtered, dtype=np.float64), dt, change)


def _n_time(motion: GroundMotion, dt: float) -> int:
    if not (math.isfinite(dt) and 0.0 < dt <= motion.duration * (1.0 + 1e-9)):
        raise SettingError(
            f"ground motion {motion.name}: resampled every {dt} s; give a positive step up to its {motion.duration:g} s"
        )
    return math.floor(motion.duration / dt * (1.0 + 1e-12) + 1e-9) + 1


_HIGHEST_ORDER = 10


def baseline_corrected(motion: GroundMotion, *, order: int) -> GroundMotion:
    """Motion less the polynomial of that order that fits its acceleration best.

    Parameters
    ----------
    order
        Order of the polynomial fitted to the acceleration by least squares: 0 takes out the mean, 1 a straight
        line. The drift of velocity is then of one order more.

    Raises
    ------
    SettingError
        The order is negative, above 10, or too high for so short a record.
    """
    highest = min(_HIGHEST_ORDER, motion.n_time - 2)
    if not 0 <= order <= highest:
        raise SettingError(f"ground motion {motion.name}: baseline of order {order}; give 0 to {highest}")
    # Legendre polynomials on [-1, 1] keep the fit well conditioned where powers of seconds do not.
    place = np.linspace(-1.0, 1.0, motion.n_time)
    drift = np.asarray(Legendre.fit(place, motion.acceleration, order)(place), dtype=np.float64)
    change = f"baseline of order {order} taken from the acceleration, up to {np.abs(drift).max():.3g} m/s2"
    return changed(motion, motion.acceleration - drift, motion.dt, change)
