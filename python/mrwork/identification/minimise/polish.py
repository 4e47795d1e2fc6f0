"""Final least-squares fit from the starting points that a search has found, and its standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from mrwork.base.remark import Remark
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SimulationError
from mrwork.identification.covariance import Covariance, Slopes
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import FittedParameter, SearchTrace
from mrwork.identification.minimise.levenberg_marquardt import Hopeless, OnStep, find_minima
from mrwork.identification.minimise.race import Raced, distinct_minima
from mrwork.identification.minimise.stiffness import nearest_below_stiffness
from mrwork.identification.objective import Objective, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.settings import Start
from mrwork.identification.suspicious import linear_misfit, linear_start

# Largest number of iterations of the final fit.
_MOST_ITERATIONS = 100
# Minimisations that would not reach the best minimum that has converged are given up.
_BEHIND = Hopeless(after=5, factor=4.0, found=1, closeness=0.0)


@array_dataclass()
class StartingPoints:
    """Starting points, shape (n_starts, n_params), best first, and the trace of the search that found them.

    They are minima of `objective`, which compares them, and are fitted inside the box of `form`. `doubt` says why a
    minimum below the best is possible, empty where the routes of the search agree.
    """

    objective: Objective
    form: Form
    theta: Floats
    trace: SearchTrace
    doubt: str = ""

    @classmethod
    def of_race(cls, raced: Raced, form: Form) -> StartingPoints:
        """The distinct minima of a race in the box of a form; an error where every simulation has failed."""
        if not len(raced.theta):
            raise no_simulation(form.spec, raced.objective.tally.simulations)
        theta = np.concatenate([distinct_minima(form.box, raced.theta, raced.misfit), raced.another])
        return cls(objective=raced.objective, form=form, theta=theta, trace=raced.trace, doubt=raced.doubt)

    def with_given(self, spec: DamperSpec, given: Sequence[Start]) -> StartingPoints:
        """The starting points, and the user's starts, in parameters of the requested model, moved inside the box.

        Parameters that a start does not name are taken from the best point. A start above the limit of stiffness lifts
        the limit.
        """
        best = np.asarray(self.form.to_model(self.theta[0]))
        whole = [
            np.array([start.get(name, value) for name, value in zip(spec.names, best, strict=True)])
            for start in given
        ]
        inside = [self.form.box.inside(self.form.from_model(theta)) for theta in whole]
        objective = self.objective
        if inside and any(np.any(test.stiffness(np.array(inside)) > 1.0) for test in objective.compared):
            objective = up_to(objective, np.inf)
        return replace(self, objective=objective, theta=np.array([*self.theta, *inside]))


def no_simulation(spec: DamperSpec, evaluations: int) -> SimulationError:
    """The error of a search in which every simulation failed."""
    return SimulationError(
        f"none of {evaluations} candidates of {spec.name} could be simulated on these tests; "
        "check the units of the record, or narrow the bounds"
    )


@array_dataclass()
class FinalFit:
    """The minimum at which a fit ends, of the problem that it solves, with its covariance, and remarks on it.

    `effects` are those on the recorded force that were fitted with the parameters.
    """

    problem: Problem
    covariance: Covariance
    steps: int
    converged: bool
    remarks: tuple[Remark, ...] = ()
    effects: tuple[FittedParameter, ...] = ()

    @property
    def theta(self) -> Floats:
        """Parameters of the problem's form, (n_params,)."""
        return self.covariance.slopes.theta

    @property
    def misfit(self) -> float:
        """Root mean square of the NRMSE of all tests."""
        return float(self.problem.objective(self.theta[None])[0])


def polish(problem: Problem, starts: Floats, *, on_step: OnStep) -> FinalFit:
    """Fit from `starts`, (n_starts, n_params), to convergence; standard errors are of the best minimum."""
    objective, form = problem.objective, problem.form
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
    return FinalFit(problem=problem, covariance=covariance, steps=ended.steps, converged=ended.converged)


def at_least_linear(ended: FinalFit, *, on_step: OnStep) -> FinalFit:
    """The fit, or that from the linear damper within a plain model where this describes the tests better.

    Loops that are nearly straight in one stroke take the part of a spring, along a valley without an end.
    """
    problem, misfit = ended.problem, float(np.linalg.norm(ended.covariance.slopes.residuals))
    tests = problem.objective.tests
    if problem.spec.command_unit is not None or misfit < linear_misfit(tests):
        return ended
    start = linear_start(problem.form, tests)[None]
    return ended if problem.objective(start)[0] >= misfit else polish(problem, start, on_step=on_step)
