"""State of a search: its proposal, the progress of every replicate, its arrays, and what populations make of it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, NotNegative, Seed, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import ArgumentError, SettingError
from mrwork.search.rules import REASONS, EliteRule, StopRules, distinct_best
from mrwork.search.unit_cube import Streams


@array_dataclass(repr=False)
class Proposal(Summarised):
    """One generation of the running replicates, to be simulated in one call.

    `population` (n_running, n_population, n_params) with `known` misfits (n_running, n_population). Only the `changed`
    members are simulated; `known` is `inf` for these. A misfit at or above its `limit` (n_running, n_population) counts
    as a failure, so its simulation may stop there. `number` (n_running,) are the numbers of the replicates.
    """

    _made_by: ClassVar[str] = "optimiser.ask(state)"

    number: NDArray[np.int64]
    population: Floats
    known: Floats
    changed: NDArray[np.bool_]
    limit: Floats

    @property
    def unit(self) -> Floats:
        """Candidates to simulate, shape (n_ask, n_params), replicate by replicate."""
        return self.population[self.changed]

    @property
    def threshold(self) -> Floats:
        """Misfit at which the simulation of a row may stop, shape (n_ask,); `inf` where it may not."""
        return self.limit[self.changed]

    def accept_misfits(self, misfit: AnyNumbers) -> Floats:
        """Misfits for the optimiser, shape (n_ask,): `inf` at or above the threshold, and for failed or stopped ones.

        They do not depend on whether a simulation stopped at its threshold.
        """
        misfit = np.asarray(misfit, dtype=np.float64)
        n_ask = np.count_nonzero(self.changed)
        if misfit.shape != (n_ask,):
            raise SettingError(
                f"`misfit` has shape {misfit.shape}, the proposal has {n_ask} candidates; "
                "give one misfit per row of the proposal's `unit`, in its order"
            )
        if not np.all(misfit >= 0.0):
            row = int(np.argmin(misfit >= 0.0))
            raise SettingError(
                f"a misfit is a number >= 0 or inf, row {row} has {misfit[row]}; "
                "mark a failed simulation with inf"
            )
        return np.where(misfit >= self.threshold, math.inf, misfit)

    def member_misfits(self, misfit: AnyNumbers) -> Floats:
        """Accepted misfits of all members, shape (n_running, n_population), `inf` for those not simulated."""
        members = np.full(self.known.shape, math.inf)
        members[self.changed] = self.accept_misfits(misfit)
        return members


Dimension = Annotated[int, Within(least=1, most=10_000)]
Replicate = Annotated[int, Within(least=0, most=2**63 - 1)]
ScalarT = TypeVar("ScalarT", bound=np.generic)


@array_dataclass(repr=False)
class Trace(Summarised):
    """Progress, one entry per generation, each of shape (n_replicates, n_generations).

    Number of `evaluations` so far, `best` misfit so far, `median` misfit of the population (`inf` while half of it
    fails). The last entries of a replicate that has ended are repeated.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng).course.trace"

    evaluations: NDArray[np.int64]
    best: Floats
    median: Floats


