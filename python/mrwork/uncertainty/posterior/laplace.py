"""Normal approximation of a posterior about a fit: Fisher information, mode, starting walkers."""

from __future__ import annotations

import numpy as np

from mrwork.base.values import Floats
from mrwork.errors import SettingError
from mrwork.identification.covariance import Slopes
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.objective import Objective
from mrwork.uncertainty.posterior.target import Target

# Finite-difference step in a noise coordinate, as a share of the distance to the nearer bound.
_NOISE_STEP = 1e-3
# Information of the uniform density on [0, 1]; it bounds the variance of coordinates that the data do not determine.
_UNIFORM = 12.0
# Starting walkers outside the support of the posterior are redrawn, each time nearer to the start by this factor.
_MOST_REDRAWS = 60
_NEARER = 0.8
# Largest number of iterations to the mode.
_MOST_TO_MODE = 20


def fisher_information(target: Target, position: Floats) -> Floats:
    """Fisher information of the tempered likelihood and of a uniform prior, shape (n_dim, n_dim)."""
    space, objective = target.space, target.objective
    values = np.asarray(space.values(position)[0])
    theta = np.ascontiguousarray(values[: space.n_params])
    normal = Slopes.at(objective, target.form, theta).normal()
    # An objective gives every test its share, a likelihood every sample the same.
    samples_per_share = _n_samples(objective) / objective.shares
    matrix = np.tensordot(samples_per_share, normal.matrix[0], 1)
    squared = float(samples_per_share @ normal.squared[0])
    slope = space.slope(values)
    n_dim, n_free = space.n_dim, len(slope)
    information = _UNIFORM * np.eye(n_dim)
    precision = target.temper / max(squared / objective.n_time, 1e-24)
    information[:n_free, :n_free] += precision * slope.T @ matrix @ slope
    for index in range(n_free, n_dim):
        information[index, index] += _noise_curvature(target, position, index)
    return information


def _n_samples(objective: Objective) -> Floats:
    return np.array([test.measured.size for test in objective.compared], dtype=np.float64)


def _noise_curvature(target: Target, position: Floats, index: int) -> float:
    step = _NOISE_STEP * min(position[index], 1.0 - position[index])
    offsets = np.zeros((3, position.size))
    offsets[:, index] = [-step, 0.0, step]
    before, here, after = target.temper * target.log_likelihood(target.space.values(position + offsets)[0])
    curvature = float((2.0 * here - before - after) / step**2)
    return max(curvature, 0.0) if np.isfinite(curvature) else 0.0


def first_walkers(target: Target, start: Floats, n_walkers: int, rng: np.random.Generator) -> Floats:
    """Starting positions about `start`, (n_params,), shape (n_walkers, n_dim), all of positive density.

    Normal with the inverse of the tempered Fisher information as covariance, reflected at the faces of the box.
    """
    space = target.space
    origin = target.position_of(target.form.box.inside(start))
    root = np.linalg.cholesky(np.linalg.inv(fisher_information(target, origin)))
    walkers = np.tile(origin, (n_walkers, 1))
    waiting = np.arange(n_walkers)
    scale = 1.0
    for _ in range(_MOST_REDRAWS):
        steps = scale * rng.standard_normal((waiting.size, space.n_dim)) @ root.T
        walkers[waiting] = space.reflect(origin + steps)
        waiting = waiting[~np.isfinite(target(walkers[waiting]))]
        if waiting.size == 0:
            return walkers
        scale *= _NEARER
    raise SettingError(
        f"{waiting.size} of {n_walkers} walkers found no place near the start that prior and simulation allow; "
        "give priors that allow for the fit, or another fit"
    )


def mode_near(target: Target, theta: Floats) -> Floats:
    """Mode of the likelihood near a fit, both (n_params,), or the fit itself where its posterior density is larger.

    It is not the fit, because a test's share of a likelihood is that of its samples.
    """
    objective, box = target.objective, target.form.box
    n_samples = _n_samples(objective)
    minima = find_minima(
        objective, box, theta[None], max_iterations=_MOST_TO_MODE, shares=n_samples[None] / n_samples.sum()
    )
    both = np.stack([theta, minima.theta[0]])
    densities = target(np.array([target.position_of(point) for point in both]))
    return np.asarray(both[int(np.argmax(densities))])
