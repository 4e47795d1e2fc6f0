"""Where the cycles of a motion lie, and where it turns."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

# A crossing counts only after the stroke has been this share of its spread on the other side,
# so that noise around the middle of the stroke does not make cycles of its own.
_DEAD_BAND: Final = 0.5
# Turns less far apart than this share of the peak-to-peak stroke are wiggles.
_LEAST_STROKE: Final = 0.5


def upward_crossings(displacement: NDArray[np.float64]) -> NDArray[np.intp]:
    """Samples at which the stroke passes its mean upwards, shape (n_crossings,)."""
    centred = displacement - np.mean(displacement)
    side = np.where(np.abs(centred) < _DEAD_BAND * np.std(centred), 0.0, np.sign(centred))
    decided = np.flatnonzero(side)
    turns = decided[1:][(side[decided[:-1]] < 0) & (side[decided[1:]] > 0)]
    upward = np.flatnonzero((centred[:-1] < 0) & (centred[1:] >= 0)) + 1
    if turns.size == 0 or upward.size == 0:
        return np.empty(0, dtype=np.intp)
    nearest = np.searchsorted(upward, turns, side="right") - 1
    return upward[nearest[nearest >= 0]]


def whole_cycles(displacement: NDArray[np.float64]) -> tuple[slice, ...]:
    """Samples of each cycle, from one upward crossing to the next."""
    crossings = upward_crossings(displacement)
    return tuple(slice(int(first), int(last)) for first, last in pairwise(crossings))


def turning_points(
    displacement: NDArray[np.float64], velocity: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turns between two strokes of at least half the peak-to-peak each.

    Parameters
    ----------
    displacement, velocity
        Without noise, shape (n_time,) [m, m/s].

    Returns
    -------
    place, direction
        Shape (n_turns,): where the velocity vanishes, in samples and fractions of them, and the sign of the
        velocity before.
    """
    before = np.flatnonzero((velocity[:-1] != 0.0) & (velocity[:-1] * velocity[1:] <= 0.0))
    place = before + velocity[before] / (velocity[before] - velocity[before + 1])
    stroke = np.diff(np.interp(place, np.arange(displacement.size), displacement))
    wide = np.abs(stroke) > _LEAST_STROKE * np.ptp(displacement)
    chosen = np.flatnonzero(wide[:-1] & wide[1:]) + 1
    return place[chosen], np.sign(velocity[before[chosen]])
