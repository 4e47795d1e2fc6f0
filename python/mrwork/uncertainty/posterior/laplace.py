"""Normal approximation of a posterior about a fit: Fisher information, starting walkers, importance-weighted draws.

Weighted draws cost far less than a chain, and their weights show how well the approximation matches the posterior.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.identification.objective import linearise_residuals
from mrwork.uncertainty.posterior.target import Target

# Finite-difference step in a noise coordinate, as a share of the distance to the nearer bound.
_NOISE_STEP = 1e-3
# Information of the uniform density on [0, 1]; it bounds the variance of coordinates that the data do not determine.
_UNIFORM = 12.0
# Starting walkers outside the support of the posterior are redrawn, each time nearer to the start by this factor.
_MOST_REDRAWS = 60
_NEARER = 0.8
# A coordinate nearer to a face of the box than this lies on it, and is held there.
_ON_FACE = 1e-4
# Gauss-Newton: largest number of steps, step lengths that are tried, and the smallest gain in log density.
_MOST_STEPS = 20
_LENGTHS = np.array([1.0, 0.5, 0.2, 0.05, 0.01])
_GAIN = 1e-3
# Degrees of freedom of the t distribution for the draws: its tails are heavier than those of a posterior.
_TAILS = 5.0
# Rounds of adaptation of the ellipsoid to the weighted draws, and draws in each.
_ROUNDS = 3
_FEWEST, _PER_DIMENSION = 500, 100


def residual_slope(target: Target, position: Floats) -> tuple[Floats, Floats]:
    """Residuals of all tests in deviations, (n_residuals,), and derivative by coordinate, (n_free, n_residuals)."""
    space, objective = target.space, target.objective
    values = np.asarray(space.values(position)[0])
    theta = np.ascontiguousarray(values[: space.n_params])
    residuals, slopes = linearise_residuals(objective.plain, theta[None], target.form.box.free)
    # The objective weights tests equally, a likelihood by their samples.
    n_tests = len(objective.tests)
    own = np.concatenate(
        [
            np.full(each.measured.size, 1.0 / (each.weight(n_tests) * deviation))
            for each, deviation in zip(objective.compared, target.deviations, strict=True)
        ]
    )
    return residuals[0] * own, np.asarray(space.slope(values).T @ (slopes[0] * own))


def fisher_information(target: Target, position: Floats) -> Floats:
    """Fisher information of the tempered likelihood and of a uniform prior, shape (n_dim, n_dim)."""
    residual, slope = residual_slope(target, position)
    n_dim, n_free = target.space.n_dim, len(slope)
    information = _UNIFORM * np.eye(n_dim)
    weight = target.temper / max(float(np.mean(residual**2)), 1e-24)
    information[:n_free, :n_free] += weight * slope @ slope.T
    for index in range(n_free, n_dim):
        information[index, index] += _noise_curvature(target, position, index)
    return information


def _noise_curvature(target: Target, position: Floats, index: int) -> float:
    """Negative second derivative of the tempered log-likelihood with respect to a coordinate of the noise."""
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
    origin, root = centre_and_root(target, start)
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


def centre_and_root(target: Target, start: Floats) -> tuple[Floats, Floats]:
    """Position of `start` with its noise, (n_dim,), and a Cholesky factor of the covariance, (n_dim, n_dim)."""
    origin = target.position_of(target.form.box.inside(start))
    return origin, np.linalg.cholesky(np.linalg.inv(fisher_information(target, origin)))


@array_dataclass()
class Ellipsoid:
    """Centre (n_dim,) in a target's space, and covariance (n_moving, n_moving) of the coordinates that move."""

    centre: Floats
    moving: NDArray[np.intp]
    covariance: Floats


def fisher_ellipsoid(target: Target, theta: Floats) -> Ellipsoid:
    """Mode of the posterior near a fit, shape (n_params,), and the covariance there."""
    centre, moving = _mode_near(target, theta)
    information = fisher_information(target, centre)[np.ix_(moving, moving)]
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Ellipsoid(centre=centre, moving=moving, covariance=covariance)


def mode_near(target: Target, theta: Floats) -> Floats:
    """Mode of the posterior near a fit, both (n_params,); a likelihood weights tests by their samples."""
    centre, _ = _mode_near(target, theta)
    return np.asarray(target.space.values(centre)[0])[: target.space.n_params]


