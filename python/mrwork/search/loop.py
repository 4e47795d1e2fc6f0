"""The ask/tell loop: one call of the objective per generation, progress, interrupts, journal, results."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from mrwork.base.arguments import NotNegative, Seed, checked
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.search.course import Dimension, Optimiser, Proposal, State, Trace
from mrwork.search.rules import ended_in_words
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall


@array_dataclass(repr=False)
class SearchResult(Summarised):
    """Result of a search so far, its stop reason, empty while it runs, and the state from which it can be resumed.

    `best_unit` (n_params,) has `best_misfit`, `inf` if no simulation succeeded. `elite` (n_elite, n_params) are the
    best mutually distant points of the whole run with `elite_misfit` (n_elite,), best first, empty if no simulation
    succeeded; they are starts for a local minimisation. `evaluations` and `generations` count from the start of the
    search, `seconds` is the time of this call.
    """

    best_unit: Floats
    best_misfit: float
    elite: Floats
    elite_misfit: Floats
    trace: Trace
    evaluations: int
    generations: int
    stop_reason: str
    seconds: float
    state: State

    def _summary(self) -> Summary:
        length = f"{self.generations} generations and {self.evaluations} simulations"
        return Summary(
            title=f"Search: least misfit {format_rounded(self.best_misfit, 6)}",
            facts=(
                ("ended", f"{ended_in_words(self.stop_reason)}, after {length}"),
                ("seconds", format_rounded(self.seconds, 3)),
                ("elite", str(len(self.elite))),
            ),
        )


def _result(state: State, reason: str, seconds: float) -> SearchResult:
    """The result of a search in this state; `reason` is stated for a search that no rule has ended."""
    course = state.course
    return SearchResult(
        best_unit=course.best_unit,
        best_misfit=course.best_misfit,
        elite=course.elite,
        elite_misfit=course.elite_misfit,
        trace=course.trace,
        evaluations=course.evaluations,
        generations=course.generation,
        stop_reason=course.stop_reason or reason,
        seconds=seconds,
        state=state,
    )


Objective = Callable[[Floats], Floats]


@checked
def run_search(
    optimiser: Optimiser,
    objective: Objective,
    *,
    rng: Seed,
    n_params: Dimension,
    state: State | None = None,
    on_generation: Callable[[SearchResult], bool | None] | None = None,
    journal: Journal | None = None,
    seconds: NotNegative | None = None,
    until: NotNegative | None = None,
) -> SearchResult:
    """Minimise a batch objective over the unit cube; it is called once in each generation.

    Parameters
    ----------
    optimiser
        Settings of a search, such as `EfficientGA()`.
    objective
        Maps points (m, n_params) to misfits (m,) >= 0, infinite for a failure: a function of yours, or one of
        `mr.objective` with the coordinates "unit".
    rng
        Seed; the same seed gives the same bits. Many searches are a loop over seeds.
    n_params
        Number of coordinates.
    state
        Where an earlier search of the same `rng` and `n_params` ended, to go on from.
    on_generation
        Called with the result so far after every generation; where it returns true the search ends, with the reason
        "callback".
    journal
        Records every generation, and recalls the generations of a search that was interrupted. The caller checks with
        `Journal.agree` that the inputs of the objective are the same.
    seconds, until
        Time after which no generation begins, and misfit at which the search ends: `max_seconds` and `target` of the
        optimiser's `StopRules`, in whose place they are used.

    Raises
    ------
    Interrupted
        On Ctrl-C, carrying the `SearchResult` of the completed generations.

    Examples
    --------
    >>> import numpy as np
    >>> from mrwork.search import EfficientGA
    >>> sphere = lambda unit: np.sum((unit - 0.3) ** 2, axis=1)
    >>> result = run_search(EfficientGA(), sphere, rng=0, n_params=3)
    >>> bool(np.all(np.abs(result.best_unit - 0.3) < 0.05))
    True

    Ask and tell, for a loop of your own:

    >>> search = EfficientGA()
    >>> state = search.start(n_params=3, rng=0)
    >>> while state.course.running:
    ...     proposal = search.ask(state)
    ...     state = search.tell(state, proposal, sphere(proposal.unit))
    >>> bool(np.all(state.course.best_unit == result.best_unit))
    True
    """
    given: dict[str, Any] = {"max_seconds": seconds, "target": until}
    stop = replace(optimiser.stop, **{name: limit for name, limit in given.items() if limit is not None})
    optimiser = replace(optimiser, stop=stop)
    if stop.max_evaluations is not None and stop.max_evaluations < optimiser.population:
        raise SettingError(
            f"`max_evaluations` is {stop.max_evaluations}, the first generation alone takes "
            f"{optimiser.population}; allow more or lower the population"
        )
    latest = optimiser.start(n_params, rng) if state is None else state
    if (stored := (latest.course.rng, latest.population.shape[1])) != (rng, n_params):
        raise SettingError(
            f"the stored state is of a search with rng={stored[0]} and n_params={stored[1]}, requested are "
            f"rng={rng} and n_params={n_params}; resume with those of the state or start a new search"
        )
    if journal is not None:
        facts = {"optimiser": optimiser.name, "settings": optimiser, "seed": rng, "n_params": n_params}
        journal.agree("search", {**facts, "generation": latest.course.generation})
    began, elapsed, reason = time.perf_counter(), 0.0, ""
    call: LongCall[SearchResult] = LongCall(
        journal=journal, so_far=lambda: _result(latest, "interrupted", time.perf_counter() - began)
    )
    with call.keeping("search"):
        while latest.course.running:
            if stop.max_seconds is not None and elapsed >= stop.max_seconds:
                reason = "max_seconds"
                break
            proposal = optimiser.ask(latest)
            simulate = partial(_simulate, objective, proposal, began)
            generation = call.step("generation", _Generation, simulate, proposal.population, proposal.changed)
            latest, elapsed = optimiser.tell(latest, proposal, generation.misfit), generation.search_seconds
            # The clock continues from a recorded time, so that `max_seconds` ends a resumed search as before.
            began = time.perf_counter() - elapsed
            if on_generation is not None and on_generation(_result(latest, "", elapsed)):
                reason = "callback"
                break
    return _result(latest, reason, time.perf_counter() - began)


@array_dataclass()
class _Generation:
    """Misfits of the candidates of a proposal, (n_ask,), and seconds since the search began."""

    misfit: Floats
    search_seconds: float


def _simulate(objective: Objective, proposal: Proposal, began: float) -> _Generation:
    misfit = proposal.check(objective(proposal.unit))
    return _Generation(misfit=misfit, search_seconds=time.perf_counter() - began)
