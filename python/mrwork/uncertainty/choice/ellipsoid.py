"""The summit of a posterior near a fit, and the ellipsoid that the Fisher information draws about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.uncertainty.posterior.fisher import EVEN, fisher_information, residual_slope
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

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
    centre = target.position_of(theta)
    moving = _off_faces(target, centre)
    density = float(target(centre[None])[0])
    for _ in range(_MOST_STEPS):
        residual, slope = residual_slope(target, centre)
        free = moving[moving < len(slope)]
        slope = slope[free]
        weight = target.temper / float(np.mean(residual**2))
        information = weight * slope @ slope.T + EVEN * np.eye(len(slope))
        step = np.zeros(centre.size)
        step[free] = -np.linalg.solve(information, weight * slope @ residual)
        tried = _tried(target, centre + _LENGTHS[:, None] * step)
        found = target(tried)
        best = int(np.argmax(found))
        if not found[best] > density + _GAIN:
            break
        centre, density = tried[best], float(found[best])
    information = fisher_information(target, centre)[np.ix_(moving, moving)]
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Ellipsoid(centre=centre, moving=moving, covariance=covariance)


def _tried(target: Target, position: Array) -> Array:
    """Positions with the noise that their residuals tell, shape (n_tried, n_dim); those outside as they are."""
    result = position.copy()
    values, inside = target.space.values(position)
    for row in np.flatnonzero(inside):
        theta = np.asarray(values[row])[: target.space.n_params]
        own = target.position_of(theta)
        n_noise = len(target.noise.parameters)
        result[row, -n_noise:] = own[-n_noise:]
    return result


def _off_faces(target: Target, position: Array) -> NDArray[np.intp]:
    """Coordinates whose parameters lie off the faces of the box."""
    space = target.space
    unit = np.asarray(space.box.unit_from_theta(np.asarray(space.values(position)[0])))
    return np.flatnonzero((unit > _ON_FACE) & (unit < 1.0 - _ON_FACE))
