"""Identifiability of the parameters of a fit from its tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Threads, checked
from mrwork.dampers.coordinates import Box
from mrwork.identification.autocorrelation import effective_samples, residuals_by_test
from mrwork.identification.certainty import Identifiability, Verdict
from mrwork.identification.fit import Fit
from mrwork.identification.linearisation import linearised
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.identification.result import remark_of
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.uncertainty.identifiability.curvature import Scale
from mrwork.uncertainty.identifiability.information import identifiability_from


@checked
def identifiability_of(
    fit: Fit,
    tests: DamperTest | Sequence[DamperTest],
    *,
    threads: Threads = 0,
) -> Identifiability:
    """Verdict on each parameter of a fit, and the directions in which its tests do not determine the parameters.

    A parameter that was held fixed to remove a redundant scale, such as `A` of the Spencer Bouc-Wen, gets no verdict,
    but the redundant direction is named. A parameter on its bound counts as known for the others.
    """
    problem = Problem.of_fit(fit, as_tests(tests), threads=threads)
    spec, theta = problem.spec, np.array(fit.theta)
    box = Box.of(spec).with_bounds(problem.settings.bounds)
    held = {each.name for each in fit.estimates if each.remark == "fixed"}
    objective = problem.objective.on(spec, problem.objective.tests)
    interior = [index for index in box.free if remark_of(box, index, theta[index]) == ""]
    inside = box.with_bounds({name: (value, value) for name, value in _on_bound(box, theta, interior)})
    if problem.form.spec == spec:
        residuals, jacobian = _linearised(objective, inside, theta)
    else:
        residuals = objective.residuals(theta[None])[0]
        jacobian = _through(problem, theta)[:, interior]
    scale = Scale.of(spec, box, objective.tests, theta)
    # Signed, so that the magnitude of a negative value increases, and products and ratios keep their form.
    sign = np.where(scale.of_range | (theta >= 0.0), 1.0, -1.0)
    found = identifiability_from(
        jacobian * (sign * scale.size)[interior],
        scales=[scale.of_parameter(spec, index) for index in interior],
        misfit=float(np.linalg.norm(residuals)),
        n_effective=effective_samples(residuals_by_test(residuals, objective.tests)),
        held=held,
    )
    verdicts = [
        replace(each, standard_error=each.standard_error * float(scale.size[spec.names.index(each.name)]))
        if each.standard_error is not None
        else each
        for each in found.verdicts
    ]
    verdicts += [
        Verdict(
            name=name,
            verdict="weakly identifiable",
            standard_error=None,
            reason=f"{remark_of(box, spec.names.index(name), value)}: the data bound it from one side only",
        )
        for name, value in _on_bound(box, theta, interior)
    ]
    verdicts.sort(key=lambda each: spec.names.index(each.name))
    return replace(found, verdicts=tuple(verdicts))


def _linearised(
    objective: Objective, box: Box, theta: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Residuals (n_residuals,), and their derivative by the free parameters of a box, (n_residuals, n_free)."""
    residuals, jacobian = linearised(objective, theta[None], box.free)
    return residuals[0], np.asarray(jacobian[0].T)


def _through(problem: Problem, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative for a model with redundant parameters, by the chain rule through its identifiable form."""
    form = problem.form
    mapped = form.from_model.jacobian(theta)
    _, jacobian = _linearised(problem.objective, form.box, problem.inside(theta))
    return np.asarray(jacobian @ mapped[list(form.box.free)])


def _on_bound(box: Box, theta: NDArray[np.float64], interior: Sequence[int]) -> list[tuple[str, float]]:
    return [(box.names[index], float(theta[index])) for index in box.free if index not in interior]