@array_dataclass(repr=False)
class Course(Summarised):
    """Progress of `n` replicates, the part of the state that all optimisers share.

    `replicate` (n,) are the numbers of the replicates, which determine their random numbers together with the seed
    `rng`. `generation` (n,) and `evaluations` (n,) are counts so far. `ended` (n,) is the code of the rule that ended a
    replicate, 0 while it runs. `best_unit` (n, n_params) has `best_misfit` (n,), `inf` while every simulation has
    failed. `elite_unit` (n, n_elite, n_params) are the best mutually distant points of the whole run with
    `elite_misfit` (n, n_elite), best first, padded with zeros of misfit `inf`.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng).course"

    rng: int
    replicate: NDArray[np.int64]
    generation: NDArray[np.int64]
    evaluations: NDArray[np.int64]
    ended: NDArray[np.int8]
    best_unit: Floats
    best_misfit: Floats
    elite_unit: Floats
    elite_misfit: Floats
    trace: Trace

    @classmethod
    @checked
    def begin(
        cls, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate], elite: EliteRule
    ) -> Course:
        """Progress before the first simulation."""
        number = np.asarray(replicates, dtype=np.int64)
        n = number.size
        if n < 1 or np.unique(number).size < n:
            raise SettingError(
                f"`replicates` are different whole numbers >= 0, at least one, got {list(replicates)}"
            )
        return cls(
            rng=rng,
            replicate=number,
            generation=np.zeros(n, np.int64),
            evaluations=np.zeros(n, np.int64),
            ended=np.zeros(n, np.int8),
            best_unit=np.zeros((n, n_params)),
            best_misfit=np.full(n, math.inf),
            elite_unit=np.zeros((n, elite.count, n_params)),
            elite_misfit=np.full((n, elite.count), math.inf),
            trace=Trace(
                evaluations=np.empty((n, 0), np.int64), best=np.empty((n, 0)), median=np.empty((n, 0))
            ),
        )

    @property
    def running(self) -> NDArray[np.int64]:
        """Rows of the replicates that have not ended, shape (n_running,)."""
        return np.flatnonzero(self.ended == 0)

    @property
    def is_first(self) -> bool:
        """Whether the first generation has not been simulated yet."""
        return bool(self.trace.best.shape[1] == 0)

    @property
    def stop_reasons(self) -> tuple[str | None, ...]:
        """The rule that ended each replicate, `None` while it runs."""
        return tuple(REASONS[code] for code in self.ended)

    @property
    def streams(self) -> Streams:
        """Random numbers of the next generation of the running replicates."""
        rows = self.running
        return Streams(rng=self.rng, replicate=self.replicate[rows], generation=self.generation[rows])

    def after(
        self,
        proposal: Proposal,
        simulated: AnyNumbers,
        *,
        population: Floats,
        misfit: AnyNumbers,
        elite: EliteRule,
        stop: StopRules,
    ) -> Course:
        """Progress after one more generation of the running replicates.

        `simulated` are the `Proposal.member_misfits`; population and misfit are the resulting generation, shapes
        (n_running, n_population, n_params) and (n_running, n_population).
        """
        rows = self.running
        among = np.arange(rows.size)
        leader = np.argmin(misfit, axis=1)
        least = misfit[among, leader]
        # A strict inequality keeps the first of equal points. The first generation has a best even where all failed.
        better = (least < self.best_misfit[rows]) | (self.generation[rows] == 0)
        best_misfit = np.where(better, least, self.best_misfit[rows])
        best_unit = np.where(better[:, None], population[among, leader], self.best_unit[rows])
        found_unit = np.concatenate([self.elite_unit[rows], proposal.population], axis=1)
        found_misfit = np.concatenate([self.elite_misfit[rows], simulated], axis=1)
        kept = distinct_best(found_unit, found_misfit, elite)
        evaluations = self.evaluations[rows] + np.count_nonzero(proposal.changed, axis=1)
        grown = replace(
            self,
            generation=with_rows(self.generation, rows, self.generation[rows] + 1),
            evaluations=with_rows(self.evaluations, rows, evaluations),
            best_unit=with_rows(self.best_unit, rows, best_unit),
            best_misfit=with_rows(self.best_misfit, rows, best_misfit),
            elite_unit=with_rows(
                self.elite_unit, rows, np.where(kept[..., None] < 0, 0.0, found_unit[among[:, None], kept])
            ),
            elite_misfit=with_rows(
                self.elite_misfit, rows, np.where(kept < 0, math.inf, found_misfit[among[:, None], kept])
            ),
            trace=Trace(
                evaluations=_extend_trace(self.trace.evaluations, rows, evaluations),
                best=_extend_trace(self.trace.best, rows, best_misfit),
                median=_extend_trace(self.trace.median, rows, np.median(misfit, axis=1)),
            ),
        )
        ended = stop.ended(
            trace=grown.trace.best[rows], evaluations=evaluations, population=population, best_unit=best_unit
        )
        return replace(grown, ended=with_rows(self.ended, rows, ended))


def with_rows(old: NDArray[ScalarT], rows: NDArray[np.int64], new: NDArray[ScalarT]) -> NDArray[ScalarT]:
    """A copy of `old` with these rows replaced."""
    if rows.size == len(old):
        return new
    copy = old.copy()
    copy[rows] = new
    return copy


def _extend_trace(
    old: NDArray[ScalarT], rows: NDArray[np.int64], entry: NDArray[ScalarT]
) -> NDArray[ScalarT]:
    """A trace with one more column; rows that are not in `rows` repeat their last entry."""
    grown = np.concatenate([old, old[:, -1:]], axis=1) if old.shape[1] else np.empty((len(old), 1), old.dtype)
    grown[rows, -1] = entry
    return grown


@runtime_checkable
class SearchState(Protocol):
    """The part of an optimiser's state that the loop reads.

    A state is a frozen dataclass whose fields are a `Course` and arrays with a leading axis of replicates; `select`
    works on all such states.
    """

    @property
    def course(self) -> Course:
        """Progress of each replicate."""

    @property
    def population(self) -> Floats:
        """Current candidates, shape (n_replicates, n_population, n_params), in the unit cube."""

    @property
    def misfit(self) -> Floats:
        """Their misfits, shape (n_replicates, n_population); `inf` for failures, and before the first generation."""


T = TypeVar("T")
StateT = TypeVar("StateT", bound=SearchState)


def select(state: StateT, rows: Sequence[int]) -> StateT:
    """The state of these replicates only, in this order; traces have the length of the longest of them."""
    if not isinstance(getattr(state, "course", None), Course):
        raise ArgumentError(
            "`state` of select is no state of a search; give one from `optimiser.start` or a result"
        )
    n_replicates = len(state.course.replicate)
    if not all(-n_replicates <= row < n_replicates for row in rows):
        raise SettingError(
            f"`rows` are {list(rows)}; the state has {n_replicates} replicates, counted from 0"
        )
    index = np.asarray(rows, dtype=np.int64)

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[index]
        if isinstance(value, tuple):
            return tuple(value[row] for row in index)
        return _with_parts(value, part) if dataclasses.is_dataclass(value) else value

    chosen = _with_parts(state, part)
    n_generations = int(chosen.course.generation.max(initial=0))
    trace = _with_parts(chosen.course.trace, lambda entries: entries[:, :n_generations])
    return replace(chosen, course=replace(chosen.course, trace=trace))  # type: ignore[type-var] # a state is a dataclass


def _with_parts(value: T, change: Callable[[Any], Any]) -> T:
    """A dataclass with `change` applied to each field."""
    names = [field.name for field in dataclasses.fields(value)]  # type: ignore[arg-type] # T is a dataclass
    changed = {name: change(getattr(value, name)) for name in names}
    return dataclasses.replace(value, **changed)  # type: ignore[type-var] # T is a dataclass


@array_dataclass(repr=False)
class PopulationState(Summarised):
    """A population and its misfits, (n_replicates, n_population, n_params) and (n_replicates, n_population).

    They are the last simulated generation, or the initial one with misfit `inf` at generation 0.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng)"

    course: Course
    population: Floats
    misfit: Floats

    @classmethod
    @checked
    def begin(cls, course: Course, population: Floats) -> PopulationState:
        """State before the first simulation."""
        return cls(course=course, population=population, misfit=np.full(population.shape[:2], math.inf))


