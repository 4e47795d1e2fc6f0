"""Minima at the limit of stiffness: whether stiffer loops are better, or the model is a friction element."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import NEGLIGIBLE
from mrwork.identification.minimise.levenberg_marquardt import LocalMinima, find_minima
from mrwork.identification.minimise.multistart import NestedFit, minima_from, on_bound
from mrwork.identification.minimise.stiffness import is_at_stiffness_limit, stiffness_and_slope
from mrwork.identification.objective import Objective, up_to

# Minima at the limit of stiffness start again off the bounds, by this share of the ranges. Above the limit they are
# better if their misfit falls by this share in so many iterations.
_OFF_BOUNDS = 0.05
_MEASURABLE = 0.02
_BEYOND_LIMIT = 10


def examine_limit(
    objective: Objective,
    form: Form,
    theta: Floats,
    *,
    raised: float = math.inf,
    points: float = NEGLIGIBLE,
    on_iteration: Callable[[LocalMinima], None] | None = None,
) -> tuple[Objective, Floats]:
    """Starts of the final fit where minima, (n_minima, n_params), are at the limit of stiffness, and their objective.

    The limit is `raised` by this factor while the misfit falls measurably above it: by `_MEASURABLE` of itself or by
    more than `points`. On a bound parameters have no slope: what the limit leaves to them is found from off it.
    """
    box = form.box
    while is_at_stiffness_limit(objective.compared, theta[:1])[0]:
        higher = up_to(objective, raised * objective.stiffest)
        beyond = find_minima(higher, box, theta, max_iterations=_BEYOND_LIMIT, on_iteration=on_iteration)
        within, least = float(objective(theta).min()), float(beyond.misfit.min())
        if within - least <= min(points / 100.0, _MEASURABLE * within):
            unit = np.asarray(box.unit_from_theta(theta))
            inner = np.clip(unit, _OFF_BOUNDS, 1.0 - _OFF_BOUNDS)[np.any(on_bound(unit), axis=1)]
            return objective, np.concatenate([theta, np.asarray(box.theta_from_unit(inner))])
        theta = minima_from(higher, box, beyond.theta, mirrored=form.mirrored, on_iteration=on_iteration)
        objective = higher
    return objective, theta


# A parameter takes part in the stiffness if it changes it by this share of what the others do.
_TAKES_PART = 0.01


def friction_warning(
    objective: Objective, form: Form, theta: Floats, nested: NestedFit | None = None
) -> tuple[str, ...]:
    """Sentence on starts, (n_starts, n_params), best first, that are at the limit of stiffness; empty elsewhere."""
    if not is_at_stiffness_limit(objective.compared, theta[:1])[0]:
        return ()
    latent = np.asarray(form.box.latent_from_theta(form.box.inside(theta[:1])))[0]
    slope = np.abs(stiffness_and_slope(objective.compared, form.box, latent)[1]).max(axis=0)
    names = [
        form.box.names[index]
        for index in np.take(form.box.free, np.flatnonzero(slope > _TAKES_PART * slope.max()))
    ]
    beside = ""
    if nested is not None and nested.misfit < math.inf:
        both = [100.0 * (1.0 - misfit) for misfit in (nested.misfit, float(objective(theta[:1])[0]))]
        beside = (
            f" ({nested.model}, which it contains, fits {both[0]:.2f} % of the excerpts, it {both[1]:.2f} %)"
        )
    return (
        f"{form.spec.name} becomes a friction element by its {list_names(names)}: a loop that yields or unloads faster "
        f"would lower the misfit by less than {100.0 * _MEASURABLE:g} % of it and was not searched; use a model that "
        f"costs less where it fits as well{beside}: compare models without states (--model hyperbolic_tangent_guo)",
    )
