"""Every search by name with its default settings, and the searches of libraries that come with the extra `peers`.

The latter are CMA-ES of `cma`, asked and told, and fronts by NSGA-II of pymoo. `cma` keeps its progress in an object
that `tell` changes. `tell` can therefore be called only once for a state of such a search; to continue from an earlier
state, start again and tell the same misfits, which a journal has recorded.

Apart from the loop, because `identify` imports all searches only where one is named.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from functools import partial
from types import ModuleType
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Seed, Within, checked
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.search.course import Dimension, Optimiser, Proposal, State
from mrwork.search.evolution import DifferentialEvolution, EfficientGA, StandardGA
from mrwork.search.particle_swarm import CONSTRICTION, ParticleSwarm
from mrwork.search.rules import LARGEST_POPULATION, Elite, EliteRule, SearchName, Stop, StopRules
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall

# Misfit of a failed simulation for a library that needs finite numbers, above any misfit.
_FAILURE = 1e100


def library(name: str) -> ModuleType:
    """Import a module of an optional library; refused with the command that installs the library."""
    try:
        return importlib.import_module(name)
    except (ImportError, ValueError) as error:
        raise SettingError(
            f"{name.partition('.')[0]} is not installed; install it with: pip install 'mrwork[peers]'"
        ) from error


@checked
class CMAEvolution:
    """CMA-ES of the library `cma` (Hansen & Ostermeier, Evol. Comput. 9, 2001, 159-195).

    A population of 10 is the library's default for 8 parameters. `deviation` is the initial standard deviation of each
    gene, a share of the box; the search begins at the point `begin` of the unit cube, the middle by default. The
    `extra` of its states is the object of the library and the candidates that it has been asked for.
    """

    name: SearchName = "cma"
    population: Annotated[int, Within(least=4, most=LARGEST_POPULATION)] = 10
    stop: Stop = field(default_factory=lambda: StopRules(max_generations=1000))
    elite: Elite = field(default_factory=EliteRule)
    deviation: Annotated[float, Within(least=1e-12, most=1.0)] = 0.3
    begin: tuple[float, ...] = ()

    def near(self, point: Floats, deviation: float) -> CMAEvolution:
        """The optimiser begun around a point, where most of its first candidates are inside the cube."""
        inside = np.clip(point, deviation, 1.0 - deviation)
        return replace(self, begin=tuple(inside.tolist()), deviation=deviation)

    def start(self, n_params: Dimension, rng: Seed) -> State:
        """Initial state; nothing is simulated yet."""
        state = State.sampled(n_params, rng, self.population)
        generator = np.random.default_rng(state.course.streams.library_seed())
        options = {
            "bounds": [0.0, 1.0],
            "popsize": self.population,
            "verbose": -9,
            # By default the library seeds and uses the global generator of NumPy.
            "seed": math.nan,
            "randn": lambda *shape: generator.standard_normal(shape),
        }
        first = self.begin or np.full(n_params, 0.5)
        strategy = library("cma").CMAEvolutionStrategy(first, self.deviation, options)
        asked = strategy.ask()
        return replace(state, population=np.clip(asked, 0.0, 1.0), extra=(strategy, asked))

    def ask(self, state: State) -> Proposal:
        """Candidates of the next generation."""
        return Proposal.of(np.clip(state.extra[1], 0.0, 1.0))

    def tell(self, state: State, proposal: Proposal, misfit: Floats) -> State:
        """State after the simulations of the proposal, `misfit` (n_ask,); the given state cannot be used again."""
        strategy, asked = state.extra
        if strategy.countiter != state.course.generation:
            raise SettingError(
                f"this state is of generation {state.course.generation}, its library is at generation "
                f"{strategy.countiter}; start again and tell the same misfits"
            )
        next_state = state.with_generation(proposal, misfit, self)
        strategy.tell(asked, np.where(np.isfinite(next_state.misfit), next_state.misfit, _FAILURE).tolist())
        return replace(next_state, extra=(strategy, strategy.ask()))


SeveralObjectives = Callable[[Floats], Floats]
"""Maps points of the unit cube, shape (m, n_params), to columns, shape (m, n_objectives + n_constraints).

