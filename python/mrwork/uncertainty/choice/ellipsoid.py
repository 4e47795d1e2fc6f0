"""The summit of a posterior near a fit, and the ellipsoid that the Fisher information draws about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

# Information that an even spread over the unit interval is worth; it bounds what the data do not see.
_EVEN = 12.0
# Residuals are differenced over steps that change them by this share of their size, found from the longest step down:
# some coordinates are known to 1e-11 and some not at all, and where a model jumps, too short a step meets one jump.
_SHARE = 0.01
_LONGEST = 1e-4
_PASSES = 4
# A coordinate nearer to a face of the box than this lies on it, and counts as known there.
_ON_FACE = 1e-4
# Gauss-Newton: at most so many steps, each tried in these lengths, until the log density gains no more than this.
_MOST_STEPS = 20
_LENGTHS = np.array([1.0, 0.5, 0.2, 0.05, 0.01])
_GAIN = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipsoid:
    """Centre (n_dim,) in a target's space, and covariance (n_moving, n_moving) of the coordinates that move."""

    centre: Array
    moving: NDArray[np.intp]
    covariance: Array


def fisher_ellipsoid(target: Target, theta: Array) -> Ellipsoid:
    """Climb from a fit, shape (n_params,), to the summit of the density, and look at its curvature there.

    A fit weighs tests alike, a likelihood by their samples, so the two differ. Parameters on a bound are held there.
    """
    centre = _with_noise(target, theta)
    moving = _off_faces(target, centre)
    density = float(target(centre[None])[0])
    for _ in range(_MOST_STEPS):
        slope, residual = _slope(target, centre, moving)
        weight = target.temper / float(np.mean(residual**2))
        information = weight * slope @ slope.T + _EVEN * np.eye(len(slope))
        step = np.zeros(centre.size)
        step[moving[: len(slope)]] = -np.linalg.solve(information, weight * slope @ residual)
        tried = _tried(target, centre + _LENGTHS[:, None] * step)
        found = target(tried)
        best = int(np.argmax(found))
        if not found[best] > density + _GAIN:
            break
        centre, density = tried[best], float(found[best])
    covariance = np.asarray(np.linalg.inv(_information(target, centre, moving)), dtype=np.float64)
    return Ellipsoid(centre=centre, moving=moving, covariance=covariance)


def _with_noise(target: Target, theta: Array) -> Array:
    """The position of a set of parameters, with the noise that their residuals tell, of all tests in a row."""
    space = target.space
    residuals, forces, _ = zip(*target.residuals(theta[None]), strict=True)
    row, force = np.concatenate(residuals, axis=1)[0], np.concatenate(forces, axis=1)[0]
    values = np.concatenate([theta, target.noise.estimate(row, force)])
    return np.asarray(space.position(space.box.inside(values)))


def _tried(target: Target, position: Array) -> Array:
    """Positions with the noise that their residuals tell, shape (n_tried, n_dim); those outside as they are."""
    result = position.copy()
    values, inside = target.space.values(position)
    for row in np.flatnonzero(inside):
        theta = np.asarray(values[row])[: target.space.n_params]
        own = _with_noise(target, theta)
        n_noise = len(target.noise.parameters)
        result[row, -n_noise:] = own[-n_noise:]
    return result


def _off_faces(target: Target, position: Array) -> NDArray[np.intp]:
    """Coordinates whose parameters lie off the faces of the box."""
    space = target.space
    unit = np.asarray(space.box.unit_from_theta(np.asarray(space.values(position)[0])))
    return np.flatnonzero((unit > _ON_FACE) & (unit < 1.0 - _ON_FACE))


def _information(target: Target, centre: Array, moving: NDArray[np.intp]) -> Array:
    """Fisher information of the tempered likelihood and of an even spread, shape (n_moving, n_moving)."""
    slope, residual = _slope(target, centre, moving)
    n_free = len(slope)
    information = _EVEN * np.eye(moving.size)
    information[:n_free, :n_free] += target.temper / float(np.mean(residual**2)) * slope @ slope.T
    for row in range(n_free, moving.size):
        information[row, row] += _noise_curvature(target, centre, int(moving[row]))
    return information


def _slope(target: Target, centre: Array, moving: NDArray[np.intp]) -> tuple[Array, Array]:
    """Derivative of all residuals with respect to the parameters' coordinates, (n_free, n_residuals), and residuals."""
    parameters = moving[moving < target.space.n_dim - len(target.noise.parameters)]
    residual = _residuals(target, centre[None])[0]
    step = np.full(parameters.size, _LONGEST)
    for _ in range(_PASSES):
        offsets = np.zeros((parameters.size, centre.size))
        offsets[np.arange(parameters.size), parameters] = step
        ahead, behind = np.split(_residuals(target, np.concatenate([centre + offsets, centre - offsets])), 2)
        slope = (ahead - behind) / (2.0 * step[:, None])
        felt = np.maximum(np.linalg.norm(slope, axis=1), 1e-300)
        step = np.minimum(_SHARE * float(np.linalg.norm(residual)) / felt, _LONGEST)
    return np.asarray(slope), residual


def _noise_curvature(target: Target, centre: Array, index: int) -> float:
    """Negative second derivative of the tempered log-likelihood with respect to a coordinate of the noise."""
    step = 1e-3 * min(centre[index], 1.0 - centre[index])
    offsets = np.zeros((3, centre.size))
    offsets[:, index] = [-step, 0.0, step]
    before, here, after = target.temper * target.log_likelihood(target.space.values(centre + offsets)[0])
    curvature = float((2.0 * here - before - after) / step**2)
    return max(curvature, 0.0) if np.isfinite(curvature) else 0.0


def _residuals(target: Target, position: Array) -> Array:
    """Residuals of all tests in a row, shape (n_batch, n_residuals), in deviations."""
    theta = np.ascontiguousarray(np.asarray(target.space.values(position)[0])[:, : target.space.n_params])
    return np.concatenate([residual for residual, _, _ in target.residuals(theta)], axis=1)
