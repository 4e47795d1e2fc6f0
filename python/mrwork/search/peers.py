"""Optimisers of other libraries, asked and told, and fronts by NSGA-II; install them with the extra `peers`.

A library keeps its progress in an object that `tell` changes. `tell` can therefore be called only once for a state of
such a search; to continue from an earlier state, start again and tell the same misfits, which a journal has recorded.
Otherwise the contract of `Optimiser` applies: each replicate is an independent search with its own seed.
"""

from __future__ import annotations

import importlib
import math
import threading
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from queue import SimpleQueue
from types import ModuleType
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Seed
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.search.course import Course, Dimension, Proposal, Replicate, propose, with_generation
from mrwork.search.rules import LARGEST_POPULATION, EliteRule, StopRules, check_ranges
from mrwork.search.unit_cube import latin_hypercube
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal

# Misfit of a failed simulation for a library that needs finite numbers, above any misfit.
_FAILURE = 1e100


def library(name: str) -> ModuleType:
    """Import a module of an optional library."""
    try:
        return importlib.import_module(name)
    except (ImportError, ValueError) as error:
        raise SettingError(
            f"{name.partition('.')[0]} is not installed; install it with: pip install 'mrwork[peers]'"
        ) from error


class Peer(Protocol):
    """One replicate of a search by another library."""

    def ask(self) -> Floats:
        """Candidates, shape (n_ask, n_params); at most the population size of the settings."""

    def tell(self, misfit: Floats) -> None:
        """Take the misfits of the candidates, shape (n_ask,), all finite."""


