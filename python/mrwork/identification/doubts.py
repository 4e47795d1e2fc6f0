"""What speaks against a fit that has converged: each doubt is a sentence, and they stand in one list."""

from __future__ import annotations

from mrwork.identification.driver_lag import missing_lag
from mrwork.identification.fit import Fit
from mrwork.identification.global_search import StartingPoints
from mrwork.identification.law_shape import law_shape_warnings
from mrwork.identification.motion_noise import motion_noise_warning
from mrwork.identification.multistart import linear_warning
from mrwork.identification.needless_average import needless_average_warnings
from mrwork.identification.polish import Polished
from mrwork.identification.problem import Problem


def doubts_on_fit(problem: Problem, points: StartingPoints, polished: Polished, fit: Fit) -> tuple[str, ...]:
    """Sentences on a fit, from the tests alone: some fit the model once more, and take a while."""
    objective, form = problem.objective, problem.form
    # On the excerpts of the search: another fit to the whole tests would cost as much as the final one.
    excerpts = objective.on(form.spec, points.objective.tests)
    missing = missing_lag(form.spec, objective, polished.theta)
    return (
        *linear_warning(fit.nrmse, objective.tests, follows_command=problem.spec.current is not None),
        *((missing.in_words,) if missing is not None else ()),
        *needless_average_warnings(objective, form.box, polished.theta),
        *law_shape_warnings(excerpts, form.box, polished.theta),
        *motion_noise_warning(objective, form, polished.theta, polished.standard_errors, problem.spec.names),
    )
