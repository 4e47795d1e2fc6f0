"""Weighted draws from a posterior, about a fit: the Fisher ellipsoid, corrected by importance.

Cheaper than a chain by far, and told apart from a failure: the weights say how well the ellipsoid met the posterior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.uncertainty.choice.ellipsoid import Ellipsoid, fisher_ellipsoid
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

# Degrees of freedom of the t distribution that is drawn from: its tails are heavier than those of a posterior.
_TAILS = 5.0
# Rounds in which the ellipsoid is brought to where the weights are, and draws of each.
_ROUNDS = 3
_FEWEST, _PER_DIMENSION = 500, 100


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightedDraws:
    """Positions of a target's space, shape (n_draws, n_dim), and how much likelier each is than it was drawn.

    `log_ratio` (n_draws,) is the log of the target density over that of the draws, up to a constant.
    """

    position: Array
    log_ratio: Array

    @property
    def weights(self) -> Array:
        """Importance weights, their tail smoothed (PSIS), shape (n_draws,), of sum 1."""
        # ArviZ takes seconds to load, and says nothing of its types.
        statistics: Any = import_module("arviz_stats.base").array_stats
        weights = np.exp(statistics.psislw(-self.log_ratio)[0])
        return np.asarray(weights / weights.sum())

    @property
    def effective(self) -> float:
        """How many draws from the target itself they are worth."""
        return float(1.0 / np.sum(self.weights**2))


def draw_about(target: Target, theta: Array, n_draws: int, rng: np.random.Generator) -> WeightedDraws:
    """Draw from a multivariate t about a fit, shape (n_params,), its ellipsoid adapted to the posterior.

    It begins as the inverse of the tempered Fisher information; in each of a few rounds its centre and covariance
    become those of the weighted draws (population Monte Carlo: Cappe et al., J. Comput. Graph. Stat. 13, 2004,
    907-929). Draws outside the box or that cannot be simulated are left out.
    """
    ellipsoid = fisher_ellipsoid(target, theta)
    n_moving = ellipsoid.moving.size
    for _ in range(_ROUNDS):
        draws = _drawn(target, ellipsoid, max(_FEWEST, _PER_DIMENSION * n_moving), rng)
        # So few draws that matter would collapse the ellipsoid onto themselves.
        if len(draws.position) > 5 * n_moving and draws.effective > 2 * n_moving:
            ellipsoid = _adapted(ellipsoid, draws)
    return _drawn(target, ellipsoid, n_draws, rng)


def _adapted(ellipsoid: Ellipsoid, draws: WeightedDraws) -> Ellipsoid:
    """The ellipsoid of weighted draws."""
    weights = draws.weights
    centre = weights @ draws.position
    offsets = (draws.position - centre)[:, ellipsoid.moving]
    return replace(ellipsoid, centre=centre, covariance=offsets.T @ (weights[:, None] * offsets))


def _drawn(target: Target, ellipsoid: Ellipsoid, n_draws: int, rng: np.random.Generator) -> WeightedDraws:
    covariance, n_dim = ellipsoid.covariance, ellipsoid.moving.size
    # Of unit diagonal, for coordinates may be known to a millionth or not at all.
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
