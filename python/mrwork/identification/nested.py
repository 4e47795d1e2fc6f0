"""Fit of the simpler model that a searched model contains: starts near it, and the misfit to be reached."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.nesting import nesting_of
from mrwork.dampers.spec import damper
from mrwork.errors import Interrupted
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.multistart import MultistartResult, search_starts
from mrwork.identification.objective import Objective
from mrwork.identification.search_ranges import half_ranges, search_box
from mrwork.identification.searches import Multistart
from mrwork.values import holds_arrays

# Called after an iteration with the result so far and the share of the allowed iterations that is used up.
OnIteration = Callable[[MultistartResult, float], None]

# Nested starts are moved off the faces of the box, by this share of its ranges: on a face a parameter has no slope.
_OFF_FACES = 5e-3
# Rounds of the search of a simpler model, and iterations of its local minimisations: its fit is only a start.
_NESTED_ROUNDS = 3
_NESTED_ITERATIONS = 30
# A point near the simpler model has its misfit plus this at most; where bounds exclude such points, it is further away.
_NEAR = 0.1


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class NestedFit:
    """Fit of a simpler `model` that the searched one contains.

    `starts` are points of the searched model near it, shape (n_starts, n_params). `misfit` is that of the simpler
    model, which the searched one can at least approach; infinite where bounds prevent that.
    """

    model: str
    starts: NDArray[np.float64]
    misfit: float


def nested_fit(
    objective: Objective,
    box: Box,
    search: Multistart,
    *,
    rng: int,
    on_iteration: OnIteration,
) -> NestedFit | None:
    """Search the simpler model that the searched one contains; `None` where there is none.

    It is searched in the same way, with the bounds of the parameters that both models share.

    Raises
    ------
    Interrupted
        On Ctrl-C, carrying the result so far as one of the searched model, `None` where there is none.
    """
    nesting = nesting_of(objective.spec)
    if nesting is None:
        return None
    simpler = damper(nesting.model)
    names = objective.spec.names
    bounds = {name: (box.lower[names.index(name)], box.upper[names.index(name)]) for name in nesting.shared}
    form = identifiable_form(simpler, bounds)
    rough = objective.on(simpler, objective.tests)
    search = replace(
        search,
        least_rounds=1,
        most_rounds=min(search.most_rounds, _NESTED_ROUNDS),
        most_iterations=min(search.most_iterations, _NESTED_ITERATIONS),
    )

    def lifted(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        values = dict(zip(simpler.names, theta.tolist(), strict=True))
        points = nesting.points(values, half_ranges(objective.tests))
        whole = np.array([[point[name] for name in names] for point in points])
        unit = np.asarray(box.unit_from_theta(np.clip(whole, box.lower, box.upper)))
        return np.asarray(box.theta_from_unit(np.clip(unit, _OFF_FACES, 1.0 - _OFF_FACES)))

    first, second = halves(on_iteration)
    try:
        deeper = nested_fit(rough, form.box, search, rng=rng, on_iteration=first)
        found = search_starts(
            rough,
            form.box,
            search_box(simpler, form.box, objective.tests),
            search,
            rng=rng,
            nested=None if deeper is None else deeper.starts,
            suspicious=math.inf if deeper is None else deeper.misfit,
            on_iteration=second,
        )
    except Interrupted as interrupt:
        found = interrupt.result
        if found is None or not len(found.theta):
            raise Interrupted(None, "search") from interrupt
        raise Interrupted(replace(found, theta=lifted(found.theta[0])[-1:]), "search") from interrupt
    if not len(found.theta):
        return None
    starts, misfit = lifted(found.theta[0]), float(found.misfit[0])
    near = float(np.min(objective(starts))) <= misfit + _NEAR
    return NestedFit(model=simpler.name, starts=starts, misfit=misfit if near else math.inf)


def halves(on_iteration: OnIteration) -> tuple[OnIteration, OnIteration]:
    """Callbacks of two searches, of which each takes half of the work."""
    return (
        lambda found, share: on_iteration(found, 0.5 * share),
        lambda found, share: on_iteration(found, 0.5 + 0.5 * share),
    )
