"""From starts to the result: short descents from all, long ones from the best, standard errors there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.equivalent import Form
from mrwork.identification.global_search import Exploration
from mrwork.identification.levenberg_marquardt import Descended, descend
from mrwork.identification.levenberg_marquardt_batch import descend_all
from mrwork.identification.multistart import distinct_minima
from mrwork.identification.objective import Objective
from mrwork.identification.settings import Engine
from mrwork.identification.standard_error import jacobian, standard_errors

# Evaluations of the last descent; of screening: those of every start, of the best few, and how many these are.
_LAST_EVALUATIONS = 100
_FIRST_EVALUATIONS = 15
_SEMIFINALISTS = 4
_SCREENING_EVALUATIONS = 60

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
    engine: Engine = "lanes",
    on_start: Callable[[Descended, float], None],
    on_step: OnStep,
) -> Polished:
    """Screen the starts, then finish the best in lanes, or on the twin where that is asked for.

    Standard errors are those of least squares there. Starts that are minima already need neither: the last steps there
    are for whatever the iterations allowed had left, and for starts that were given.
    """
    form = explored.form
    finalists = explored.starts
    if not explored.descended:
        finalists = best_few(
            explored.objective, form.box, finalists, mirrored=form.mirrored, on_start=on_start
        )
    if engine == "twin":
        ended = _on_the_twin(objective, form, finalists, on_step)
    elif explored.descended:
        ended = _side_by_side(objective, form, finalists, on_step)
    else:
        ended = _one_by_one(objective, form, finalists, on_step)
    return _judged(objective, form, ended)


def _side_by_side(
    objective: Objective, form: Form, starts: NDArray[np.float64], on_step: OnStep
) -> Descended:
    minima = descend_all(
        objective,
        form.box,
        starts,
        max_iterations=_LAST_EVALUATIONS,
        on_iteration=lambda minima: on_step(minima.iterations, float(minima.misfit.min())),
    )
    best = int(np.argmin(minima.misfit))
    return Descended(
        theta=minima.theta[best],
        misfit=float(minima.misfit[best]),
        evaluations=minima.iterations,
        converged=bool(minima.arrived[best]),
    )


def _one_by_one(objective: Objective, form: Form, starts: NDArray[np.float64], on_step: OnStep) -> Descended:
    descents = (
        descend(objective, form.box, start, max_evaluations=_LAST_EVALUATIONS, on_step=on_step)
        for start in starts
    )
    return min(descents, key=lambda descended: descended.misfit)


def _on_the_twin(objective: Objective, form: Form, starts: NDArray[np.float64], on_step: OnStep) -> Descended:
    # The one door to JAX, by pyproject.toml: it takes a second to load.
    from mrwork.identification.levenberg_marquardt_twin import refine

    refinements = (refine(objective, form.box, start, on_step=on_step) for start in starts)
    refined = min(refinements, key=lambda refined: refined.misfit)
    return Descended(
        theta=refined.theta,
        misfit=refined.misfit,
        evaluations=refined.steps,
        converged=refined.converged,
    )


def _judged(objective: Objective, form: Form, ended: Descended) -> Polished:
    """A minimum with its standard errors, which are those of least squares there."""
    plain = objective.plain
    misfit = ended.misfit if objective.is_plain else float(plain(ended.theta[None])[0])
    errors = standard_errors(partial(jacobian, plain), form, ended.theta, misfit)
    return Polished(
        theta=ended.theta, standard_errors=errors, steps=ended.evaluations, converged=ended.converged
    )


def best_few(
    objective: Objective,
    box: Box,
    starts: NDArray[np.float64],
    *,
    mirrored: tuple[int, ...],
    on_start: Callable[[Descended, float], None],
) -> NDArray[np.float64]:
    """Descend a little from every start, shape (n_starts, n_params), and to the end from the best of them.

    Returns the `distinct_minima`, shape (1 or 2, n_params).

    Parameters
    ----------
    mirrored
        Parameters whose signs can be changed together with little effect, but through a barrier that no
        descent crosses; the best minimum is tried again from its mirror image.
    on_start
        Called after every descent with the best so far and the share of the work done.
    """
    done = 0
    total = len(starts) + min(_SEMIFINALISTS, len(starts)) + bool(mirrored)
    found: list[Descended] = []

    def follow(start: NDArray[np.float64], max_evaluations: int) -> Descended:
        nonlocal done
        descended = descend(objective, box, start, max_evaluations=max_evaluations)
        found.append(descended)
        done += 1
        on_start(min(found, key=_misfit), done / total)
        return descended

    first = sorted((follow(start, _FIRST_EVALUATIONS) for start in starts), key=_misfit)
    last = sorted(
        (follow(each.theta, _SCREENING_EVALUATIONS) for each in first[:_SEMIFINALISTS]), key=_misfit
    )
    if mirrored:
        image = last[0].theta.copy()
        image[list(mirrored)] *= -1.0
        last = sorted([*last, follow(image, _SCREENING_EVALUATIONS)], key=_misfit)
    return distinct_minima(
        box, np.array([each.theta for each in last]), np.array([each.misfit for each in last])
    )


def _misfit(descended: Descended) -> float:
    return descended.misfit