The last columns are constraints g, which hold where g <= 0; `inf` marks a failure.
"""


@array_dataclass(repr=False)
class FrontResult(Summarised):
    """Points of which no other simulated one is lower in every objective, and the number of candidates.

    `units` (n, n_params) with `objectives` (n, n_objectives), ordered by the first objective, and `constraints` (n,
    n_constraints). They are of points that meet every constraint; where none does, of the point of least violation.
    """

    units: Floats
    objectives: Floats
    evaluations: int
    constraints: Floats


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
    on_generation: Callable[[int], None] = lambda evaluations: None,
) -> FrontResult:
    """Search a Pareto front by NSGA-II of pymoo within a budget of candidates; at most half a generation are starts.

    Deb, Pratap, Agarwal & Meyarivan, IEEE Trans. Evol. Comput. 6(2), 2002, 182-197; Blank & Deb, IEEE Access 8, 2020,
    89497-89509. Of two points, a point that meets the constraints comes first, then the smaller sum of
    violations (Deb's rules): constraints of different units want a common scale. The journal records every generation,
    and recalls the generations of a search that was interrupted. `on_generation` is called after every generation with
    the number of candidates.
    """
    problem = library("pymoo.core.problem").Problem(
        n_var=n_params, n_obj=n_objectives, n_ieq_constr=n_constraints, xl=0.0, xu=1.0
    )
    sampled = np.random.default_rng(rng).uniform(size=(population, n_params))
    used_starts = starts[: population // 2]
    sampled[: len(used_starts)] = used_starts
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
    call: LongCall[Any] = LongCall(journal=journal)
    while len(units) + population <= max(budget, population):
        asked = algorithm.ask()
        points = np.clip(np.asarray(asked.get("X"), dtype=np.float64), 0.0, 1.0)
        returned = call.array("front generation", partial(objectives, points), points)
        if returned.shape != (len(points), n_objectives + n_constraints):
            raise SettingError(
                f"the columns have the shape {returned.shape}; give ({len(points)}, {n_objectives + n_constraints}), "
                "objectives and then constraints"
            )
        columns = np.where(np.isfinite(returned), returned, _FAILURE)
        constrained = {"G": columns[:, n_objectives:]} if n_constraints else {}
        evaluator.eval(static(problem, F=columns[:, :n_objectives], **constrained), asked)
        algorithm.tell(infills=asked)
        units, values = np.vstack([units, points]), np.vstack([values, returned])
        on_generation(len(units))
    values, constraints = values[:, :n_objectives], values[:, n_objectives:]
    first = _select_feasible_front(values, constraints)
    order = first[np.lexsort(values[first].T[::-1])]
    return FrontResult(
        units=units[order], objectives=values[order], evaluations=len(units), constraints=constraints[order]
    )


def _select_feasible_front(values: Floats, constraints: Floats) -> NDArray[np.int64]:
    """Indices of the front of the points that meet the constraints, else of the point of least violation."""
    feasible = np.flatnonzero((constraints <= 0.0).all(axis=1))
    if feasible.size or not np.isfinite(values).all(axis=1).any():
        return feasible[select_nondominated(values[feasible])]
    violation = np.where(constraints > 0.0, constraints, 0.0).sum(axis=1)
    violation[~np.isfinite(values).all(axis=1)] = np.inf
    return np.array([np.argmin(violation)], dtype=np.int64)


def select_nondominated(values: Floats) -> NDArray[np.int64]:
    """Indices of the rows that no other row dominates, at most as large in every column and smaller in one.

    Of equal rows the first is kept; rows that are not finite are left out.
    """
    finite = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not finite.size:
        raise SettingError("no candidate has finite objectives; check the study with mrwork respond")
    front: list[int] = []
    # In this order a row that dominates another, or is the first of equal ones, comes before it.
    for index in finite[np.lexsort(values[finite].T[::-1])]:
        if not (values[front] <= values[index]).all(axis=1).any():
            front.append(int(index))
    return np.sort(np.array(front, dtype=np.int64))


OPTIMISERS: Mapping[str, Optimiser] = {
    optimiser.name: optimiser
    for optimiser in (
        StandardGA(),
        EfficientGA(),
        ParticleSwarm(),
        CONSTRICTION,
        DifferentialEvolution(),
        DifferentialEvolution(name="differential_evolution_random", base="random"),
    )
}
"""Searches of the package by name, with their default settings."""

PEERS: Mapping[str, CMAEvolution] = {optimiser.name: optimiser for optimiser in (CMAEvolution(),)}
"""Searches of other libraries by name; each library is imported when its search starts."""

ALL_OPTIMISERS: Mapping[str, Optimiser] = {**OPTIMISERS, **PEERS}