def propose(
    course: Course,
    population: Floats,
    *,
    known: Floats | None = None,
    changed: NDArray[np.bool_] | None = None,
    limit: Floats | float = math.inf,
) -> Proposal:
    """Proposal of this population for the running replicates.

    Only `changed` members are simulated, by default all; the misfits of the others are `known`. Misfits at or above
    `limit`, a number or an array (n_running, 1) or (n_running, n_population), count as failures.
    """
    shape = population.shape[:2]
    changed = np.ones(shape, np.bool_) if changed is None else changed
    return Proposal(
        number=course.replicate[course.running],
        population=population,
        known=np.full(shape, math.inf) if known is None else np.where(changed, math.inf, known),
        changed=changed,
        limit=np.broadcast_to(limit, shape),
    )


def with_generation(
    state: StateT, proposal: Proposal, misfit: Floats, *, elite: EliteRule, stop: StopRules
) -> StateT:
    """State after a generation that replaces the old population; `misfit` (n_ask,) is that of `Proposal.unit`."""
    simulated = proposal.member_misfits(misfit)
    after = np.where(proposal.changed, simulated, proposal.known)
    return _replace_population(state, proposal, simulated, proposal.population, after, elite, stop)


def with_better_members(
    state: StateT, proposal: Proposal, misfit: Floats, *, elite: EliteRule, stop: StopRules
) -> StateT:
    """State after a generation in which each proposed member replaces the old one if it is better."""
    rows = state.course.running
    simulated = proposal.member_misfits(misfit)
    better = simulated < state.misfit[rows]
    population = np.where(better[..., None], proposal.population, state.population[rows])
    after = np.where(better, simulated, state.misfit[rows])
    return _replace_population(state, proposal, simulated, population, after, elite, stop)