class PeerSearch:
    """A peer with its pending candidates, whose misfits have not been told yet."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._generation = 0
        self._pending: Floats | None = None

    def ask(self, generation: int) -> Floats:
        """Candidates of this generation, the same in every call."""
        self._check(generation)
        if self._pending is None:
            self._pending = np.clip(self._peer.ask(), 0.0, 1.0)
        return self._pending

    def tell(self, generation: int, misfit: Floats) -> None:
        """Take the misfits of all candidates of this generation, shape (n_ask,)."""
        self._check(generation)
        self._peer.tell(np.where(np.isfinite(misfit), misfit, _FAILURE))
        self._generation, self._pending = generation + 1, None

    def _check(self, generation: int) -> None:
        if generation != self._generation:
            raise SettingError(
                f"this state is of generation {generation}, its library is at generation {self._generation}; "
                "start again and tell the same misfits"
            )


@array_dataclass()
class PeerState:
    """Searches of another library, one for each replicate.

    `population` (n_replicates, n_population, n_params) with `misfit` (n_replicates, n_population) is the last
    generation that was simulated.
    """

    course: Course
    population: Floats
    misfit: Floats
    searches: tuple[PeerSearch, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerOptimiser(ABC):
    """Ask/tell interface to another library; a subclass has the settings and starts one peer for each replicate.

    At most `population` candidates of a replicate are simulated in one generation. `elite` says which points of the run
    are kept as starts of a local minimisation.
    """

    least_population: ClassVar[int] = 4
    population: int
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    def __post_init__(self) -> None:
        check_ranges({"population": (self.population, self.least_population, LARGEST_POPULATION)})

    def near(self, point: Floats, deviation: float) -> PeerOptimiser:
        """The optimiser with its search begun around a point of the unit cube, if the library takes one."""
        return self

    @abstractmethod
    def _starter(self, course: Course, n_params: int) -> Callable[[int], Peer]:
        """Return the function that starts a peer from a seed; it is called once for each replicate, in order."""

    def start(self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)) -> PeerState:
        """Start one search for each replicate, each from its own seed; nothing is simulated yet."""
        course = Course.begin(n_params, rng, replicates, self.elite)
        starter = self._starter(course, n_params)
        shape = (len(course.replicate), self.population)
        return PeerState(
            course=course,
            population=np.zeros((*shape, n_params)),
            misfit=np.full(shape, math.inf),
            searches=tuple(PeerSearch(starter(int(seed))) for seed in course.streams.seeds()),
        )

    def ask(self, state: PeerState) -> Proposal:
        """Candidates of the running replicates; slots that a library leaves unused are not simulated."""
        course, rows = state.course, state.course.running
        population = state.population[rows].copy()
        changed = np.zeros(population.shape[:2], np.bool_)
        for index, row in enumerate(rows):
            candidates = state.searches[row].ask(int(course.generation[row]))
            population[index, : len(candidates)] = candidates
            changed[index, : len(candidates)] = True
        return propose(course, population, known=state.misfit[rows], changed=changed)

    def tell(self, state: PeerState, proposal: Proposal, misfit: Floats) -> PeerState:
        """State after the simulations of the proposal, `misfit` (n_ask,); the given state cannot be used again."""
        simulated = proposal.member_misfits(misfit)
        for index, row in enumerate(state.course.running):
            generation = int(state.course.generation[row])
            state.searches[row].tell(generation, simulated[index, proposal.changed[index]])
        return with_generation(state, proposal, misfit, elite=self.elite, stop=self.stop)


@dataclass(frozen=True, slots=True, kw_only=True)
class CMAEvolution(PeerOptimiser):
    """CMA-ES of the library `cma` (Hansen & Ostermeier, Evol. Comput. 9, 2001, 159-195).

    A population of 10 is the library's default for 8 parameters. `deviation` is the initial standard deviation of each
    gene, a share of the box; the search begins at the point `begin` of the unit cube, the middle by default.
    """

    population: int = 10
    deviation: float = 0.3
    begin: tuple[float, ...] = ()
    stop: StopRules = field(default_factory=lambda: StopRules(max_generations=1000))

    def __post_init__(self) -> None:
        PeerOptimiser.__post_init__(self)
        check_ranges({"deviation": (self.deviation, 1e-12, 1.0)})

    def near(self, point: Floats, deviation: float) -> CMAEvolution:
        """The optimiser begun around a point, where most of its first candidates are inside the cube."""
        inside = np.clip(point, deviation, 1.0 - deviation)
        return replace(self, begin=tuple(inside.tolist()), deviation=deviation)

    def _starter(self, course: Course, n_params: int) -> Callable[[int], Peer]:
        cma = library("cma")

        first = np.array(self.begin) if self.begin else np.full(n_params, 0.5)

        def start_peer(seed: int) -> Peer:
            generator = np.random.default_rng(seed)
            options = {
                "bounds": [0.0, 1.0],
                "popsize": self.population,
                "verbose": -9,
                # By default the library seeds and uses the global generator of NumPy.
                "seed": math.nan,
                "randn": lambda *shape: generator.standard_normal(shape),
            }
            return _CMAPeer(cma.CMAEvolutionStrategy(first, self.deviation, options))

        return start_peer


class _CMAPeer:
    def __init__(self, strategy: Any) -> None:
        self._strategy = strategy
        self._pending: list[Floats] = []

    def ask(self) -> Floats:
        self._pending = self._strategy.ask()
        return np.array(self._pending)

    def tell(self, misfit: Floats) -> None:
        self._strategy.tell(self._pending, misfit.tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class PymooGA(PeerOptimiser):
    """The genetic algorithm of the library `pymoo` (Blank & Deb, IEEE Access 8, 2020, 89497-89509), with its defaults.

    Simulated binary crossover, polynomial mutation, survival of the fittest.
    """

    population: int = 60

    def _starter(self, course: Course, n_params: int) -> Callable[[int], Peer]:
        problem = library("pymoo.core.problem").Problem(n_var=n_params, n_obj=1, xl=0.0, xu=1.0)
        termination = library("pymoo.core.termination").NoTermination
        genetic = library("pymoo.algorithms.soo.nonconvex.ga").GA

        def begin(seed: int) -> Peer:
            algorithm = genetic(pop_size=self.population)
            algorithm.setup(problem, termination=termination(), seed=seed, verbose=False)
            return _PymooPeer(algorithm)

        return begin


class _PymooPeer:
    def __init__(self, algorithm: Any) -> None:
        self._algorithm = algorithm
        self._pending: Any = None

    def ask(self) -> Floats:
        self._pending = self._algorithm.ask()
        return np.asarray(self._pending.get("X"), dtype=np.float64)

    def tell(self, misfit: Floats) -> None:
        problem = library("pymoo.problems.static").StaticProblem(self._algorithm.problem, F=misfit[:, None])
        library("pymoo.core.evaluator").Evaluator().eval(problem, self._pending)
        self._algorithm.tell(infills=self._pending)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScipyDifferentialEvolution(PeerOptimiser):
    """Differential evolution of SciPy: best1bin with deferred updating, otherwise with its defaults.

    A population of 120 is SciPy's default for 8 parameters.
    """

    least_population = 5
    population: int = 120

    def _starter(self, course: Course, n_params: int) -> Callable[[int], Peer]:
        populations = iter(latin_hypercube(course.streams, self.population, n_params))
        return lambda seed: _ScipyPeer(next(populations), seed)


class _ScipyPeer:
    """SciPy calls the objective, so it runs in a thread, where the objective waits for the misfits of a generation.

    The thread ends with the search, or when this object is garbage-collected.
    """

    def __init__(self, population: Floats, seed: int) -> None:
        self._candidates: SimpleQueue[Floats | Exception] = SimpleQueue()
        self._misfits: SimpleQueue[Floats | None] = SimpleQueue()
        arguments = (population, seed, self._candidates, self._misfits)
        threading.Thread(target=_evolve, args=arguments, daemon=True).start()
        weakref.finalize(self, self._misfits.put, None)

    def ask(self) -> Floats:
        candidates = self._candidates.get()
        if isinstance(candidates, Exception):
            raise candidates
        return candidates

    def tell(self, misfit: Floats) -> None:
        self._misfits.put(misfit)


class _AbandonedError(Exception):
    """The search was abandoned: there are no more misfits."""


def _evolve(
    population: Floats,
    seed: int,
    candidates: SimpleQueue[Floats | Exception],
    misfits: SimpleQueue[Floats | None],
) -> None:
    def objective(units: Floats) -> Floats:
        candidates.put(units.T.copy())
        answer = misfits.get()
        if answer is None:
            raise _AbandonedError
        return answer

    try:
        from scipy.optimize import Bounds, differential_evolution

        differential_evolution(
            objective,  # type: ignore[arg-type] # the stubs do not have vectorised objectives
            Bounds(np.zeros(population.shape[1]), np.ones(population.shape[1])),
            init=population,
            rng=np.random.default_rng(seed),
            vectorized=True,
            updating="deferred",
            polish=False,
            # Our stop rules end the search, not the tolerances of SciPy.
            tol=0.0,
            atol=-1.0,
            maxiter=10**9,
        )
    except _AbandonedError:
        pass
    except Exception as error:
        # Passed on to `ask`, which would otherwise wait for ever.
        candidates.put(error)


SeveralObjectives = Callable[[Floats], Floats]
"""Maps points of the unit cube, shape (m, n_params), to columns, shape (m, n_objectives + n_constraints).

