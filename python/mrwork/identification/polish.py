"""Final least-squares fits from the starting points, and standard errors at the minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.identification.covariance import Slopes, covariance_at, standard_errors
from mrwork.identification.equivalent import Form
from mrwork.identification.global_search import StartingPoints
from mrwork.identification.levenberg_marquardt import (
    LocalMinimum,
    find_minima,
    find_minimum,
    nearest_below_stiffness,
)
from mrwork.identification.multistart import distinct_minima
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.values import holds_arrays

# Largest number of evaluations: of the final fit, of the screening of each start, and of the second screening, which
# takes this number of the best.
_FINAL_EVALUATIONS = 100
_FIRST_SCREENING = 15
_SECOND_SCREENING = 60
_SCREENED_TWICE = 4

# Called with the best minimum so far and the share of the screening that is done.
OnStart = Callable[[LocalMinimum, float], None]
# Called with the steps so far and the misfit.
OnStep = Callable[[int, float], None]


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Polished:
    """A minimum: parameters and standard errors, shape (n_params,), steps of the final fit, whether it converged.

    The standard errors count the residuals as `n_effective` samples.
    """

    theta: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    n_effective: float
    slopes: Slopes
    steps: int
    converged: bool


def polish(
    problem: Problem,
    points: StartingPoints,
    *,
    on_start: OnStart,
    on_step: OnStep,
) -> Polished:
    """Screen the starting points by short local minimisations, then fit from the best to convergence.

    Points that are minima already are not screened: there the final fit continues beyond the iterations of the search,
    and includes the starts of the user. Standard errors are those of least squares at the minimum.
    """
    form = problem.form
    starts = points.theta
    if not points.minima:
        starts = screened(points.objective, form.box, starts, mirrored=form.mirrored, on_start=on_start)
    if problem.settings.engine == "twin":
        fitted = _on_the_twin
    elif points.minima:
        fitted = _in_a_batch
    else:
        fitted = _one_by_one
    return _with_standard_errors(problem.objective, form, fitted(problem, starts, on_step))


def _in_a_batch(problem: Problem, starts: NDArray[np.float64], on_step: OnStep) -> LocalMinimum:
    minima = find_minima(
        problem.objective,
        problem.form.box,
        nearest_below_stiffness(problem.objective.compared, problem.form.box, starts),
        max_iterations=_FINAL_EVALUATIONS,
        on_iteration=lambda minima: on_step(minima.iterations, float(minima.misfit.min())),
    )
    best = int(np.argmin(minima.misfit))
    return LocalMinimum(
        theta=minima.theta[best],
        misfit=float(minima.misfit[best]),
        evaluations=minima.iterations,
        converged=bool(minima.converged[best]),
    )


def _one_by_one(problem: Problem, starts: NDArray[np.float64], on_step: OnStep) -> LocalMinimum:
    objective, box = problem.objective, problem.form.box
    minima = (
        find_minimum(objective, box, start, max_evaluations=_FINAL_EVALUATIONS, on_step=on_step)
        for start in starts
    )
    return min(minima, key=_misfit)


def _on_the_twin(problem: Problem, starts: NDArray[np.float64], on_step: OnStep) -> LocalMinimum:
    # The only import of JAX that pyproject.toml allows here: it takes a second to load.
    from mrwork.identification.levenberg_marquardt_twin import find_minimum_on_twin

    objective, box = problem.objective, problem.form.box
    minima = (find_minimum_on_twin(objective, box, start, on_step=on_step) for start in starts)
    best = min(minima, key=lambda minimum: minimum.misfit)
    return LocalMinimum(
        theta=best.theta,
        misfit=best.misfit,
        evaluations=best.steps,
        converged=best.converged,
    )


def _with_standard_errors(objective: Objective, form: Form, ended: LocalMinimum) -> Polished:
    """A minimum with its standard errors, which are those of least squares for every power of the objective."""
    slopes = Slopes.at(objective.plain, form, ended.theta)
    cov, n_effective = covariance_at(slopes)
    return Polished(
        theta=ended.theta,
        standard_errors=standard_errors(cov),
        n_effective=n_effective,
        slopes=slopes,
        steps=ended.evaluations,
        converged=ended.converged,
    )


def screened(
    objective: Objective,
    box: Box,
    starts: NDArray[np.float64],
    *,
    mirrored: tuple[int, ...],
    on_start: OnStart,
) -> NDArray[np.float64]:
    """Run a short local minimisation from every start, shape (n_starts, n_params), then longer ones from the best.

    Returns the `distinct_minima`, shape (1 or 2, n_params).

    Parameters
    ----------
    mirrored
        Parameters whose signs can be changed together with little effect, but across a barrier that no local
        minimisation crosses; a further one starts from the mirror image of the best minimum.
    on_start
        Called after every minimisation with the best so far and the share of the work that is done.
    """
    done = 0
    total = len(starts) + min(_SCREENED_TWICE, len(starts)) + bool(mirrored)
    found: list[LocalMinimum] = []

    def minimised(start: NDArray[np.float64], max_evaluations: int) -> LocalMinimum:
        nonlocal done
        minimum = find_minimum(objective, box, start, max_evaluations=max_evaluations)
        found.append(minimum)
        done += 1
        on_start(min(found, key=_misfit), done / total)
        return minimum

    first = sorted((minimised(start, _FIRST_SCREENING) for start in starts), key=_misfit)
    last = sorted((minimised(each.theta, _SECOND_SCREENING) for each in first[:_SCREENED_TWICE]), key=_misfit)
    if mirrored:
        image = last[0].theta.copy()
        image[list(mirrored)] *= -1.0
        last = sorted([*last, minimised(image, _SECOND_SCREENING)], key=_misfit)
    return distinct_minima(
        box, np.array([each.theta for each in last]), np.array([each.misfit for each in last])
    )


def _misfit(minimum: LocalMinimum) -> float:
    return minimum.misfit