def _mode_near(target: Target, theta: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Position of the mode near a fit, by Gauss-Newton, and the coordinates that move: no parameter on a bound does."""
    centre = target.position_of(theta)
    unit = np.asarray(target.space.box.unit_from_theta(np.asarray(target.space.values(centre)[0])))
    moving = np.flatnonzero((unit > _ON_FACE) & (unit < 1.0 - _ON_FACE))
    density = float(target(centre[None])[0])
    for _ in range(_MOST_STEPS):
        residual, slope = residual_slope(target, centre)
        free = moving[moving < len(slope)]
        slope = slope[free]
        weight = target.temper / float(np.mean(residual**2))
        information = weight * slope @ slope.T + _UNIFORM * np.eye(len(slope))
        step = np.zeros(centre.size)
        step[free] = -np.linalg.solve(information, weight * slope @ residual)
        tried = _with_estimated_noise(target, centre + _LENGTHS[:, None] * step)
        densities = target(tried)
        best = int(np.argmax(densities))
        if not densities[best] > density + _GAIN:
            break
        centre, density = tried[best], float(densities[best])
    return centre, moving


def _with_estimated_noise(target: Target, position: Floats) -> Floats:
    """Positions with noise estimated from their residuals, (n_tried, n_dim); those outside the box are unchanged."""
    result, n_noise = position.copy(), len(target.noise.parameters)
    values, inside = target.space.values(position)
    for row in np.flatnonzero(inside):
        own = target.position_of(np.asarray(values[row])[: target.space.n_params])
        result[row, -n_noise:] = own[-n_noise:]
    return result


@array_dataclass()
class WeightedDraws:
    """Positions of a target's space, (n_draws, n_dim), and log of target over proposal density, (n_draws,)."""

    position: Floats
    log_ratio: Floats

    @property
    def weights(self) -> Floats:
        """Pareto-smoothed importance weights, shape (n_draws,), of sum 1."""
        # ArviZ takes seconds to load, and has no type annotations.
        statistics: Any = import_module("arviz_stats.base").array_stats
        weights = np.exp(statistics.psislw(-self.log_ratio)[0])
        return np.asarray(weights / weights.sum())

    @property
    def effective(self) -> float:
        """Effective number of independent draws from the target."""
        return float(1.0 / np.sum(self.weights**2))


def draw_about(target: Target, theta: Floats, n_draws: int, rng: np.random.Generator) -> WeightedDraws:
    """Importance-weighted draws from a multivariate t distribution about a fit, by population Monte Carlo.

    In a few rounds, centre and covariance become those of the weighted draws (Cappe et al., J. Comput. Graph. Stat. 13,
    2004, 907-929). Draws outside the box or that cannot be simulated are left out.
    """
    ellipsoid = fisher_ellipsoid(target, theta)
    n_moving = ellipsoid.moving.size
    for _ in range(_ROUNDS):
        draws = _draw_from(target, ellipsoid, max(_FEWEST, _PER_DIMENSION * n_moving), rng)
        # With too few effective draws the ellipsoid would collapse.
        if len(draws.position) > 5 * n_moving and draws.effective > 2 * n_moving:
            weights = draws.weights
            centre = weights @ draws.position
            offsets = (draws.position - centre)[:, ellipsoid.moving]
            ellipsoid = replace(ellipsoid, centre=centre, covariance=offsets.T @ (weights[:, None] * offsets))
    return _draw_from(target, ellipsoid, n_draws, rng)


def _draw_from(target: Target, ellipsoid: Ellipsoid, n_draws: int, rng: np.random.Generator) -> WeightedDraws:
    covariance, n_dim = ellipsoid.covariance, ellipsoid.moving.size
    # Scaled to unit diagonal, because variances differ by many orders of magnitude.
    scale = np.sqrt(np.diag(covariance))
    root = scale[:, None] * np.linalg.cholesky(covariance / np.outer(scale, scale) + 1e-12 * np.eye(n_dim))
    normal = rng.standard_normal((n_draws, n_dim))
    spread = np.sqrt(rng.chisquare(_TAILS, n_draws) / _TAILS)
    position = np.tile(ellipsoid.centre, (n_draws, 1))
    position[:, ellipsoid.moving] += (normal / spread[:, None]) @ root.T
    distance = np.sum(normal**2, axis=1) / spread**2
    drawn = -0.5 * (_TAILS + n_dim) * np.log1p(distance / _TAILS)
    log_ratio = target(position) - drawn
    possible = np.isfinite(log_ratio)
    return WeightedDraws(position=position[possible], log_ratio=log_ratio[possible])
