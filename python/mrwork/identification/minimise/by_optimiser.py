"""Searches by an optimiser of the registry, and their starting points for a plain model."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.values import Floats
from mrwork.identification.equivalent import search_box
from mrwork.identification.fit import SearchTrace
from mrwork.identification.minimise.starting_points import StartingPoints, no_simulation
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Found, Identifying
from mrwork.search import Optimiser

if TYPE_CHECKING:
    from mrwork.search import Optimiser, SearchResult

# Largest number of starting points.
_STARTS = 16


def points_from_optimiser(problem: Problem, search: Optimiser, *, call: Identifying) -> StartingPoints:
    """The elite of an optimiser (its best points that are far apart), for a model without current laws."""
    objective, form = problem.objective, problem.form
    box = search_box(form.spec, form.box, objective.tests)

    elite = optimise(
        search,
        objective,
        box.theta_from_unit,
        n_params=len(box.free),
        rng=problem.settings.rng,
        on_search=partial(call.on_search, ""),
    )
    return StartingPoints(
        objective=objective,
        form=form,
        theta=np.asarray(box.theta_from_unit(elite.elite[:_STARTS])),
        trace=trace_of_generations(elite),
    )


def optimise(
    search: Optimiser,
    objective: Objective,
    theta_of: Callable[[Floats], Floats],
    *,
    n_params: int,
    rng: int,
    on_search: Callable[[Found], None],
) -> SearchResult:
    """Minimum of the objective over unit vectors, mapped to parameters by `theta_of`, as the search result."""
    from mrwork.search import run_search

    def on_generation(so_far: SearchResult) -> None:
        if not math.isfinite(so_far.best_misfit):
            return
        on_search(
            Found(
                best=lambda: theta_of(so_far.best_unit[None])[0],
                trace=trace_of_generations(so_far),
                iteration=so_far.generations,
                misfit=so_far.best_misfit,
                median=float(so_far.trace.median[-1]),
                share=so_far.generations / search.stop.max_generations,
            )
        )

    result = run_search(
        search,
        lambda unit: objective(theta_of(unit)),
        rng=rng,
        n_params=n_params,
        on_generation=on_generation,
        journal=objective.journal,
    )
    if not len(result.elite):
        raise no_simulation(objective.spec, result.evaluations)
    return result


def trace_of_generations(search: SearchResult) -> SearchTrace:
    """Trace of an optimiser, an entry for each generation."""
    return SearchTrace(
        evaluations=tuple(int(count) for count in search.trace.evaluations),
        best=tuple(float(value) for value in search.trace.best),
        median=tuple(float(value) for value in search.trace.median),
        stop_reason=search.stop_reason,
    )
