"""What a search found, replicate by replicate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.search.state import SearchState, select
from mrwork.summary import Summarised, Summary, rounded

StateT = TypeVar("StateT", bound=SearchState)


class RunTrace(NamedTuple):
    """Progress of one replicate, each of shape (n_generations,); the meaning is that of `Trace`."""

    evaluations: NDArray[np.int64]
    best: NDArray[np.float64]
    median: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SearchResult(Summarised, Generic[StateT]):
    """What one replicate found, why it stopped, and the state from which it can go on alone.

    `best_unit` (n_params,) has `best_misfit`, `inf` if no simulation ever succeeded. `elite`
    (n_elite, n_params) are the distinct good finds of the whole run with `elite_misfit` (n_elite,), best
    first: starts of a local refinement; empty if no simulation ever succeeded. `evaluations` and
    `generations` count from the very start, `seconds` this call only, of all replicates together.
    """

    replicate: int
    best_unit: NDArray[np.float64]
    best_misfit: float
    elite: NDArray[np.float64]
    elite_misfit: NDArray[np.float64]
    trace: RunTrace
    evaluations: int
    generations: int
    stop_reason: str
    seconds: float
    state: StateT

    def _summary(self) -> Summary:
        return Summary(
            title=f"Search, replicate {self.replicate}: least misfit {rounded(self.best_misfit, 6)}",
            facts=(
                (
                    "ended",
                    f"{self.stop_reason} after {self.generations} generations, {self.evaluations} simulations",
                ),
                ("seconds", rounded(self.seconds, 3)),
                ("distinct finds", str(len(self.elite))),
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReplicatedSearch(Generic[StateT]):
    """The results of replicates that ran side by side, and the state from which all of them can go on."""

    results: tuple[SearchResult[StateT], ...]
    seconds: float
    state: StateT

    @property
    def best(self) -> SearchResult[StateT]:
        """The one that came lowest."""
        return min(self.results, key=lambda result: result.best_misfit)


def results_of(state: StateT, reason: str, seconds: float) -> ReplicatedSearch[StateT]:
    """Sum up a search that ends on this state; `reason` is why those end that no rule had ended."""
    return ReplicatedSearch(
        results=tuple(
            _result(select(state, [row]), reason, seconds) for row in range(len(state.course.replicate))
        ),
        seconds=seconds,
        state=state,
    )


def _result(state: StateT, reason: str, seconds: float) -> SearchResult[StateT]:
    course = state.course
    found = np.isfinite(course.elite_misfit[0])
    return SearchResult(
        replicate=int(course.replicate[0]),
        best_unit=course.best_unit[0],
        best_misfit=float(course.best_misfit[0]),
        elite=course.elite_unit[0, found],
        elite_misfit=course.elite_misfit[0, found],
        trace=RunTrace(
            evaluations=course.trace.evaluations[0],
            best=course.trace.best[0],
            median=course.trace.median[0],
        ),
        evaluations=int(course.evaluations[0]),
        generations=int(course.generation[0]),
        stop_reason=course.stop_reasons[0] or reason,
        seconds=seconds,
        state=state,
    )
