"""The limit of stiffness, above which a candidate is not simulated: steps that keep below it, points moved there.

A hysteresis loop that wants to be sharper than the step of the tests resolves would otherwise stop a minimisation where
it meets the limit, far from the minimum of all its other parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.identification.minimise.straight import Straight
from mrwork.identification.residual import ObservedTest

# Distance from the limit that a step along it keeps, in the logarithm of the stiffness: the limit is curved.
_MARGIN = 0.02
# Distance within which a minimum is at the limit.
_AT_LIMIT = 0.1
# Relative step of the differences.
_SMALL = 1e-4
# Most tests whose limits a step may meet at once.
_MOST_MET = 8
# Most steps of a point to below the limit; points further above it, in the logarithm of the stiffness, stay.
_STEPS_BELOW = 10
_NOT_FAR_ABOVE = 0.7


def within_stiffness(
    tests: Sequence[ObservedTest],
    coordinates: Straight,
    theta: Floats,
    step: Floats,
    damped: Floats,
    still: NDArray[np.bool_],
) -> tuple[Floats, NDArray[np.bool_]]:
    """Where damped least-squares steps end, those above the limit of stiffness replaced by the best ones below it.

    The limit is curved: where a step along it is above it, too, one of forces alone remains, on which it does not
    depend, and is marked, shape (n_rows, n_dampings); a shorter step may go along the limit.

    `step`, shape (n_rows, n_dampings, n_free), from `theta`, (n_rows, n_params), minimises quadratic functions with the
    matrices `damped`, (n_rows, n_dampings, n_free, n_free); what is `still` has no step. The ends have the shape
    (n_rows, n_dampings, n_params).
    """
    ends = coordinates.after(theta, still, step)
    stiffness = log_stiffness(tests, ends.reshape(-1, ends.shape[-1])).reshape(*ends.shape[:2], -1)
    beyond = np.any(stiffness > 0.0, axis=2)
    of_forces = np.zeros_like(beyond)
    if not beyond.any():
        return ends, of_forces
    step = step.copy()
    rows = np.flatnonzero(beyond.any(axis=1))
    values, slopes = stiffness_and_slope(tests, coordinates.box, theta[rows])
    slopes = np.where(still[rows, None], 0.0, slopes @ coordinates.slope(theta[rows], still[rows]))
    fine = np.isfinite(values).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2))
    rows, slopes, room = rows[fine], slopes[fine], np.maximum(-_MARGIN - values[fine], 0.0)
    towards = np.linalg.solve(damped[rows], slopes[:, None].swapaxes(2, 3))
    for index, row in enumerate(rows):
        for factor in np.flatnonzero(beyond[row]):
            step[row, factor] = _within(step[row, factor], towards[index, factor], slopes[index], room[index])
    ends = coordinates.after(theta, still, step)
    left = log_stiffness(tests, ends.reshape(-1, ends.shape[-1])).reshape(*ends.shape[:2], -1)
    of_forces[rows] = np.any(left[rows] > 0.0, axis=2)
    for index, row in enumerate(rows):
        stays = still[row] | ~coordinates.of_force | np.any(slopes[index] != 0.0, axis=0)
        for factor in np.flatnonzero(of_forces[row]):
            step[row, factor] = _without(step[row, factor], damped[row, factor], stays)
    return coordinates.after(theta, still, step), of_forces


def nearest_below_stiffness(tests: Sequence[ObservedTest], box: Box, theta: Floats) -> Floats:
    """Points, shape (n_points, n_params), those little above the limit of stiffness moved below it by the shortest way.

    A minimum on some tests, or on parts of them, may lie where others are not simulated.
    """
    nearest = theta.copy()
    excess = log_stiffness(tests, theta).max(axis=1)
    most = _NOT_FAR_ABOVE if np.isinf(tests[0].stiffest) else np.inf
    for row in np.flatnonzero((excess > 0.0) & (excess < most)):
        latent = np.asarray(box.latent_from_theta(box.inside(theta[[row]])))[0]
        for _ in range(_STEPS_BELOW):
            (value,), (slope,) = stiffness_and_slope(
                tests, box, np.asarray(box.theta_from_latent(latent[None]))
            )
            slope = slope * np.exp(box.log_slope(latent))
            if not (np.isfinite(value).all() and np.isfinite(slope).all()) or value.max() <= 0.0:
                break
            latent = latent + _within(np.zeros(latent.size), slope.T, slope, -_MARGIN - value)
        nearest[row] = np.asarray(box.theta_from_latent(latent[None]))[0]
    return nearest


def is_at_stiffness_limit(tests: Sequence[ObservedTest], theta: Floats) -> NDArray[np.bool_]:
    """Whether minimisations that end at `theta`, shape (n_points, n_params), have slid along the limit of stiffness.

    The steps of the tests are no such limit.
    """
    limited = [test for test in tests if test.stiffest * test.test.dt < MOST_SUBSTEPS]
    if not limited:
        return np.zeros(len(theta), dtype=np.bool_)
    return np.asarray(log_stiffness(limited, theta).max(axis=1) > -_AT_LIMIT)


def stiffness_and_slope(tests: Sequence[ObservedTest], box: Box, theta: Floats) -> tuple[Floats, Floats]:
    """Logarithm of the stiffness, (n_rows, n_tests), and its derivative by the free parameters, (..., n_free)."""
    free = list(box.free)
    sizes = _SMALL * np.where(theta[:, free] == 0.0, 1.0, theta[:, free])
    nearby = np.repeat(theta[:, None], len(free) + 1, axis=1)
    nearby[:, np.arange(1, len(free) + 1), free] += sizes
    stiffness = log_stiffness(tests, nearby.reshape(-1, theta.shape[1])).reshape(*nearby.shape[:2], -1)
    with np.errstate(invalid="ignore"):
        slopes = (stiffness[:, 1:] - stiffness[:, :1]) / sizes[:, :, None]
    return stiffness[:, 0], slopes.transpose(0, 2, 1)


def log_stiffness(tests: Sequence[ObservedTest], theta: Floats) -> Floats:
    """Logarithm of the stiffness as a share of the limit, shape (n_batch, n_tests); infinite where it has none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = np.log(np.stack([test.stiffness(theta) for test in tests], axis=1))
    return np.where(np.isnan(stiffness), np.inf, stiffness)


def _without(step: Floats, damped: Floats, stays: NDArray[np.bool_]) -> Floats:
    """The best step that leaves what `stays`, (n_free,), where `step` is the best one with limits on that alone."""
    moves, best = np.flatnonzero(~stays), np.zeros_like(step)
    best[moves] = np.linalg.solve(damped[np.ix_(moves, moves)], (damped @ step)[moves])
    return best


def _within(free: Floats, towards: Floats, slope: Floats, room: Floats) -> Floats:
    """The step nearest to a `free` one, (n_free,), with slope @ s <= room, by an active set.

    Distance is that of the quadratic function which the free step minimises: `towards`, (n_free, n_tests), is its
    matrix's inverse times the transposed `slope`.
    """
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
            matrix, excess = slope[met] @ towards[:, met], slope[met] @ free - room[met]
            if len(met) == 1:
                force = np.divide(excess, matrix[0], out=np.zeros(1), where=matrix[0] != 0.0)
            else:
                force = np.linalg.lstsq(matrix, excess, rcond=1e-10)[0]
            if (force >= 0.0).all():
                break
            met.pop(int(np.argmin(force)))
        step = free - towards[:, met] @ force
    return np.asarray(step)