def _replace_population(
    state: StateT,
    proposal: Proposal,
    simulated: Floats,
    population: Floats,
    misfit: Floats,
    elite: EliteRule,
    stop: StopRules,
) -> StateT:
    """State in which the running replicates have this population with these misfits; other fields are the same."""
    rows = state.course.running
    return replace(  # type: ignore[type-var] # a state is a dataclass
        state,
        course=state.course.after(
            proposal, simulated, population=population, misfit=misfit, elite=elite, stop=stop
        ),
        population=with_rows(state.population, rows, population),
        misfit=with_rows(state.misfit, rows, misfit),
    )


def relative_fitness(misfit: Floats) -> Floats:
    """`F = (e_max - e)/(e_max - e_min)` in each population, shape (n_replicates, n_population).

    The extremes are those of the simulations that succeeded. Failures have fitness 0; where all errors are equal, all
    have fitness 0.
    """
    succeeded = np.isfinite(misfit)
    best = np.min(misfit, axis=1, keepdims=True)
    worst = np.max(np.where(succeeded, misfit, -math.inf), axis=1, keepdims=True)
    varied = succeeded & (worst > best)
    above = np.where(varied, worst, 0.0) - np.where(varied, misfit, 0.0)
    span = np.where(varied, worst, 1.0) - np.where(varied, best, 0.0)
    return np.asarray(above / span)


@checked
class Ceiling:
    """Misfit at or above which a chromosome counts as failed; the lower of the two limits applies, `None` is no limit.

    In a genetic algorithm the rank of every misfit matters, so a simulation that stops early would change later
    generations. With a ceiling, misfits above it have no rank, so that the result does not depend on early stopping.

    On 2000 samples of a measured test (10 mm, 1 Hz, 0.5 A), with the non-symmetric Bouc-Wen model, 8 free parameters
    and 24 replicates of 120 generations of the efficient algorithm; the share of steps is estimated, assuming that the
    squared error grows evenly in time:

    =========================  ===========  ==================  ============  ==========
    ceiling                    simulations  median best misfit  below 0.1     steps done
    =========================  ===========  ==================  ============  ==========
    none                       4252         0.0785              0.79          1.00
    1                          4539         0.0742              0.88          0.92
    1 and 3 times the median   5248         0.0666              0.96          0.75
    1 and 2 times              5272         0.0678              0.92          0.73
    1 and 1.5 times            5319         0.0673              0.88          0.71
    1 and 1 times              5427         0.0673              0.88          0.66
    =========================  ===========  ==================  ============  ==========

    None of the ceilings reduced the quality (the difference between 0.79 and 0.96 of 24 is little more than chance).
    Failures mutate, so more chromosomes change and are simulated, yet the number of steps decreases.

    Parameters
    ----------
    absolute
        A misfit. The natural value for an NRMSE is 1, the misfit of a constant force.
    over_median
        A multiple, at least 1, of the median misfit of the previous generation.
    """

    absolute: NotNegative | None = None
    over_median: Annotated[float, Within(least=1.0)] | None = None

    def limit(self, course: Course) -> Floats:
        """The ceiling of each running replicate, shape (n_running, 1); `inf` where there is none."""
        rows = course.running
        limit = np.full((rows.size, 1), math.inf if self.absolute is None else self.absolute)
        if self.over_median is None or course.is_first:
            return limit
        return np.asarray(np.minimum(limit, self.over_median * course.trace.median[rows, -1:]))
