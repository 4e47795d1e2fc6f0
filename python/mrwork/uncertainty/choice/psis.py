"""Leave-one-block-out prediction from draws of the posterior: importance sampling, its tail smoothed (PSIS)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.uncertainty.posterior.target import Target

Array = NDArray[np.float64]

# Above it the importance weights of a block have so heavy a tail that its number cannot be relied on
# (Vehtari, Gelman and Gabry, Statistics and Computing 27, 2017, 1413-1432).
UNRELIABLE = 0.7
# Rows whose histories are held in memory at once.
_ROWS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaveOneOut:
    """Expected log predictive density of each block given the others, and its Pareto k, shape (n_blocks,)."""

    elpd: Array
    pareto_k: Array


def leave_one_out(log_densities: Array, log_ratio: Array) -> LeaveOneOut:
    """Predict each block from the others.

    Parameters
    ----------
    log_densities
        Of each block under each draw, shape (n_draws, n_blocks).
    log_ratio
        Log of the posterior density over that of the draws, shape (n_draws,); all zero for draws from the posterior.

    Raises
    ------
    SettingError
        Where there are fewer than two blocks or hardly any draws: nothing could be left out, or told.
    """
    n_draws, n_blocks = log_densities.shape
    if n_blocks < 2:
        raise SettingError("the records make one block only, so none can be left out; give longer ones")
    if n_draws < 100:
        raise SettingError(f"{n_draws} draws fell where the posterior is; leave-one-out wants 100 or more")
    # ArviZ takes seconds to load, and says nothing of its types.
    statistics: Any = import_module("arviz_stats.base").array_stats
    if np.ptp(log_ratio) == 0.0:
        elpd, pareto_k, _ = statistics.loo(log_densities.T[:, None, :])
    else:
        ratio = np.broadcast_to(log_ratio, (n_blocks, 1, n_draws))
        elpd, pareto_k, _ = statistics.loo_approximate_posterior(
            log_densities.T[:, None, :], ratio, np.zeros_like(ratio)
        )
    return LeaveOneOut(
        elpd=np.asarray(elpd, dtype=np.float64), pareto_k=np.asarray(pareto_k, dtype=np.float64)
    )


def block_densities(target: Target, theta: Array, noise: Array, blocks: Sequence[Sequence[slice]]) -> Array:
    """Tempered log density of every block of every test under every draw, shape (n_draws, n_blocks).

    Parameters
    ----------
    theta, noise
        Draws of the target's own form, shape (n_draws, n_params) and (n_draws, n_noise).
    blocks
        Of the samples that count, test by test.
    """
    chunks = -(-len(theta) // _ROWS)
    pairs = zip(np.array_split(theta, chunks), np.array_split(noise, chunks), strict=True)
    return np.concatenate([_of_rows(target, np.ascontiguousarray(rows), own, blocks) for rows, own in pairs])


def _of_rows(target: Target, theta: Array, noise: Array, blocks: Sequence[Sequence[slice]]) -> Array:
    columns = []
    for (residual, force, failed), of_test in zip(target.residuals(theta), blocks, strict=True):
        density = target.temper * target.noise.log_densities(residual, force, noise)
        density[failed] = -np.inf
        columns += [density[:, block].sum(axis=1) for block in of_test]
    return np.stack(columns, axis=1)
