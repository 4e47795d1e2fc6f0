"""From starts to the result: screen them, finish the best, say how sure its parameters are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.descent import Descended, descend
from mrwork.identification.descents import descend_all
from mrwork.identification.equivalent import Form
from mrwork.identification.exploration import Exploration
from mrwork.identification.objective import Objective
from mrwork.identification.screen import best_few
from mrwork.identification.standard_error import jacobian, standard_errors

_LAST_EVALUATIONS = 100

# Called with the steps so far and the misfit.
OnStep = Callable[[int, float], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Polished:
    """A minimum: parameters and standard errors, shape (n_params,), steps of the last descent, whether it arrived."""

    theta: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    steps: int
    converged: bool


def polish(
    objective: Objective,
    explored: Exploration,
    *,
    on_start: Callable[[Descended, float], None],
    on_step: OnStep,
) -> Polished:
    """Screen the starts, then finish the best: on the twin, or in lanes where the twin does not reach.

    The twin compares the simulated force itself, for one set of parameters, by least squares; an observed force,
    nuisance parameters, current laws over many tests and other powers are descended in lanes.
    Standard errors are those of least squares there. Starts that are minima already need neither: the last steps there
    are for whatever the iterations allowed had left, and for starts that were given.
    """
    form = explored.form
    if explored.descended:
        minima = descend_all(
            objective,
            form.box,
            explored.starts,
            max_iterations=_LAST_EVALUATIONS,
            on_iteration=lambda minima: on_step(minima.iterations, float(minima.misfit.min())),
        )
        best = int(np.argmin(minima.misfit))
        ended = Descended(
            theta=minima.theta[best],
            misfit=float(minima.misfit[best]),
            evaluations=minima.iterations,
            converged=bool(minima.arrived[best]),
        )
        return _judged(objective, form, ended)
    finalists = best_few(
        explored.objective, form.box, explored.starts, mirrored=form.mirrored, on_start=on_start
    )
    if not (objective.is_direct and objective.is_plain and form.spec.current is None):
        ended = min(
            (
                descend(
                    objective,
                    form.box,
                    each,
                    max_evaluations=_LAST_EVALUATIONS,
                    on_step=on_step,
                )
                for each in finalists
            ),
            key=lambda descended: descended.misfit,
        )
        return _judged(objective, form, ended)
    # JAX is slow to load, and needed here only.
    from mrwork.identification.refine import refine

    refined = min(
        (refine(objective, form.box, each, on_step=on_step) for each in finalists),
        key=lambda refined: refined.misfit,
    )
    ended = Descended(
        theta=refined.theta,
        misfit=refined.misfit,
        evaluations=refined.steps,
        converged=refined.converged,
    )
    return _judged(objective, form, ended)


def _judged(objective: Objective, form: Form, ended: Descended) -> Polished:
    """A minimum with its standard errors, which are those of least squares there."""
    plain = objective.plain
    misfit = ended.misfit if objective.is_plain else float(plain(ended.theta[None])[0])
    errors = standard_errors(partial(jacobian, plain), form, ended.theta, misfit)
    return Polished(
        theta=ended.theta, standard_errors=errors, steps=ended.evaluations, converged=ended.converged
    )
