"""Starting points of a plain model: by a multistart search on excerpts of the tests, or by an optimiser.

The search also starts near the fit of the simpler model that the searched one contains, if there is one. That fit has
the misfit to be reached: a minimum of the searched model that is above it is false.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.numbers import apart, with_decimals
from mrwork.base.values import Floats
from mrwork.dampers.conversions import NESTINGS
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import damper
from mrwork.identification.commands import excerpts_of
from mrwork.identification.equivalent import bounds_of, half_ranges, identifiable_form, search_box
from mrwork.identification.fit import SearchTrace
from mrwork.identification.minimise.friction import examine_limit, friction_warning
from mrwork.identification.minimise.multistart import (
    EXCERPTS,
    MultistartResult,
    NestedFit,
    distinct_minima,
    minima_from,
    report_minima,
    search_starts,
)
from mrwork.identification.minimise.polish import StartingPoints, no_simulation
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Found, Identifying, OnSearch, part_of
from mrwork.identification.settings import Multistart
from mrwork.identification.suspicious import LINEAR_SHARE, linear_misfit

if TYPE_CHECKING:
    from mrwork.search import Optimiser, SearchResult

# Largest number of starting points of an optimiser.
_STARTS = 16
# Nested starts are moved off the faces of the box, by this share of its ranges: on a face a parameter has no slope.
_OFF_FACES = 5e-3
# Rounds of the search of a simpler model, and iterations of its local minimisations: its fit is only a start.
_NESTED_ROUNDS = 3
_NESTED_ITERATIONS = 30
# A point near the simpler model has its misfit plus this at most; where bounds exclude such points, it is further away.
_NEAR = 0.1


def points_from_multistart(problem: Problem, search: Multistart, *, call: Identifying) -> StartingPoints:
    """The best minima of a multistart search among candidates below the limit of stiffness.

    There is no limit where no candidate is below it, or where stiffer ones describe the tests measurably better.
    """
    form, tests, rng = problem.form, problem.objective.tests, problem.settings.rng
    # The loops of a few cycles are sufficient to find the minima; the final fit compares all samples.
    excerpts = problem.objective.on(form.spec, excerpts_of(problem))
    on_search = part_of(call.on_search, 0.0, 1.0, fitted=EXCERPTS)
    linear = LINEAR_SHARE * linear_misfit(excerpts.tests)
    for stiffest in (friction_limit(tests), excerpts.stiffest):
        objective = up_to(excerpts, stiffest)
        nested = nested_fit(objective, form.box, search, rng=rng, on_search=part_of(on_search, 0.0, 0.5))
        minima = search_starts(
            objective,
            form.box,
            search_box(form.spec, form.box, objective.tests),
            search,
            rng=rng,
            mirrored=form.mirrored,
            nested=None if nested is None else nested.starts,
            suspicious=linear if nested is None else min(nested.misfit, linear),
            on_search=part_of(on_search, 0.5, 0.5),
        )
        if len(minima.theta):
            break
    else:
        raise no_simulation(form.spec, objective.tally.simulations)
    objective, theta = examine_limit(objective, form, distinct_minima(form.box, minima.theta, minima.misfit))
    return StartingPoints(
        objective=objective,
        form=form,
        theta=theta,
        trace=minima.trace,
        warnings=(*doubts_about(minima, nested, search), *friction_warning(objective, form, theta, nested)),
    )


def nested_fit(
    objective: Objective, box: Box, search: Multistart, *, rng: int, on_search: OnSearch
) -> NestedFit | None:
    """Fit of the simpler model that the searched one contains, within shared bounds; `None` without one."""
    nesting = NESTINGS.get(objective.spec.name)
    # With ties the simpler model is contained no more.
    if nesting is None or objective.settings.ties:
        return None
    simpler, names = damper(nesting.model), objective.spec.names
    form = identifiable_form(simpler, bounds_of(box, nesting.shared))
    rough = objective.on(simpler, objective.tests)
    search = replace(
        search,
        least_rounds=1,
        most_rounds=min(search.most_rounds, _NESTED_ROUNDS),
        most_iterations=min(search.most_iterations, _NESTED_ITERATIONS),
    )

    def lift_points(theta: Floats) -> Floats:
        values = dict(zip(simpler.names, theta.tolist(), strict=True))
        points = nesting.points(values, half_ranges(objective.tests))
        whole = np.array([[point[name] for name in names] for point in points])
        unit = np.asarray(box.unit_from_theta(np.clip(whole, box.lower, box.upper)))
        return np.asarray(box.theta_from_unit(np.clip(unit, _OFF_FACES, 1.0 - _OFF_FACES)))

    lifted = part_of(on_search, 0.0, 1.0, best=lambda theta: lift_points(theta)[-1])
    deeper = nested_fit(rough, form.box, search, rng=rng, on_search=part_of(lifted, 0.0, 0.5))
    minima = search_starts(
        rough,
        form.box,
        search_box(simpler, form.box, objective.tests),
        search,
        rng=rng,
        nested=None if deeper is None else deeper.starts,
        suspicious=math.inf if deeper is None else deeper.misfit,
        on_search=part_of(lifted, 0.5, 0.5, fitted=simpler.name),
    )
    if not len(minima.theta):
        return None
    starts, misfit = lift_points(minima.theta[0]), float(minima.misfit[0])
    near = float(np.min(objective(starts))) <= misfit + _NEAR
    return NestedFit(model=simpler.name, starts=starts, misfit=misfit if near else math.inf)


def doubts_about(minima: MultistartResult, nested: NestedFit | None, settings: Multistart) -> tuple[str, ...]:
    """Warnings that the minimum is false or was not found again; empty where the search found it often enough."""
    least = float(minima.misfit[0])
    if nested is not None and least > (1.0 + settings.closeness) * nested.misfit:
        better, percent = apart(with_decimals, 100.0 * (1.0 - nested.misfit), 100.0 * (1.0 - least), 2)
        return (
            f"the fit of {nested.model}, which this model contains, is better in the search "
            f"({better} % against {percent} %): the minimum is false; try another seed",
        )
    if minima.trace.stop_reason == "max_rounds":
        again = int(np.count_nonzero(minima.misfit <= (1.0 + settings.closeness) * least))
        if again >= max(settings.found, len(minima.misfit) / 2):
            # The search went on only because a simpler description is as good, which has a warning of its own.
            return ()
        return (
            f"the search is not sure of its minimum: {again} of {len(minima.misfit)} local minimisations reached it; "
            "compare the fit of another seed",
        )
    return ()


def points_from_optimiser(problem: Problem, search: Optimiser, *, call: Identifying) -> StartingPoints:
    """Minima from the elite of an optimiser, for a model without current laws."""
    objective, form = problem.objective, problem.form
    box = search_box(form.spec, form.box, objective.tests)

    elite, trace = optimise(
        search,
        objective,
        box.theta_from_unit,
        n_params=len(box.free),
        rng=problem.settings.rng,
        on_search=call.on_search,
    )
    theta = minima_from(
        objective,
        form.box,
        elite[:_STARTS],
        mirrored=form.mirrored,
        on_iteration=partial(report_minima, call, "", trace),
    )
    return StartingPoints(objective=objective, form=form, theta=theta, trace=trace)


def optimise(
    search: Optimiser,
    objective: Objective,
    theta_of: Callable[[Floats], Floats],
    *,
    n_params: int,
    rng: int,
    on_search: OnSearch,
) -> tuple[Floats, SearchTrace]:
    """The elite of a search over unit vectors, (n_elite, n_params), which `theta_of` maps to parameters, and its trace.

    The elite are its best points that are far apart, best first.
    """
    from mrwork.search import run_search

    def trace_of(search: SearchResult) -> SearchTrace:
        return SearchTrace(
            evaluations=tuple(int(count) for count in search.trace.evaluations),
            best=tuple(float(value) for value in search.trace.best),
            median=tuple(float(value) for value in search.trace.median),
            stop_reason=search.stop_reason,
        )

    def on_generation(so_far: SearchResult) -> None:
        if not math.isfinite(so_far.best_misfit):
            return
        on_search(
            Found(
                best=lambda: theta_of(so_far.best_unit[None])[0],
                trace=trace_of(so_far),
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
    return np.asarray(theta_of(result.elite)), trace_of(result)
