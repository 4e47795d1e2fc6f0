"""What every optimiser remembers of its progress, and which of its finds are worth refining."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """Progress, one entry per generation, each of shape (n_generations,).

    `evaluations` simulations so far, `best` misfit so far, `median` misfit of the population
    (`inf` while half of it fails).
    """

    evaluations: NDArray[np.int64]
    best: NDArray[np.float64]
    median: NDArray[np.float64]

    def with_generation(self, evaluations: int, best: float, median: float) -> Trace:
        """Longer by one entry."""
        return Trace(
            evaluations=np.append(self.evaluations, np.int64(evaluations)),
            best=np.append(self.best, best),
            median=np.append(self.median, median),
        )


EMPTY_TRACE = Trace(evaluations=np.empty(0, np.int64), best=np.empty(0), median=np.empty(0))


class SearchState(Protocol):
    """What the loop reads of an optimiser's state, whichever optimiser it is."""

    @property
    def rng(self) -> int:
        """Seed from which every generation derives its own stream."""

    @property
    def generation(self) -> int:
        """Generations told so far."""

    @property
    def evaluations(self) -> int:
        """Simulations told so far."""

    @property
    def population(self) -> NDArray[np.float64]:
        """Current candidates, shape (n_population, n_params), in the unit cube."""

    @property
    def best_unit(self) -> NDArray[np.float64]:
        """Best candidate so far, shape (n_params,)."""

    @property
    def best_misfit(self) -> float:
        """Its misfit; `inf` while every simulation has failed."""

    @property
    def elite_unit(self) -> NDArray[np.float64]:
        """Good and mutually distant finds of the whole run, best first, shape (n_elite, n_params)."""

    @property
    def elite_misfit(self) -> NDArray[np.float64]:
        """Their misfits, shape (n_elite,), rising."""

    @property
    def trace(self) -> Trace:
        """Progress per generation."""


def distinct_best(
    population: NDArray[np.float64], misfit: NDArray[np.float64], count: int, distance: float
) -> NDArray[np.int64]:
    """Rows of `population` that are good and mutually distant: starts for a local refinement.

    Greedy: the best first, then the next best whose largest gene difference to every one taken is
    at least `distance`. A copy or a near copy would only send the refinement to the same minimum.

    Parameters
    ----------
    population
        Candidates in the unit cube, shape (n, n_params).
    misfit
        Shape (n,); failures (`inf`) are never taken.
    count
        At most so many rows.
    distance
        Share of the box, 0 to 1; 0 allows copies.

    Returns
    -------
    NDArray of int
        Row indices, best first; fewer than `count` where the population is not that varied.
    """
    if count < 1 or not 0.0 <= distance <= 1.0:
        raise SettingError(
            f"`count` is at least 1 and `distance` a share of the box in [0, 1], got {count} and {distance}"
        )
    taken: list[int] = []
    for row in np.argsort(misfit, kind="stable"):
        if len(taken) == count or not np.isfinite(misfit[row]):
            break
        apart = np.abs(population[taken] - population[row]).max(axis=1, initial=0.0)
        if np.all(apart >= distance):
            taken.append(int(row))
    return np.array(taken, dtype=np.int64)
