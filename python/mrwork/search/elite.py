"""Which finds of a run are worth refining: good ones, and far enough apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.search.ranges import check_ranges


@dataclass(frozen=True, slots=True, kw_only=True)
class EliteRule:
    """How many distinct finds of a run are kept as starts of a refinement, and how far apart they are.

    Parameters
    ----------
    count
        At most so many; 1 keeps the best alone and costs nothing.
    distance
        Least distance (largest gene difference) of any two, a share of the box; 0 allows copies.
    """

    count: int = 16
    distance: float = 0.2

    def __post_init__(self) -> None:
        check_ranges({"count": (self.count, 1, np.inf), "distance": (self.distance, 0.0, 1.0)})


def distinct_best(
    population: NDArray[np.float64], misfit: NDArray[np.float64], rule: EliteRule
) -> NDArray[np.int64]:
    """Members of each population that are good and mutually distant.

    Greedy: the best first, then the next best whose distance to every one taken is at least that of the rule. A
    copy or a near copy would only send a refinement to the same minimum.

    Parameters
    ----------
    population
        Candidates in the unit cube, shape (n_replicates, n, n_params).
    misfit
        Shape (n_replicates, n); failures (`inf`) are never taken.
    rule
        How many, how far apart.

    Returns
    -------
    NDArray of int
        Shape (n_replicates, rule.count): indices, best first, then -1 where the population is not that varied.
    """
    n_replicates, count = misfit.shape
    taken = np.full((n_replicates, rule.count), -1, dtype=np.int64)
    order = np.argsort(misfit, axis=1, kind="stable")
    flat = (order + count * np.arange(n_replicates)[:, None]).ravel()
    # Candidates of all replicates in one list, best first in each; it shrinks quickly as near ones are left out.
    left = flat[np.isfinite(misfit.ravel()[flat])]
    gene = np.ascontiguousarray(population.reshape(-1, population.shape[2]).T)
    for place in range(rule.count):
        if not left.size:
            break
        replicate = left // count
        leads = np.ones(left.size, np.bool_)
        np.not_equal(replicate[1:], replicate[:-1], out=leads[1:])
        leader = left[leads]
        taken[replicate[leads], place] = leader % count
        if place + 1 < rule.count:
            of_each = leader[np.cumsum(leads) - 1]
            apart = np.abs(gene[:, left] - gene[:, of_each]).max(axis=0) >= rule.distance
            # With no least distance the leader is apart from itself.
            left = left[apart & ~leads]
    return taken
