"""Likeness of ground motions: whether one is a copy of another that was scaled, shifted, cut or stretched in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.motions.ground_motion import GroundMotion

Floats = NDArray[np.float64]

# Copies that were cut, corrected, resampled or scaled have 0.95 or more. Different motions have less: up to 0.45 among
# twenty measured records, up to 0.81 among synthetic ones of soft soil, which are nearly harmonic.
_COPY = 0.9
_STEP = 0.01
# Share of the energy of one motion, and of the other, that an overlap must hold.
_MOST, _LEAST = 0.5, 0.1


def likeness(one: GroundMotion, other: GroundMotion) -> float:
    """Largest correlation of two motions over all shifts in time: 1 for a copy, also one with another factor.

    The correlation is that of the accelerations where the two overlap, in absolute value, for shifts that leave half
    the energy of one motion and a tenth of that of the other in the overlap. Motions with different steps are also
    compared sample by sample, which finds a copy with another time axis.

    Parameters
    ----------
    one, other
        Ground motions of any step and length.

    Returns
    -------
    float
        Between 0 and 1; 0 if a motion is zero throughout.

    Examples
    --------
    >>> from mrwork.motions import scaled, suite, trimmed
    >>> first, second = suite("firm", 2, rng=0)
    >>> round(likeness(first, scaled(trimmed(first, start=1.0), -0.3)), 6)
    1.0
    >>> likeness(first, second) < 0.5
    True
    """
    found = _largest_correlation(_on_step(one), _on_step(other))
    if abs(one.dt - other.dt) > 1e-6 * one.dt:
        found = max(found, _largest_correlation(one.acceleration, other.acceleration))
    return found


@checked
def is_copy(one: GroundMotion, other: GroundMotion) -> bool:
    """Whether two motions are the same record up to its scale, a shift, cut ends, another step or time axis."""
    return likeness(one, other) > _COPY


def _on_step(motion: GroundMotion) -> Floats:
    """Accelerations every 10 ms: means of finer samples, straight lines between coarser ones."""
    time = np.arange(0.0, motion.duration, _STEP)
    if motion.dt >= 0.999 * _STEP:
        found = np.interp(time, motion.time, motion.acceleration)
    else:
        # The mean over a step is a difference of the velocity.
        edges = np.append(time, time[-1] + _STEP) - 0.5 * _STEP
        found = np.diff(np.interp(edges, motion.time, motion.velocity)) / _STEP
    return np.asarray(found, dtype=np.float64)


def _largest_correlation(one: Floats, other: Floats) -> float:
    # Samples of `one` from k on overlap those of `other` from the start, for shifts k from -(m - 1) to n - 1.
    n, m = one.size, other.size
    size = 1 << (n + m - 1).bit_length()
    spectrum = np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size))
    products = np.roll(np.fft.irfft(spectrum, size), m - 1)[: n + m - 1]
    shifts = np.arange(-(m - 1), n)
    first, last = np.maximum(shifts, 0), np.minimum(shifts + m, n)
    energy = [np.concatenate(([0.0], np.cumsum(each * each))) for each in (one, other)]
    within = [energy[0][last] - energy[0][first], energy[1][last - shifts] - energy[1][first - shifts]]
    if energy[0][-1] == 0.0 or energy[1][-1] == 0.0:
        return 0.0
    shares = np.stack([part / total[-1] for part, total in zip(within, energy, strict=True)])
    whole = (shares.max(axis=0) >= _MOST) & (shares.min(axis=0) >= _LEAST)
    if not whole.any():
        return 0.0
    correlations = np.abs(products[whole]) / np.sqrt(within[0][whole] * within[1][whole])
    return min(1.0, float(correlations.max()))
