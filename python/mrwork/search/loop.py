"""The ask/tell loop: one call of the objective per generation, progress, interrupts, journal, results; constraints."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyArrayLike, NotNegative, Seed, checked
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import Interrupted, SettingError
from mrwork.search.course import Dimension, Proposal, Replicate, SearchState, StateT, select
from mrwork.search.rules import EliteRule, StopRules, ended_in_words
from mrwork.store.codec import array_of, digest_of, plain
from mrwork.store.journal import Journal


class RunTrace(NamedTuple):
    """Progress of one replicate, as in `Trace`, each of shape (n_generations,)."""

    evaluations: NDArray[np.int64]
    best: Floats
    median: Floats


@array_dataclass(repr=False)
class SearchResult(Summarised, Generic[StateT]):
    """Result of one replicate, its stop reason, and the state from which it can be resumed alone.

    `best_unit` (n_params,) has `best_misfit`, `inf` if no simulation succeeded. `elite` (n_elite, n_params) are the
    best mutually distant points of the whole run with `elite_misfit` (n_elite,), best first, empty if no simulation
    succeeded; they are starts for a local minimisation. `evaluations` and `generations` count from the start of the
    search, `seconds` is the time of this call, for all replicates together.
    """

    replicate: int
    best_unit: Floats
    best_misfit: float
    elite: Floats
    elite_misfit: Floats
    trace: RunTrace
    evaluations: int
    generations: int
    stop_reason: str
    seconds: float
    state: StateT

    def _summary(self) -> Summary:
        return Summary(
            title=f"Search, replicate {self.replicate}: least misfit {format_rounded(self.best_misfit, 6)}",
            facts=(
                (
                    "ended",
                    f"{ended_in_words(self.stop_reason)}, after {self.generations} generations and "
                    f"{self.evaluations} simulations",
                ),
                ("seconds", format_rounded(self.seconds, 3)),
                ("elite", str(len(self.elite))),
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ReplicatedSearch(Summarised, Generic[StateT]):
    """Results of replicates that ran in one call, and the state from which all can be resumed."""

    _units: ClassVar[Mapping[str, str]] = {"seconds": "s"}

    results: tuple[SearchResult[StateT], ...]
    seconds: float
    state: StateT


def _results_of(state: StateT, reason: str, seconds: float) -> ReplicatedSearch[StateT]:
    """Results of a search that ends in this state; `reason` is that of replicates that no rule has ended."""
    return ReplicatedSearch(
        results=tuple(
            _result(select(state, [row]), reason, seconds) for row in range(len(state.course.replicate))
        ),
        seconds=seconds,
        state=state,
    )


def _result(state: StateT, reason: str, seconds: float) -> SearchResult[StateT]:
    course = state.course
    simulated = np.isfinite(course.elite_misfit[0])
    return SearchResult(
        replicate=int(course.replicate[0]),
        best_unit=course.best_unit[0],
        best_misfit=float(course.best_misfit[0]),
        elite=course.elite_unit[0, simulated],
        elite_misfit=course.elite_misfit[0, simulated],
        trace=RunTrace(
            evaluations=course.trace.evaluations[0], best=course.trace.best[0], median=course.trace.median[0]
        ),
        evaluations=int(course.evaluations[0]),
        generations=int(course.generation[0]),
        stop_reason=course.stop_reasons[0] or reason,
        seconds=seconds,
        state=state,
    )


Objective = Callable[[Floats], Floats]


INFEASIBLE = 1e12
"""From this misfit on no point meets every constraint; misfits are expected to be smaller."""


@checked
def misfit_under_constraints(columns: AnyArrayLike) -> Floats:
    """Misfits that rank points by Deb's rules, shape (m,), for a search or between `ask` and `tell`.

    Points that meet every constraint keep their misfit. The others have 1e12 (1 + v), v the sum of their violations,
    and so come after these, the least violation first; a `best_misfit` of 1e12 or more says that no point was feasible.

    Parameters
    ----------
    columns
        A misfit and constraints g, met where g <= 0, for each point, shape (m, 1 + n_constraints). Divide each g by
        what counts as much of it. A point with a NaN is infinite.

    Raises
    ------
    SettingError
        Where `columns` has no two axes or no column of constraints, or a misfit is 1e12 or more and finite.

    Notes
    -----
    Deb, Comput. Methods Appl. Mech. Eng. 186, 2000, 311-338.

    Examples
    --------
    >>> import numpy as np
    >>> from mrwork.search import EfficientGA, misfit_under_constraints, run_search
    >>> def columns(unit):
    ...     return np.column_stack([unit[:, 0] ** 2 + unit[:, 1], 0.5 - unit[:, 0]])
    >>> found = run_search(
    ...     EfficientGA(), lambda unit: misfit_under_constraints(columns(unit)), rng=0, n_params=2
    ... )
    >>> bool(found.best_unit[0] >= 0.5 and found.best_misfit < 0.3)
    True
    """
    given = np.asarray(columns, dtype=np.float64)
    if given.ndim != 2 or given.shape[1] < 2:
        raise SettingError(
            f"`columns` has the shape {given.shape}; give (m, 1 + n_constraints), a misfit and constraints g <= 0"
        )
    misfit, constraints = given[:, 0], given[:, 1:]
    if np.any((misfit >= INFEASIBLE) & np.isfinite(misfit)):
        raise SettingError(
            f"a misfit is {INFEASIBLE:g} or more, which is for points that miss a constraint; scale the misfits"
        )
    violation = np.maximum(constraints, 0.0).sum(axis=1)
    ranked = np.where(violation > 0.0, INFEASIBLE * (1.0 + violation), misfit)
    return np.asarray(np.where(np.isnan(given).any(axis=1), np.inf, ranked))


@checked
class AbortableObjective:
    """An objective that may stop the simulation of a candidate when its misfit reaches a threshold.

    `misfits` maps unit vectors (m, n_params) and thresholds (m,) to misfits (m,) >= 0: exact below the threshold, any
    number at or above it, or `inf`, otherwise.
    """

    misfits: Callable[[Floats, Floats], Floats]


@runtime_checkable
class Optimiser(Protocol[StateT]):
    """Settings of a derivative-free minimiser on the unit cube; all progress is in its states.

    A replicate depends on the seed, its number, its generation and its misfits, never on other replicates. A search
    that is resumed from a stored state gives the same result as one without interruption; for an optimiser of another
    library, as far as the library allows it.
    """

    @property
    def population(self) -> int:
        """Candidates of one replicate."""

    @property
    def stop(self) -> StopRules:
        """When a replicate ends."""

    @property
    def elite(self) -> EliteRule:
        """Which points of the run are kept as starts of a local minimisation."""

    def start(self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)) -> StateT:
        """Initial state of the replicates with these numbers, before the first simulation."""

    def ask(self, state: StateT) -> Proposal:
        """Candidates of the next generation of all running replicates."""

    def tell(self, state: StateT, proposal: Proposal, misfit: Floats) -> StateT:
        """State after the misfits of the proposal's rows, shape (n_ask,); `inf` marks a failed simulation."""


