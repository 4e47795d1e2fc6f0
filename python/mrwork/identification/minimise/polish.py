"""Final least-squares fit from the starting points, and its standard errors."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter

from mrwork.base.values import Floats, array_dataclass
from mrwork.identification.covariance import Covariance, Slopes
from mrwork.identification.minimise.levenberg_marquardt import Hopeless, LocalMinima, find_minima
from mrwork.identification.minimise.multistart import minima_from
from mrwork.identification.minimise.starting_points import StartingPoints
from mrwork.identification.minimise.stiffness import nearest_below_stiffness
from mrwork.identification.problem import Problem

# Largest number of iterations of the final fit.
_MOST_ITERATIONS = 100
# Minimisations that would not reach the best minimum that has converged are given up.
_BEHIND = Hopeless(after=5, factor=4.0, found=1, closeness=0.0)

# Called with the minimisations from starts that are no minima.
OnStart = Callable[[LocalMinima], None]
# Called with the steps so far and the misfit.
OnStep = Callable[[int, float], None]


@array_dataclass()
class Polished:
    """A minimum: parameters, (n_params,), with their covariance, steps, whether it converged."""

    theta: Floats
    covariance: Covariance
    steps: int
    converged: bool


def polish(
    problem: Problem, points: StartingPoints, *, on_start: OnStart = lambda minima: None, on_step: OnStep
) -> Polished:
    """Minimise shortly from the starting points, unless they are minima, then fit from the best to convergence.

    Standard errors are by least squares at the minimum.
    """
    objective, form, starts = problem.objective, problem.form, points.theta
    if not points.minima:
        starts = minima_from(
            points.objective, form.box, starts, mirrored=form.mirrored, on_iteration=on_start
        )
    if problem.settings.engine == "optimistix":
        # The only import of JAX that pyproject.toml allows here: it takes a second to load.
        from mrwork.identification.minimise.by_optimistix import find_minimum_by_optimistix as find

        endings = (find(objective, form.box, start, on_step=on_step) for start in starts)
        ended = min(endings, key=attrgetter("misfit"))
    else:
        ended = find_minima(
            objective,
            form.box,
            nearest_below_stiffness(objective.compared, form.box, starts),
            max_iterations=_MOST_ITERATIONS,
            hopeless=_BEHIND,
            on_iteration=lambda minima: on_step(minima.iterations, float(minima.misfit.min())),
        ).best
    covariance = Covariance.of(Slopes.at(objective, form, ended.theta))
    return Polished(theta=ended.theta, covariance=covariance, steps=ended.steps, converged=ended.converged)
