"""What the data tell about a position: exact derivatives of the residuals, and the Fisher information."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.linearisation import linearised
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

# Step in a coordinate of the noise, as a share of the way to the nearer bound.
_NOISE_STEP = 1e-3
# Information that an even spread over the unit interval is worth; it bounds what the data do not see.
EVEN = 12.0


def residual_slope(target: Target, position: Array) -> tuple[Array, Array]:
    """Residuals of all tests in a row, in deviations, (n_residuals,), and their slope, (n_free, n_residuals).

    The slope is with respect to the coordinates of the free parameters, at a position inside, shape (n_dim,).
    """
    space, objective = target.space, target.objective
    values = np.asarray(space.values(position)[0])
    theta = np.ascontiguousarray(values[: space.n_params])
    residuals, slopes = linearised(objective.plain, theta[None], target.form.box.free)
    # The objective weighs tests alike, a likelihood by their samples.
    n_tests = len(objective.tests)
    own = np.concatenate(
        [
            np.full(each.measured.size, 1.0 / (each.weight(n_tests) * deviation))
            for each, deviation in zip(objective.compared, target.deviations, strict=True)
        ]
    )
    return residuals[0] * own, np.asarray(space.slope(values).T @ (slopes[0] * own))


def fisher_information(target: Target, position: Array) -> Array:
    """Fisher information of the tempered likelihood and of an even spread, shape (n_dim, n_dim)."""
    residual, slope = residual_slope(target, position)
    n_dim, n_free = target.space.n_dim, len(slope)
    information = EVEN * np.eye(n_dim)
    weight = target.temper / max(float(np.mean(residual**2)), 1e-24)
    information[:n_free, :n_free] += weight * slope @ slope.T
    for index in range(n_free, n_dim):
        information[index, index] += _noise_curvature(target, position, index)
    return information


def _noise_curvature(target: Target, position: Array, index: int) -> float:
    """Negative second derivative of the tempered log-likelihood with respect to a coordinate of the noise."""
    step = _NOISE_STEP * min(position[index], 1.0 - position[index])
    offsets = np.zeros((3, position.size))
    offsets[:, index] = [-step, 0.0, step]
    before, here, after = target.temper * target.log_likelihood(target.space.values(position + offsets)[0])
    curvature = float((2.0 * here - before - after) / step**2)
    return max(curvature, 0.0) if np.isfinite(curvature) else 0.0
