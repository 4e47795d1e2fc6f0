"""The simpler model that a searched model contains: its fit gives starts near it, and the misfit to be reached.

A minimum of the searched model that is above it is false.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from mrwork.base.numbers import apart, with_decimals
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.conversions import NESTINGS
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import damper
from mrwork.identification.equivalent import bounds_of, half_ranges, identifiable_form, search_box
from mrwork.identification.minimise.multistart import MultistartResult, OnSearch, search_starts
from mrwork.identification.objective import Objective
from mrwork.identification.progress import Found
from mrwork.identification.settings import Multistart

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

    `starts` are points of the searched model near it, shape (n_starts, n_params). The searched model can at least
    approach the `misfit` of the simpler one, which is infinite where bounds prevent that.
    """

    model: str
    starts: Floats
    misfit: float


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

    def lifted(fitted: str, state: Found) -> None:
        on_search(fitted, replace(state, best=lambda: lift_points(state.best())[-1]))

    deeper = nested_fit(rough, form.box, search, rng=rng, on_search=part_of(lifted, 0.0, 0.5))
    minima = search_starts(
        rough,
        form.box,
        search_box(simpler, form.box, objective.tests),
        search,
        rng=rng,
        nested=None if deeper is None else deeper.starts,
        suspicious=math.inf if deeper is None else deeper.misfit,
        on_search=partial(part_of(lifted, 0.5, 0.5), simpler.name),
    )
    if not len(minima.theta):
        return None
    starts, misfit = lift_points(minima.theta[0]), float(minima.misfit[0])
    near = float(np.min(objective(starts))) <= misfit + _NEAR
    return NestedFit(model=simpler.name, starts=starts, misfit=misfit if near else math.inf)


def part_of(on_search: OnSearch, before: float, share: float) -> OnSearch:
    """The callback of a search that is a share of the whole, after what is done before."""
    return lambda fitted, state: on_search(fitted, replace(state, share=before + share * state.share))


def doubts_about(minima: MultistartResult, nested: NestedFit | None, settings: Multistart) -> tuple[str, ...]:
    """Warnings about the minimum of a search."""
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
