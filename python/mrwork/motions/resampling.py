"""Another sample step for a ground motion."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion, changed

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
