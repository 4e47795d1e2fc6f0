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
        At most so many; 1 keeps the best alone.
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
    n_replicates, size = misfit.shape
    n_params = population.shape[2]
    order = np.argsort(misfit, axis=1, kind="stable")
    finite = np.isfinite(np.take_along_axis(misfit, order, axis=1))
    row = size * np.arange(n_replicates)
    gene = np.ascontiguousarray(population.reshape(-1, n_params).T)
    taken = np.full((n_replicates, rule.count), -1, dtype=np.int64)
    n_taken = np.zeros(n_replicates, dtype=np.int64)
    # Where none is taken yet: outside the cube, far from everything.
    taken_gene = np.full((n_params, n_replicates, rule.count), 9.0)
    # The j-th best of every replicate at once.
    for j in range(int(np.count_nonzero(finite, axis=1).max(initial=0))):
        if n_taken.min() == rule.count:
            break
        member = order[:, j]
        candidate = gene[:, row + member]
        gap = np.abs(taken_gene - candidate[..., None]).max(axis=0).min(axis=1)
        enters = np.flatnonzero(finite[:, j] & (gap >= rule.distance) & (n_taken < rule.count))
        taken[enters, n_taken[enters]] = member[enters]
        taken_gene[:, enters, n_taken[enters]] = candidate[:, enters]
        n_taken[enters] += 1
    return taken