The last columns are constraints g, which hold where g <= 0; `inf` marks a failure.
"""


@array_dataclass(repr=False)
class FrontResult(Summarised):
    """Points of which no other simulated one is lower in every objective, and the number of candidates.

    `units` (n, n_params) with `objectives` (n, n_objectives), ordered by the first objective, and `constraints` (n,
    n_constraints). They are of points that meet every constraint; where none does, of the one with the least violation.
    """

    units: Floats
    objectives: Floats
    evaluations: int
    constraints: Floats

    @property
    def feasible(self) -> bool:
        """Whether the points meet the constraints."""
        return bool((self.constraints <= 0.0).all())


@array_dataclass()
class _Generation:
    objectives: Floats


def run_front(
    objectives: SeveralObjectives,
    *,
    n_params: int,
    n_objectives: int,
    n_constraints: int = 0,
    population: int,
    budget: int,
    rng: int,
    starts: Floats,
    journal: Journal | None = None,
    on_generation: Callable[[int], bool | None] = lambda evaluations: None,
) -> FrontResult:
    """Search a Pareto front by NSGA-II of pymoo within a budget of candidates; at most half a generation are starts.

    Deb, Pratap, Agarwal & Meyarivan, IEEE Trans. Evol. Comput. 6(2), 2002, 182-197; Blank & Deb, IEEE Access 8, 2020,
    89497-89509. Of two points the one that meets the constraints comes first, then that with the smaller sum of
    violations (Deb's rules): constraints of different units want a common scale. The journal records every generation,
    and recalls those of a search that was interrupted. The search ends where `on_generation`, called with the number of
    candidates after every generation, returns true.
    """
    problem = library("pymoo.core.problem").Problem(
        n_var=n_params, n_obj=n_objectives, n_ieq_constr=n_constraints, xl=0.0, xu=1.0
    )
    sampled = np.random.default_rng(rng).uniform(size=(population, n_params))
    kept = starts[: population // 2]
    sampled[: len(kept)] = kept
    algorithm: Any = library("pymoo.algorithms.moo.nsga2").NSGA2(pop_size=population, sampling=sampled)
    algorithm.setup(
        problem,
        termination=library("pymoo.core.termination").NoTermination(),
        seed=rng % 2**31,
        verbose=False,
    )
    static = library("pymoo.problems.static").StaticProblem
    evaluator = library("pymoo.core.evaluator").Evaluator()
    units, values = np.empty((0, n_params)), np.empty((0, n_objectives + n_constraints))
    while len(units) + population <= max(budget, population):
        asked = algorithm.ask()
        points = np.clip(np.asarray(asked.get("X"), dtype=np.float64), 0.0, 1.0)
        found = _simulate_points(objectives, points, journal)
        if found.shape != (len(points), n_objectives + n_constraints):
            raise SettingError(
                f"the columns have the shape {found.shape}; give ({len(points)}, {n_objectives + n_constraints}), "
                "objectives and then constraints"
            )
        columns = np.where(np.isfinite(found), found, _FAILURE)
        constrained = {"G": columns[:, n_objectives:]} if n_constraints else {}
        evaluator.eval(static(problem, F=columns[:, :n_objectives], **constrained), asked)
        algorithm.tell(infills=asked)
        units, values = np.vstack([units, points]), np.vstack([values, found])
        if on_generation(len(units)):
            break
    values, constraints = values[:, :n_objectives], values[:, n_objectives:]
    first = _select_feasible_front(values, constraints)
    order = first[np.lexsort(values[first].T[::-1])]
    return FrontResult(
        units=units[order], objectives=values[order], evaluations=len(units), constraints=constraints[order]
    )


def _select_feasible_front(values: Floats, constraints: Floats) -> NDArray[np.int64]:
    """Indices of the front of the points that meet the constraints, else of the one with the least violation."""
    feasible = np.flatnonzero((constraints <= 0.0).all(axis=1))
    if feasible.size or not np.isfinite(values).all(axis=1).any():
        return feasible[select_nondominated(values[feasible])]
    violation = np.where(constraints > 0.0, constraints, 0.0).sum(axis=1)
    violation[~np.isfinite(values).all(axis=1)] = np.inf
    return np.array([np.argmin(violation)], dtype=np.int64)


def _simulate_points(objectives: SeveralObjectives, points: Floats, journal: Journal | None) -> Floats:
    if journal is None:
        return objectives(points)
    recorded = journal.once(
        "front generation", digest_of(points), _Generation, lambda: _Generation(objectives=objectives(points))
    )
    return recorded.objectives


def select_nondominated(values: Floats) -> NDArray[np.int64]:
    """Indices of the rows that no other row dominates, at most as large in every column and smaller in one.

    Of equal rows the first is kept; rows that are not finite are left out.
    """
    finite = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not finite.size:
        raise SettingError("no candidate has finite objectives; check the study with mrwork respond")
    kept: list[int] = []
    for index in finite:
        others = values[finite]
        no_worse = (others <= values[index]).all(axis=1)
        better = no_worse & (others < values[index]).any(axis=1)
        equal_before = no_worse & ~better & (finite < index)
        if not better.any() and not equal_before.any():
            kept.append(int(index))
    return np.array(kept, dtype=np.int64)
