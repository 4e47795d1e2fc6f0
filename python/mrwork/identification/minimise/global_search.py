"""Global search: starting points of the final least-squares fits.

The simpler model that a searched model contains is fitted first: starts near it, and the misfit to be reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.conversions import nesting_of
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import Interrupted, SimulationError
from mrwork.identification.equivalent import Form, bounds_of, half_ranges, identifiable_form, search_box
from mrwork.identification.fit import SearchTrace
from mrwork.identification.minimise.multistart import (
    LINEAR_SHARE,
    MultistartResult,
    distinct_minima,
    linear_misfit,
    search_starts,
)
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.identification.settings import Multistart, Start
from mrwork.records.window import excerpt

if TYPE_CHECKING:
    from mrwork.search import Optimiser, SearchResult
    from mrwork.search.loop import GenerationEvent


# Called after an iteration with what is fitted, the result so far and the share of the allowed iterations that is used
# up.
OnIteration = Callable[[str, MultistartResult, float], None]
EXCERPTS = "excerpts"
"""What the searches fit that compare parts of the tests."""

# Nested starts are moved off the faces of the box, by this share of its ranges: on a face a parameter has no slope.
_OFF_FACES = 5e-3
# Rounds of the search of a simpler model, and iterations of its local minimisations: its fit is only a start.
_NESTED_ROUNDS = 3
_NESTED_ITERATIONS = 30
# A point near the simpler model has its misfit plus this at most; where bounds exclude such points, it is further away.
_NEAR = 0.1


@array_dataclass()
class NestedFit:
    """Fit of a simpler `model` that the searched one contains.

    `starts` are points of the searched model near it, shape (n_starts, n_params). `misfit` is that of the simpler
    model, which the searched one can at least approach; infinite where bounds prevent that.
    """

    model: str
    starts: Floats
    misfit: float


def nested_fit(
    objective: Objective,
    box: Box,
    search: Multistart,
    *,
    rng: int,
    on_iteration: OnIteration,
) -> NestedFit | None:
    """Fit of the simpler model that the searched one contains, within shared bounds; `None` without one."""
    nesting = nesting_of(objective.spec)
    if nesting is None:
        return None
    simpler = damper(nesting.model)
    names = objective.spec.names
    if objective.settings.ties:
        # Without the ties the simpler model would be contained no more.
        return None
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

    first, second = halves(on_iteration)
    try:
        deeper = nested_fit(rough, form.box, search, rng=rng, on_iteration=first)
        minima = search_starts(
            rough,
            form.box,
            search_box(simpler, form.box, objective.tests),
            search,
            rng=rng,
            nested=None if deeper is None else deeper.starts,
            suspicious=math.inf if deeper is None else deeper.misfit,
            on_iteration=partial(second, simpler.name),
        )
    except Interrupted as interrupt:
        minima = interrupt.result
        if minima is None or not len(minima.theta):
            raise Interrupted(None, "search") from interrupt
        raise Interrupted(replace(minima, theta=lift_points(minima.theta[0])[-1:]), "search") from interrupt
    if not len(minima.theta):
        return None
    starts, misfit = lift_points(minima.theta[0]), float(minima.misfit[0])
    near = float(np.min(objective(starts))) <= misfit + _NEAR
    return NestedFit(model=simpler.name, starts=starts, misfit=misfit if near else math.inf)


def halves(on_iteration: OnIteration) -> tuple[OnIteration, OnIteration]:
    """Callbacks of two searches, of which each takes half of the work."""
    return (
        lambda fitted, found, share: on_iteration(fitted, found, 0.5 * share),
        lambda fitted, found, share: on_iteration(fitted, found, 0.5 + 0.5 * share),
    )


# Largest number of starting points.
_STARTS = 16

# Called with what is fitted, empty for the model on all samples, the generation or iteration (0 outside a search), best
# and median misfit, and the share of the allowed iterations that is used up.
OnSearch = Callable[[str, int, float, float, float], None]
OnGeneration = Callable[[int, float, float, float], None]


@array_dataclass()
class StartingPoints:
    """Starting points, shape (n_starts, n_params), best first, and the trace of the search that found them.

    `objective` compares them, and they are fitted inside the box of `form`. Where they are `minima` already, no
    screening is needed to select the best; `warnings` say what makes the best suspicious, and `is_suspected` that it is
    taken for a false minimum.
    """

    objective: Objective
    form: Form
    theta: Floats
    trace: SearchTrace
    minima: bool = False
    warnings: tuple[str, ...] = ()
    is_suspected: bool = False

    def with_given(self, spec: DamperSpec, given: Sequence[Start]) -> StartingPoints:
        """The same with the user's starts, in parameters of the requested model, appended and moved inside the box.

        A parameter that a start does not name has the value of the best point.
        """
        box = self.form.box
        best = np.asarray(self.form.to_model(self.theta[0]))
        whole = [
            np.array([start.get(name, own) for name, own in zip(spec.names, best, strict=True)])
            for start in given
        ]
        inside = [box.inside(np.clip(self.form.from_model(theta), box.lower, box.upper)) for theta in whole]
        return replace(self, theta=np.array([*self.theta, *inside]))


def points_from_multistart(problem: Problem, search: Multistart, *, on_search: OnSearch) -> StartingPoints:
    """The best minima of a multistart search."""
    form, rng = problem.form, problem.settings.rng
    # The loops of a few cycles are sufficient to find the minima; the final fit compares all samples.
    objective = problem.objective.on(form.spec, tuple(excerpt(test) for test in problem.objective.tests))

    def on_iteration(simpler: str, minima: MultistartResult, share: float) -> None:
        fitted = f"{simpler} on {EXCERPTS}" if simpler else EXCERPTS
        # The first entry is that of the samples.
        on_search(fitted, len(minima.best) - 1, minima.best[-1], minima.median[-1], share)

    first, second = halves(on_iteration)

    nested: NestedFit | None = None
    try:
        nested = nested_fit(objective, form.box, search, rng=rng, on_iteration=first)
        found = search_starts(
            objective,
            form.box,
            search_box(form.spec, form.box, objective.tests),
            search,
            rng=rng,
            mirrored=form.mirrored,
            nested=None if nested is None else nested.starts,
            suspicious=min(
                math.inf if nested is None else nested.misfit,
                LINEAR_SHARE * linear_misfit(objective.tests),
            ),
            on_iteration=partial(second, ""),
        )
    except Interrupted as interrupt:
        found = interrupt.result
        if found is None or not len(found.theta):
            raise Interrupted(None, "search") from interrupt
        raise make_interrupt(found.theta[0], objective, form, trace_of(found)) from interrupt
    if not len(found.theta):
        raise no_simulation(form.spec, found.evaluations[-1])
    return StartingPoints(
        objective=objective,
        form=form,
        theta=distinct_minima(form.box, found.theta, found.misfit),
        trace=trace_of(found),
        minima=True,
        warnings=doubts_about(found, nested, search),
    )


def doubts_about(minima: MultistartResult, nested: NestedFit | None, settings: Multistart) -> tuple[str, ...]:
    """Warnings about the minimum of a search."""
    least = float(minima.misfit[0])
    if nested is not None and least > (1.0 + settings.closeness) * nested.misfit:
        return (
            f"the fit of {nested.model}, which this model contains, is better in the search "
            f"({100.0 * (1.0 - nested.misfit):.2f} % against {100.0 * (1.0 - least):.2f} %): the minimum is false; "
            "try another seed",
        )
    if minima.stop_reason == "max_rounds":
        again = int(np.count_nonzero(minima.misfit <= (1.0 + settings.closeness) * least))
        if again >= max(settings.found, len(minima.misfit) / 2):
            # The search went on only because a simpler description is as good, which has a warning of its own.
            return ()
        return (
            f"the search is not sure of its minimum: {again} of {len(minima.misfit)} local minimisations reached it; "
            "compare the fit of another seed",
        )
    return ()


def trace_of(minima: MultistartResult) -> SearchTrace:
    """Trace of a multistart search."""
    return SearchTrace(
        evaluations=minima.evaluations,
        best=minima.best,
        median=minima.median,
        stop_reason=minima.stop_reason,
        ends=tuple(minima.misfit.tolist()),
    )


def points_from_optimiser(problem: Problem, search: Optimiser[Any], *, on_search: OnSearch) -> StartingPoints:
    """The elite of an optimiser (its best points that are far apart), for a model without current laws."""
    objective, form = problem.objective, problem.form
    box = search_box(form.spec, form.box, objective.tests)

    elite = search_elite(
        problem,
        search,
        objective,
        form,
        box.theta_from_unit,
        n_params=len(box.free),
        on_search=partial(on_search, ""),
    )
    return StartingPoints(
        objective=objective,
        form=form,
        theta=np.asarray(box.theta_from_unit(elite.elite[:_STARTS])),
        trace=trace_of_generations(elite),
    )


def search_elite(
    problem: Problem,
    search: Optimiser[Any],
    objective: Objective,
    form: Form,
    theta_of: Callable[[Floats], Floats],
    *,
    n_params: int,
    on_search: OnGeneration,
) -> SearchResult[Any]:
    """Run an optimiser on unit vectors of size `n_params`, of which `theta_of` makes rows of parameters of the form.

    An interrupt carries the best point so far.
    """
    try:
        return optimise(
            search, objective, theta_of, n_params=n_params, rng=problem.settings.rng, on_search=on_search
        )
    except Interrupted as interrupt:
        result = interrupt.result
        if not np.isfinite(result.best_misfit):
            raise Interrupted(None, "search") from interrupt
        best = theta_of(result.best_unit[None])[0]
        raise make_interrupt(best, objective, form, trace_of_generations(result)) from interrupt


def optimise(
    search: Optimiser[Any],
    objective: Objective,
    theta_of: Callable[[Floats], Floats],
    *,
    n_params: int,
    rng: int,
    on_search: OnGeneration,
) -> SearchResult[Any]:
    """Minimise the objective over unit vectors, of which `theta_of` makes rows of parameters."""
    from mrwork.search import run_search

    def on_generation(event: GenerationEvent[Any]) -> None:
        share = event.generation / search.stop.max_generations
        on_search(event.generation, event.best_misfit, event.median_misfit, share)

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


def make_interrupt(
    theta: Floats, objective: Objective, form: Form, trace: SearchTrace
) -> Interrupted[StartingPoints]:
    """An interrupt that carries the best point so far, shape (n_params,)."""
    best = StartingPoints(objective=objective, form=form, theta=theta[None], trace=trace)
    return Interrupted(best, "search")


def trace_of_generations(search: SearchResult[Any]) -> SearchTrace:
    """Trace of an optimiser, an entry for each generation."""
    return SearchTrace(
        evaluations=tuple(int(count) for count in search.trace.evaluations),
        best=tuple(float(value) for value in search.trace.best),
        median=tuple(float(value) for value in search.trace.median),
        stop_reason=search.stop_reason,
    )


def no_simulation(spec: DamperSpec, evaluations: int) -> SimulationError:
    """The error of a search in which every simulation failed."""
    return SimulationError(
        f"none of {evaluations} candidates of {spec.name} could be simulated on these tests; "
        "check the units of the record, or narrow the bounds"
    )