@array_dataclass(repr=False)
class GenerationEvent(Summarised, Generic[StateT]):
    """Progress after one generation of all running replicates.

    `evaluations` is the sum over replicates; `best_misfit` and `best_unit` (n_params,) are those of the best replicate;
    `median_misfit` is the median over replicates of the median of the population; `n_running` replicates continue.
    `seconds` is the time since this call of the loop began. `misfit` (n_ask,) are the accepted misfits, see
    `Proposal.accept_misfits`, from which `tell` computed `state`.
    """

    _units: ClassVar[Mapping[str, str]] = {"seconds": "s"}

    generation: int
    evaluations: int
    best_misfit: float
    median_misfit: float
    seconds: float
    best_unit: Floats
    n_running: int
    misfit: Floats
    state: StateT


OnGeneration = Callable[[GenerationEvent[StateT]], bool | None]


@checked
def run_search(
    optimiser: Optimiser[StateT],
    objective: Objective | AbortableObjective,
    *,
    rng: Seed,
    n_params: Dimension,
    state: StateT | None = None,
    on_generation: OnGeneration[StateT] | None = None,
    journal: Journal | None = None,
    seconds: NotNegative | None = None,
    until: NotNegative | None = None,
) -> SearchResult[StateT]:
    """Minimise a batch objective over the unit cube, once: replicate 0 of `run_replicates`.

    Parameters
    ----------
    optimiser
        Settings of a search, such as `EfficientGA()`.
    objective
        Maps points (m, n_params) to misfits (m,) >= 0, infinite for a failure: a function of yours, or one of
        `mr.objective` with the coordinates "unit"; constraints enter by `misfit_under_constraints`.
    rng
        Seed; the same seed gives the same bits.
    n_params
        Number of coordinates.
    state
        Where an earlier search ended, to go on from.
    on_generation
        Called after every generation; where it returns true the search ends.
    journal
        Records every generation, and recalls those of a search that was interrupted.
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
    >>> while state.course.running.size:
    ...     proposal = search.ask(state)
    ...     state = search.tell(state, proposal, sphere(proposal.unit))
    >>> bool(np.all(state.course.best_unit[0] == result.best_unit))
    True
    """
    budget = {"max_seconds": seconds, "target": until}
    given = {name: value for name, value in budget.items() if value is not None}
    if given:
        # Every optimiser is a dataclass with these settings, which its protocol does not declare.
        settings: Any = optimiser
        optimiser = replace(settings, stop=replace(settings.stop, **given))
    try:
        run = run_replicates(
            optimiser,
            objective,
            rng=rng,
            n_params=n_params,
            replicates=(0,),
            state=state,
            on_generation=on_generation,
            journal=journal,
        )
    except Interrupted as interrupt:
        raise Interrupted(interrupt.result.results[0], "search") from interrupt
    return run.results[0]


