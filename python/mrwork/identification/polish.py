"""From starts to the result: screen them, finish the best, say how sure its parameters are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.descent import Descended, descend, difference_quotient
from mrwork.identification.exploration import Exploration
from mrwork.identification.objective import Objective
from mrwork.identification.refine import OnStep, jacobian, refine
from mrwork.identification.screen import best_few
from mrwork.identification.standard_error import standard_errors

_LAST_EVALUATIONS = 100


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
    nuisance parameters, current laws over many tests and other powers are descended in lanes, with central differences.
    Standard errors are those of least squares there.
    """
    form = explored.form
    finalists = best_few(
        explored.objective,
        form.box,
        explored.searched,
        explored.starts,
        mirrored=form.mirrored,
        on_start=on_start,
    )
    if objective.is_direct and objective.is_plain and form.spec.current is None:
        refined = min(
            (refine(objective, form.box, each.theta, on_step=on_step) for each in finalists),
            key=lambda refined: refined.misfit,
        )
        theta, misfit, steps, converged = refined.theta, refined.misfit, refined.steps, refined.converged
        derivative = partial(jacobian, objective)
    else:
        ended = min(
            (
                descend(
                    objective,
                    form.box,
                    explored.searched,
                    each.theta,
                    max_evaluations=_LAST_EVALUATIONS,
                    on_step=on_step,
                )
                for each in finalists
            ),
            key=lambda descended: descended.misfit,
        )
        theta, misfit, steps, converged = ended.theta, ended.misfit, ended.evaluations, ended.converged
        if not objective.is_plain:
            misfit = float(objective.plain(theta[None])[0])
        derivative = partial(difference_quotient, objective.plain, searched=explored.searched)
    errors = standard_errors(derivative, form, theta, misfit)
    return Polished(theta=theta, standard_errors=errors, steps=steps, converged=converged)
