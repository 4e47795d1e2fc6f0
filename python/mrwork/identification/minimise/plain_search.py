"""Starting points of a plain model: by a multistart search on excerpts of the tests, or by an optimiser."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.values import Floats
from mrwork.identification.equivalent import search_box
from mrwork.identification.excerpts import excerpt
from mrwork.identification.fit import SearchTrace
from mrwork.identification.minimise.friction import examine_limit, friction_warning
from mrwork.identification.minimise.multistart import EXCERPTS, distinct_minima, search_starts
from mrwork.identification.minimise.nested import doubts_about, nested_fit, part_of
from mrwork.identification.minimise.starting_points import StartingPoints, no_simulation
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Found, Identifying
from mrwork.identification.settings import Multistart
from mrwork.identification.suspicious import LINEAR_SHARE, linear_misfit

if TYPE_CHECKING:
    from mrwork.search import Optimiser, SearchResult

# Largest number of starting points of an optimiser.
_STARTS = 16


def points_from_multistart(problem: Problem, search: Multistart, *, call: Identifying) -> StartingPoints:
    """The best minima of a multistart search among candidates below the limit of stiffness.

    There is no limit where no candidate is below it, or where stiffer ones describe the tests measurably better.
    """
    # The loops of a few cycles are sufficient to find the minima; the final fit compares all samples.
    excerpts = tuple(excerpt(test) for test in problem.objective.tests)
    objective = problem.objective.on(problem.form.spec, excerpts)
    for limited in (up_to(objective, friction_limit(problem.objective.tests)), objective):
        points = _search_points(problem, limited, search, call)
        if points is not None:
            return points
    raise no_simulation(problem.form.spec, objective.tally.simulations)


def _search_points(
    problem: Problem, objective: Objective, search: Multistart, call: Identifying
) -> StartingPoints | None:
    """The best minima that a multistart search finds on the excerpts of `objective`, if there are any."""
    form, rng = problem.form, problem.settings.rng

    def on_nested(simpler: str, state: Found) -> None:
        call.on_search(f"{simpler} on {EXCERPTS}", state)

    nested = nested_fit(objective, form.box, search, rng=rng, on_search=part_of(on_nested, 0.0, 0.5))
    minima = search_starts(
        objective,
        form.box,
        search_box(form.spec, form.box, objective.tests),
        search,
        rng=rng,
        mirrored=form.mirrored,
        nested=None if nested is None else nested.starts,
        suspicious=min(
            math.inf if nested is None else nested.misfit, LINEAR_SHARE * linear_misfit(objective.tests)
        ),
        on_search=partial(part_of(call.on_search, 0.5, 0.5), EXCERPTS),
    )
    if not len(minima.theta):
        return None
    theta = distinct_minima(form.box, minima.theta, minima.misfit)
    call.so_far = lambda: (minima.theta[0], minima.trace)
    objective, theta = examine_limit(objective, form, theta)
    return StartingPoints(
        objective=objective,
        form=form,
        theta=theta,
        trace=minima.trace,
        minima=True,
        warnings=(*doubts_about(minima, nested, search), *friction_warning(objective, form, theta, nested)),
    )


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