def run_replicates(
    optimiser: Optimiser[StateT],
    objective: Objective | AbortableObjective,
    *,
    rng: Seed,
    n_params: Dimension,
    replicates: Sequence[Replicate],
    state: StateT | None = None,
    on_generation: OnGeneration[StateT] | None = None,
    journal: Journal | None = None,
) -> ReplicatedSearch[StateT]:
    """Minimise a batch objective over the unit cube in several replicates at once.

    The objective maps unit vectors (m, n_params) to misfits (m,) >= 0, `inf` for a failure; it is called once in each
    generation with the candidates of all running replicates. An `AbortableObjective` gets thresholds too.

    The same seed gives the same bits; the result of a replicate does not depend on the others. A stored `state` to
    resume from must come from the same `rng`, `n_params` and `replicates`. Where `on_generation` returns true all
    replicates stop, with reason "callback"; otherwise a `stop_reason` is a name of `StopRules`. A resumed journal
    supplies the generations that it has recorded, then the search continues; the caller must check with `Journal.agree`
    that the inputs of the objective are the same.
    """
    began = time.perf_counter()
    stop = optimiser.stop
    if stop.max_evaluations is not None and stop.max_evaluations < optimiser.population:
        raise SettingError(
            f"`max_evaluations` is {stop.max_evaluations}, the first generation alone takes "
            f"{optimiser.population}; allow more or lower the population"
        )
    if state is None:
        state = optimiser.start(n_params, rng, replicates)
    else:
        _check_same_search(state, rng, n_params, replicates)
    if journal is not None:
        _agree_on_search(journal, optimiser, state)
    reason = ""
    seconds = 0.0
    try:
        while state.course.running.size:
            if stop.max_seconds is not None and seconds >= stop.max_seconds:
                reason = "max_seconds"
                break
            proposal = optimiser.ask(state)
            recalled = None if journal is None else _recalled_generation(journal, proposal)
            misfit, seconds = recalled or (_misfits(objective, proposal), 0.0)
            state = optimiser.tell(state, proposal, misfit)
            if recalled is None:
                seconds = time.perf_counter() - began
            else:
                # The clock continues from the recorded time, so that `max_seconds` ends a resumed search as before.
                began = time.perf_counter() - seconds
            event = _event(state, misfit, seconds)
            if journal is not None and recalled is None:
                _record_generation(journal, proposal, event)
            if on_generation is not None and on_generation(event):
                reason = "callback"
                break
    except KeyboardInterrupt as interrupt:
        raise Interrupted(
            _results_of(state, "interrupted", time.perf_counter() - began), "search"
        ) from interrupt
    return _results_of(state, reason, time.perf_counter() - began)


