"""Where walkers start: in the ellipsoid that the Fisher information draws about a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.uncertainty.posterior.fisher import fisher_information
from mrwork.uncertainty.posterior.space import Space
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

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
    origin = target.position_of(target.form.box.inside(start))
    return origin, np.linalg.cholesky(np.linalg.inv(fisher_information(target, origin)))


def _folded(space: Space, position: Array) -> Array:
    """Positions reflected at the faces of the box; a product k x0 has none of its own."""
    folded = np.abs(position)
    folded = np.where(folded > 1.0, 2.0 - folded, folded)
    if space.pair is not None:
        folded[:, space.pair[1]] = position[:, space.pair[1]]
    return folded
