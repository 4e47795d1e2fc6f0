"""The ask/tell loop: one call of the objective per generation, progress told, interrupts survived.

The optimiser is pure (state in, state out), the objective is a batch function on the unit cube, and the
loop is the only place that knows both. `on_generation` serves progress bars, journals and early stops alike:
it sees every generation's state, which is all that is needed to go on later.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.search.state import SearchState, Trace

StateT = TypeVar("StateT", bound=SearchState)
Objective = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Optimiser(Protocol[StateT]):
    """Derivative-free minimiser on the unit cube; settings only, all progress is in its states.

    `tell` takes what the objective made of the rows of `ask`; the random numbers of a generation are
    a function of the state's `rng` and `generation`, so that a stored state goes on as if never interrupted.
    """

    def start(self, n_params: int, rng: int) -> StateT:
        """Make the initial state, nothing simulated yet."""

    def ask(self, state: StateT) -> NDArray[np.float64]:
        """Propose unit vectors to simulate next, shape (n_ask, n_params)."""

    def tell(self, state: StateT, misfit: NDArray[np.float64]) -> StateT:
        """Take in their misfits, shape (n_ask,); `inf` marks a failed simulation."""

    def stop_reason(self, state: StateT) -> str | None:
        """Say why the search should end, or `None` to go on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GenerationEvent(Generic[StateT]):
    """Progress after one generation; `seconds` since this call of `run_search` began."""

    generation: int
    evaluations: int
    best_misfit: float
    median_misfit: float
    seconds: float
    best_unit: NDArray[np.float64]
    state: StateT


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchResult(Generic[StateT]):
    """What a search found, why it stopped, and the state from which it can go on.

    `best_unit` (n_params,) has `best_misfit`, `inf` if no simulation ever succeeded. `elite`
    (n_elite, n_params) are the distinct good finds of the whole run with `elite_misfit` (n_elite,), best
    first: starts of a local refinement; empty if no simulation ever succeeded. `evaluations` and
    `generations` count from the very start, `seconds` this call only.
    """

    best_unit: NDArray[np.float64]
    best_misfit: float
    elite: NDArray[np.float64]
    elite_misfit: NDArray[np.float64]
    trace: Trace
    evaluations: int
    generations: int
    stop_reason: str
    seconds: float
    state: StateT


class SearchInterrupted(KeyboardInterrupt):
    """Ctrl-C during a search; `result` holds what the completed generations found."""

    # Any: an exception cannot be generic, and the state's type is the caller's own optimiser's.
    result: SearchResult[Any]

    def __init__(self, result: SearchResult[Any]) -> None:
        super().__init__(f"search interrupted after {result.generations} generations")
        self.result = result


def run_search(
    optimiser: Optimiser[StateT],
    objective: Objective,
    *,
    rng: int,
    n_params: int,
    state: StateT | None = None,
    on_generation: Callable[[GenerationEvent[StateT]], bool | None] | None = None,
    max_evaluations: int | None = None,
) -> SearchResult[StateT]:
    """Minimise a batch objective over the unit cube.

    Parameters
    ----------
    optimiser
        For example `EfficientGA()`.
    objective
        Maps unit vectors (m, n_params) to misfits (m,) >= 0, `inf` for a failed simulation.
    rng
        Seed, a whole number >= 0; the same seed gives the same bits.
    n_params
        Dimension of the cube.
    state
        A stored state to go on from; it must come from the same `rng` and `n_params`.
    on_generation
        Called after every generation; a return of `True` stops with reason "callback".
    max_evaluations
        Never simulate more than this in all; stops with reason "max_evaluations".

    Returns
    -------
    SearchResult
        With `stop_reason` of the optimiser, "callback" or "max_evaluations".

    Raises
    ------
    SearchInterrupted
        On Ctrl-C, carrying the result of the completed generations with reason "interrupted".
    SettingError
        When `max_evaluations` is too small for a first generation, or `state` belongs to another search.

    Examples
    --------
    >>> import numpy as np
    >>> from mrwork.search import EfficientGA
    >>> sphere = lambda unit: np.sum((unit - 0.3) ** 2, axis=1)
    >>> result = run_search(EfficientGA(), sphere, rng=0, n_params=3)
    >>> bool(np.all(np.abs(result.best_unit - 0.3) < 0.05))
    True
    """
    began = time.perf_counter()
    if state is None:
        state = optimiser.start(n_params, rng)
    elif state.rng != rng or state.population.shape[1] != n_params:
        raise SettingError(
            f"the stored state is of a search with rng={state.rng} and n_params={state.population.shape[1]}, "
            f"asked for rng={rng} and n_params={n_params}; resume with its own or start afresh"
        )
    try:
        while (reason := optimiser.stop_reason(state)) is None:
            unit = optimiser.ask(state)
            if max_evaluations is not None and state.evaluations + len(unit) > max_evaluations:
                if state.evaluations == 0:
                    raise SettingError(
                        f"`max_evaluations` is {max_evaluations}, the first generation alone takes "
                        f"{len(unit)}; allow more or lower the population"
                    )
                reason = "max_evaluations"
                break
            state = optimiser.tell(state, objective(unit))
            if on_generation is not None and on_generation(_event(state, began)) is True:
                # The optimiser's own reason says more where both apply.
                reason = optimiser.stop_reason(state) or "callback"
                break
    except KeyboardInterrupt as interrupt:
        raise SearchInterrupted(_result(state, "interrupted", began)) from interrupt
    return _result(state, reason, began)


def _event(state: StateT, began: float) -> GenerationEvent[StateT]:
    """Progress as the callback sees it."""
    return GenerationEvent(
        generation=state.generation,
        evaluations=state.evaluations,
        best_misfit=state.best_misfit,
        median_misfit=float(state.trace.median[-1]),
        seconds=time.perf_counter() - began,
        best_unit=state.best_unit,
        state=state,
    )


def _result(state: StateT, reason: str, began: float) -> SearchResult[StateT]:
    """Sum up a search that ends on this state."""
    return SearchResult(
        best_unit=state.best_unit,
        best_misfit=state.best_misfit,
        elite=state.elite_unit,
        elite_misfit=state.elite_misfit,
        trace=state.trace,
        evaluations=state.evaluations,
        generations=state.generation,
        stop_reason=reason,
        seconds=time.perf_counter() - began,
        state=state,
    )