def _misfits(objective: Objective | AbortableObjective, proposal: Proposal) -> Floats:
    if isinstance(objective, AbortableObjective):
        return proposal.accept_misfits(objective.misfits(proposal.unit, proposal.threshold))
    return proposal.accept_misfits(objective(proposal.unit))


def _check_same_search(state: SearchState, rng: int, n_params: int, replicates: Sequence[int]) -> None:
    stored = (state.course.rng, state.population.shape[2], state.course.replicate.tolist())
    requested = (rng, n_params, list(replicates))
    if stored != requested:
        raise SettingError(
            f"the stored state is of a search with rng={stored[0]} and n_params={stored[1]}, replicates "
            f"{stored[2]}, requested are rng={rng} and n_params={n_params}, replicates {requested[2]}; "
            "resume with those of the state or start a new search"
        )


def _event(state: StateT, misfit: Floats, seconds: float) -> GenerationEvent[StateT]:
    course = state.course
    leader = int(np.argmin(course.best_misfit))
    return GenerationEvent(
        generation=int(course.generation.max()),
        evaluations=int(course.evaluations.sum()),
        best_misfit=float(course.best_misfit[leader]),
        median_misfit=float(np.median(course.trace.median[:, -1])),
        seconds=seconds,
        best_unit=course.best_unit[leader],
        n_running=course.running.size,
        misfit=misfit,
        state=state,
    )


_STEP = "generation"


def _agree_on_search(journal: Journal, optimiser: object, state: SearchState) -> None:
    """Record the settings of the search in a journal, or check that those of the journal are the same."""
    course = state.course
    journal.agree(
        "search",
        {
            "optimiser": type(optimiser).__name__,
            "settings": plain(optimiser),
            "seed": course.rng,
            "replicates": course.replicate,
            "n_params": state.population.shape[2],
            "generation": course.generation.max(),
        },
    )


def _recalled_generation(journal: Journal, proposal: Proposal) -> tuple[Floats, float] | None:
    """Accepted misfits of the proposal, (n_ask,), and seconds of the search, if the journal has recorded them."""

    def read(record: dict[str, Any]) -> tuple[Floats, float]:
        misfit = array_of(record["misfit"])
        if misfit.shape != proposal.unit.shape[:1]:
            raise ValueError(f"misfits of the shape {misfit.shape}")
        return misfit, float(record["search_seconds"])

    return journal.recall(_STEP, _digest(proposal), read) if journal.recalling else None


def _record_generation(journal: Journal, proposal: Proposal, event: GenerationEvent[Any]) -> None:
    """Record a generation: the data for a resumed search, and progress for readers of the journal."""
    journal.record(
        _STEP,
        _digest(proposal),
        {
            "generation": event.generation,
            "evaluations": event.evaluations,
            "best": event.best_misfit,
            "median": event.median_misfit,
            # Random numbers depend on seed, replicate and generation only, so this is their whole state.
            "next_stream": {"seed": event.state.course.rng, "generation": event.generation},
            "misfit": event.misfit,
            "search_seconds": event.seconds,
        },
    )


def _digest(proposal: Proposal) -> str:
    return digest_of(proposal.number, proposal.population, proposal.changed, proposal.threshold)
