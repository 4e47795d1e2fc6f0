"""What is done to a ground motion before it shakes a building: scaled in height and in time, and cut.

Every function gives a new motion whose `changes` say what was done.
"""

from __future__ import annotations

import math

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
