"""The interface of optimisers, and the state of a search: progress, population, proposal of a generation."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Seed
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.search.rules import EliteRule, StopRules, distinct_best
from mrwork.search.unit_cube import Streams, latin_hypercube

Dimension = Annotated[int, Within(least=1, most=10_000)]


@array_dataclass(repr=False)
class Proposal(Summarised):
    """One generation, `population` (n_population, n_params), to be simulated in one call.

    Only the `changed` members (n_population,) are simulated; the misfits of the others are `known` (n_population,).
    """

    _made_by: ClassVar[str] = "optimiser.ask(state)"

    population: Floats
    known: Floats
    changed: NDArray[np.bool_]

    @classmethod
    def of(cls, population: Floats) -> Proposal:
        """The proposal in which every member is simulated."""
        size = len(population)
        return cls(population=population, known=np.full(size, math.inf), changed=np.ones(size, np.bool_))

    @property
    def unit(self) -> Floats:
        """Candidates to simulate, shape (n_ask, n_params)."""
        return self.population[self.changed]

    def check(self, misfit: AnyNumbers) -> Floats:
        """Misfits of the candidates, shape (n_ask,), one of each and none that is NaN or negative."""
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
        return misfit


@array_dataclass(repr=False)
class Trace(Summarised):
    """Progress, one entry per generation, each of shape (n_generations,).

    `evaluations` and `best` misfit so far, `median` misfit of the population, `inf` while half of it fails.
    """

    evaluations: NDArray[np.int64]
    best: Floats
    median: Floats


@array_dataclass(repr=False)
class Course(Summarised):
    """Progress of a search, the part of the state that all optimisers share.

    The seed `rng` and the generation determine the random numbers. `stop_reason` is the rule that ended the search,
    empty while it runs. `best_unit` (n_params,) has `best_misfit`, `inf` while every simulation has failed. `elite`
    (n_elite, n_params) are the best mutually distant points of the whole run with `elite_misfit` (n_elite,), best
    first, none while every simulation has failed.
    """

    rng: int
    stop_reason: str
    best_unit: Floats
    best_misfit: float
    elite: Floats
    elite_misfit: Floats
    trace: Trace

    @property
    def running(self) -> bool:
        """Whether no rule has ended the search."""
        return not self.stop_reason

    @property
    def generation(self) -> int:
        """Number of generations so far."""
        return self.trace.best.size

    @property
    def evaluations(self) -> int:
        """Number of simulations so far."""
        return int(self.trace.evaluations[-1]) if self.generation else 0

    @property
    def streams(self) -> Streams:
        """Random numbers of the next generation."""
        return Streams(rng=self.rng, generation=self.generation)


@array_dataclass(repr=False)
class State(Summarised):
    """State of a search: its progress, its population, and what else the optimiser needs, `extra`.

    `population` (n_population, n_params) with `misfit` (n_population,) is the last generation, of a swarm and of
    differential evolution the best of each member; at generation 0 the initial one with misfit `inf`.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng)"

    course: Course
    population: Floats
    misfit: Floats
    extra: Any = None

    @classmethod
    def sampled(cls, n_params: int, rng: int, size: int) -> State:
        """State before the first simulation, with Latin hypercube samples of the unit cube."""
        course = Course(
            rng=rng,
            stop_reason="",
            best_unit=np.zeros(n_params),
            best_misfit=math.inf,
            elite=np.empty((0, n_params)),
            elite_misfit=np.empty(0),
            trace=Trace(evaluations=np.empty(0, np.int64), best=np.empty(0), median=np.empty(0)),
        )
        return cls(
            course=course,
            population=latin_hypercube(course.streams, size, n_params),
            misfit=np.full(size, math.inf),
        )

    def with_generation(self, proposal: Proposal, misfit: Floats, optimiser: Optimiser) -> State:
        """State after a generation that replaces the old population; `misfit` (n_ask,) belongs to `Proposal.unit`."""
        simulated = proposal.check(misfit)
        members = proposal.known.copy()
        members[proposal.changed] = simulated
        points = (proposal.unit, simulated)
        return self._after(points, simulated.size, proposal.population, members, optimiser)

    def with_better_members(self, proposal: Proposal, misfit: Floats, optimiser: Optimiser) -> State:
        """State after a generation in which each member, all of them simulated, replaces the old one if better."""
        simulated = proposal.check(misfit)
        better = simulated < self.misfit
        points = (proposal.population[better], simulated[better])
        population = np.where(better[:, None], proposal.population, self.population)
        members = np.where(better, simulated, self.misfit)
        return self._after(points, simulated.size, population, members, optimiser)

    def _after(
        self,
        points: tuple[Floats, Floats],
        n_simulated: int,
        population: Floats,
        misfit: Floats,
        optimiser: Optimiser,
    ) -> State:
        """State with this population, after so many simulations; `points` with misfits may join the elite."""
        course, trace = self.course, self.course.trace
        leader = np.argmin(misfit)
        best_unit, best_misfit = course.best_unit, course.best_misfit
        # A strict inequality keeps the first of equal points. The first generation has a best even where all failed.
        if misfit[leader] < best_misfit or not course.generation:
            best_unit, best_misfit = population[leader], float(misfit[leader])
        elite = np.concatenate([course.elite, points[0]])
        elite_misfit = np.concatenate([course.elite_misfit, points[1]])
        indices = distinct_best(elite, elite_misfit, optimiser.elite)
        evaluations = course.evaluations + n_simulated
        trace = Trace(
            evaluations=np.append(trace.evaluations, evaluations),
            best=np.append(trace.best, best_misfit),
            median=np.append(trace.median, np.median(misfit)),
        )
        course = replace(
            course,
            best_unit=best_unit,
            best_misfit=best_misfit,
            elite=elite[indices],
            elite_misfit=elite_misfit[indices],
            trace=trace,
            stop_reason=optimiser.stop.ended(
                trace=trace.best, evaluations=evaluations, population=population, best_unit=best_unit
            ),
        )
        return replace(self, course=course, population=population, misfit=misfit)


@runtime_checkable
class Optimiser(Protocol):
    """Settings of a derivative-free minimiser on the unit cube; all progress is in its states.

    The settings are a dataclass. A search that is resumed from a stored state gives the same result as one without
    interruption; of another library, as far as the library allows it.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def name(self) -> str:
        """Name in records of fits, by which a registered search is read back."""

    @property
    def population(self) -> int:
        """Number of candidates of a generation."""

    @property
    def stop(self) -> StopRules:
        """The rules by which a search ends."""

    @property
    def elite(self) -> EliteRule:
        """Which points of the run are kept as starts of a local minimisation."""

    def start(self, n_params: Dimension, rng: Seed) -> State:
        """Initial state, before the first simulation."""

    def ask(self, state: State) -> Proposal:
        """Candidates of the next generation."""

    def tell(self, state: State, proposal: Proposal, misfit: Floats) -> State:
        """State after the misfits of the proposal's candidates, shape (n_ask,); `inf` marks a failed simulation."""
