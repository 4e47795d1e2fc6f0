"""The limit of stiffness, above which a candidate is not simulated: steps along it, and points moved below it.

A hysteresis loop that wants to be sharper than the step of the tests resolves would otherwise stop a minimisation where
it meets that limit, far from the minimum of all its other parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.residual import ObservedTest

Array = NDArray[np.float64]

# Distance from the limit that a step along it keeps, in the logarithm of the stiffness: the limit is curved.
_MARGIN = 0.02
# Step in latent coordinates of the differences.
_SMALL = 1e-4
# Most tests whose limits a step may meet at once.
_MOST_MET = 8
# Most steps of a point to below the limit; points further above it, in the logarithm of the stiffness, stay.
_STEPS_BELOW = 10
_NOT_FAR_ABOVE = 0.7


def within_stiffness(
    tests: Sequence[ObservedTest],
    box: Box,
    latent: Array,
    step: Array,
    damped: Array,
    gradient: Array,
) -> Array:
    """Damped least-squares steps, those that end above the limit of stiffness replaced by the best ones below it.

    Parameters
    ----------
    latent
        Points, shape (n_rows, n_free).
    step
        Steps from them, shape (n_rows, n_dampings, n_free), that minimise the quadratic functions of `damped`, shape
        (n_rows, n_dampings, n_free, n_free), and `gradient`, shape (n_rows, n_free).
    """
    ends = np.asarray(box.theta_from_latent(latent[:, None] + step))
    stiffness = _log_stiffness(tests, ends.reshape(-1, ends.shape[-1])).reshape(*ends.shape[:2], -1)
    beyond = np.any(stiffness > 0.0, axis=2)
    if not beyond.any():
        return step
    step = step.copy()
    for row in np.flatnonzero(np.any(beyond, axis=1)):
        value, slope = _stiffness_and_slope(tests, box, latent[row])
        if not (np.isfinite(value).all() and np.isfinite(slope).all()):
            continue
        room = np.maximum(-_MARGIN - value, 0.0)
        for factor in np.flatnonzero(beyond[row]):
            step[row, factor] = _limited(damped[row, factor], gradient[row], slope, room)
    return step


def nearest_below_stiffness(tests: Sequence[ObservedTest], box: Box, theta: Array) -> Array:
    """Points, shape (n_points, n_params), those little above the limit of stiffness moved below it.

    A minimum on some tests, or on parts of them, may lie where others are not simulated. The move is the shortest in
    latent coordinates.
    """
    found = theta.copy()
    excess = _log_stiffness(tests, theta).max(axis=1)
    for row in np.flatnonzero((excess > 0.0) & (excess < _NOT_FAR_ABOVE)):
        latent = np.asarray(box.latent_from_theta(box.inside(theta[[row]])))[0]
        for _ in range(_STEPS_BELOW):
            value, slope = _stiffness_and_slope(tests, box, latent)
            if not (np.isfinite(value).all() and np.isfinite(slope).all()) or value.max() <= 0.0:
                break
            latent = latent + _limited(np.eye(latent.size), np.zeros(latent.size), slope, -_MARGIN - value)
        found[row] = np.asarray(box.theta_from_latent(latent[None]))[0]
    return found


def _stiffness_and_slope(tests: Sequence[ObservedTest], box: Box, latent: Array) -> tuple[Array, Array]:
    """Logarithm of the stiffness at a point, shape (n_tests,), and its derivative, shape (n_tests, n_free)."""
    nearby = np.concatenate([latent[None], latent + _SMALL * np.eye(latent.size)])
    value, *moved = _log_stiffness(tests, np.asarray(box.theta_from_latent(nearby)))
    return value, (np.array(moved) - value).T / _SMALL


def _log_stiffness(tests: Sequence[ObservedTest], theta: Array) -> Array:
    """Logarithm of the stiffness as a share of the limit, shape (n_batch, n_tests); infinite where it has none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = np.log(np.stack([each.stiffness_share(theta) for each in tests], axis=1))
    return np.where(np.isnan(stiffness), np.inf, stiffness)


def _limited(matrix: Array, gradient: Array, slope: Array, room: Array) -> Array:
    """Minimum of gradient @ s + s @ matrix @ s / 2 with slope @ s <= room, shape (n_free,), by an active set."""
    free = -np.linalg.solve(matrix, gradient)
    towards = np.linalg.solve(matrix, slope.T)
    met: list[int] = []
    step = free
    for _ in range(2 * _MOST_MET):
        excess = slope @ step - room
        excess[met] = -np.inf
        worst = int(np.argmax(excess))
        if excess[worst] <= 1e-9 or len(met) == _MOST_MET:
            break
        met.append(worst)
        while True:
            force = np.linalg.lstsq(slope[met] @ towards[:, met], slope[met] @ free - room[met], rcond=1e-10)[
                0
            ]
            if (force >= 0.0).all():
                break
            met.pop(int(np.argmin(force)))
        step = free - towards[:, met] @ force
    return np.asarray(step)
