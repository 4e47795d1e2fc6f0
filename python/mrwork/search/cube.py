"""Points of the unit cube: where a population begins, and what becomes of a point that leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.search.streams import Streams


def latin_hypercube(streams: Streams, count: int, n_params: int) -> NDArray[np.float64]:
    """One point per stratum of each gene, shape (n_replicates, count, n_params)."""
    drawn = streams.uniform(2 * count * n_params).reshape(-1, 2, count, n_params)
    strata = np.argsort(drawn[:, 0], axis=1, kind="stable")
    return (strata + drawn[:, 1]) / count


def reflect(unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fold the real line into [0, 1] at 0 and 1, leaving what lies inside bit for bit.

    Clipping would pile points up exactly on the faces, where parameters then seem to want to be; reflection
    leaves a uniform population uniform.
    """
    folded = unit.copy()
    outside = (unit < 0.0) | (unit > 1.0)
    folded[outside] = 1.0 - np.abs(1.0 - np.abs(unit[outside]) % 2.0)
    return folded


def others(uniform: NDArray[np.float64], size: int) -> NDArray[np.int64]:
    """Different members of a group of `size`, none of them the one who draws.

    Parameters
    ----------
    uniform
        Numbers in [0, 1), shape (..., size, n_others); member j draws along the last axis.
    size
        More than `n_others`.

    Returns
    -------
    NDArray of int
        Members, shape (..., size, n_others), all such choices equally likely.
    """
    n_others = uniform.shape[-1]
    taken = np.broadcast_to(np.arange(size)[:, None], (*uniform.shape[:-1], 1))
    for k in range(n_others):
        # The k-th of those that are left: step over the ones taken, lowest first.
        member = (uniform[..., k] * (size - 1 - k)).astype(np.int64)
        for lower in np.moveaxis(np.sort(taken, axis=-1), -1, 0):
            member += member >= lower
        taken = np.concatenate([taken, member[..., None]], axis=-1)
    return taken[..., 1:]
