"""Starting points of a plain model by a multistart search on excerpts of the tests."""

from __future__ import annotations

import math
from functools import partial

from mrwork.identification.equivalent import search_box
from mrwork.identification.minimise.friction import examine_limit, friction_warning
from mrwork.identification.minimise.multistart import EXCERPTS, distinct_minima, search_starts, trace_of
from mrwork.identification.minimise.nested import doubts_about, nested_fit, part_of
from mrwork.identification.minimise.starting_points import StartingPoints, no_simulation
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Found, Identifying
from mrwork.identification.settings import Multistart
from mrwork.identification.suspicious import LINEAR_SHARE, linear_misfit
from mrwork.records.window import excerpt


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
    """The best minima that a multistart search finds on the excerpts of `objective`; `None` where there are none."""
    form, rng = problem.form, problem.settings.rng

    def on_nested(simpler: str, found: Found) -> None:
        call.on_search(f"{simpler} on {EXCERPTS}", found)

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
    call.so_far = lambda: (minima.theta[0], trace_of(minima))
    objective, theta = examine_limit(objective, form, theta)
    return StartingPoints(
        objective=objective,
        form=form,
        theta=theta,
        trace=trace_of(minima),
        minima=True,
        warnings=(*doubts_about(minima, nested, search), *friction_warning(objective, form, theta, nested)),
    )
