"""Where walkers start: in the ellipsoid that the Fisher information draws about a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.coordinates import Box
from mrwork.errors import SettingError
from mrwork.identification.explore import search_box
from mrwork.uncertainty.posterior.space import Space
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

# Steps of difference quotients: of parameters as in `descent`, of noise as a share of the way to the nearer bound.
_STEP = 1e-6
_NOISE_STEP = 1e-3
# Information that an even spread over the unit interval is worth; it bounds what the data do not see.
_EVEN = 12.0
# A walker that falls where nothing is possible is drawn again, nearer each time.
_ROUNDS = 60
_NEARER = 0.8


def first_walkers(target: Target, start: Array, n_walkers: int, rng: np.random.Generator) -> Array:
    """Positions about `start`, (n_params,), shape (n_walkers, n_dim), all with a density above zero.

    Normal with the inverse of the (tempered) Fisher information, folded back into the box at its faces.

    Raises
    ------
    SettingError
        Where no candidate about the start is possible at all.
    """
    space = target.space
    origin, root = ellipsoid(target, start)
    walkers = np.tile(origin, (n_walkers, 1))
    waiting = np.arange(n_walkers)
    scale = 1.0
    for _ in range(_ROUNDS):
        steps = scale * rng.standard_normal((waiting.size, space.n_dim)) @ root.T
        walkers[waiting] = _folded(space, origin + steps)
        waiting = waiting[~np.isfinite(target(walkers[waiting]))]
        if waiting.size == 0:
            return walkers
        scale *= _NEARER
    raise SettingError(
        f"{waiting.size} of {n_walkers} walkers found no place near the start that prior and simulation allow; "
        "give priors that allow for the fit, or another fit"
    )


def ellipsoid(target: Target, start: Array) -> tuple[Array, Array]:
    """Position of `start` and the noise there, (n_dim,), and a root of the covariance about it, (n_dim, n_dim)."""
    space = target.space
    theta = target.form.box.inside(start)
    origin = np.asarray(space.position(space.box.inside(np.concatenate([theta, target.noise_at(theta)]))))
    return origin, np.linalg.cholesky(np.linalg.inv(_information(target, theta, origin)))


def _information(target: Target, theta: Array, origin: Array) -> Array:
    """Fisher information of the tempered likelihood, and a little more, shape (n_dim, n_dim)."""
    form, objective, space = target.form, target.objective, target.space
    searched = search_box(form.spec, form.box, objective.tests)
    misfit = float(objective.plain(theta[None])[0])
    # Residuals of the objective have the squared misfit for their sum of squares, whatever the samples.
    jacobian = objective.plain.linearised(theta[None], form.box.free)[1][0].T
    n_free = jacobian.shape[1]
    slope = _position_slope(target, theta, origin, searched)
    by_position = np.linalg.solve(slope.T, jacobian.T).T
    information = _EVEN * np.eye(space.n_dim)
    weight = target.temper * objective.n_time / max(misfit, 1e-12) ** 2
    information[:n_free, :n_free] += weight * by_position.T @ by_position
    for index in range(n_free, space.n_dim):
        step = _NOISE_STEP * min(origin[index], 1.0 - origin[index])
        offsets = np.zeros((3, space.n_dim))
        offsets[:, index] = [-step, 0.0, step]
        before, here, after = target.temper * target.log_likelihood(space.values(origin + offsets)[0])
        information[index, index] += max(float(2.0 * here - before - after) / step**2, 0.0)
    return information


def _position_slope(target: Target, theta: Array, origin: Array, searched: Box) -> Array:
    """Derivative of the free parameters' coordinates with respect to these parameters, (n_free, n_free)."""
    box, space = target.form.box, target.space
    values = np.concatenate([theta, np.asarray(space.values(origin)[0])[space.n_params :]])
    width = np.array(searched.upper) - np.array(searched.lower)
    columns = []
    for index in box.free:
        step = _STEP * (theta[index] if box.log[index] else max(abs(theta[index]), width[index]))
        offset = np.zeros(values.size)
        offset[index] = step
        difference = space.position(values + offset) - space.position(values - offset)
        columns.append(np.asarray(difference)[: len(box.free)] / (2.0 * step))
    return np.stack(columns, axis=1)


def _folded(space: Space, position: Array) -> Array:
    """Positions reflected at the faces of the box; a product k x0 has none of its own."""
    folded = np.abs(position)
    folded = np.where(folded > 1.0, 2.0 - folded, folded)
    if space.pair is not None:
        folded[:, space.pair[1]] = position[:, space.pair[1]]
    return folded
