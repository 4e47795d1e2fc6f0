"""NSGA-II of the library `pymoo`: several objectives at once, asked and told; install it with the extra `peers`.

Deb, Pratap, Agarwal & Meyarivan, IEEE Trans. Evol. Comput. 6(2), 2002, 182-197; Blank & Deb, IEEE Access 8, 2020,
89497-89509.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.search.peers import library
from mrwork.store import Journal, digest_of
from mrwork.summary import Summarised
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]
SeveralObjectives = Callable[[Floats], Floats]
"""Maps points of the unit cube, shape (m, n_params), to objectives, shape (m, n_objectives); `inf` marks a failure."""

# The library compares finite numbers only.
_FAILURE = 1e100


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FrontResult(Summarised):
    """Points of which no other simulated one is lower in every objective, and the number of candidates.

    `units` (n, n_params) with `objectives` (n, n_objectives), ordered by the first objective.
    """

    units: Floats
    objectives: Floats
    evaluations: int


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class _Generation:
    objectives: Floats


def run_front(
    objectives: SeveralObjectives,
    *,
    n_params: int,
    n_objectives: int,
    population: int,
    budget: int,
    rng: int,
    starts: Floats,
    journal: Journal | None = None,
    on_generation: Callable[[int], bool | None] = lambda evaluations: None,
) -> FrontResult:
    """Search a Pareto front by NSGA-II; the starts are among the first generation.

    Parameters
    ----------
    population, budget
        Candidates of a generation, and the most of all.
    starts
        Shape (n_starts, n_params); at most half a generation is used.
    journal
        Records every generation, and recalls those of a search that was interrupted.
    on_generation
        Called with the number of candidates after every generation; where it returns true the search ends.
    """
    problem = library("pymoo.core.problem").Problem(n_var=n_params, n_obj=n_objectives, xl=0.0, xu=1.0)
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
    units, values = np.empty((0, n_params)), np.empty((0, n_objectives))
    while len(units) + population <= max(budget, population):
        asked = algorithm.ask()
        points = np.clip(np.asarray(asked.get("X"), dtype=np.float64), 0.0, 1.0)
        found = _simulate_points(objectives, points, journal)
        evaluator.eval(static(problem, F=np.where(np.isfinite(found), found, _FAILURE)), asked)
        algorithm.tell(infills=asked)
        units, values = np.vstack([units, points]), np.vstack([values, found])
        if on_generation(len(units)):
            break
    first = nondominated(values)
    order = first[np.lexsort(values[first].T[::-1])]
    return FrontResult(units=units[order], objectives=values[order], evaluations=len(units))


def _simulate_points(objectives: SeveralObjectives, points: Floats, journal: Journal | None) -> Floats:
    if journal is None:
        return objectives(points)
    recorded = journal.once(
        "front generation", digest_of(points), _Generation, lambda: _Generation(objectives=objectives(points))
    )
    return recorded.objectives


def nondominated(values: Floats) -> NDArray[np.int64]:
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
