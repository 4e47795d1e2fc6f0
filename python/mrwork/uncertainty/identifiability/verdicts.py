"""Identifiability of the parameters of a fit from its tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrwork.arguments import Threads, checked
from mrwork.dampers.coordinates import Box
from mrwork.identification.certainty import Identifiability, Verdict
from mrwork.identification.covariance import Slopes, covariance_at
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.identification.result import remarks_of
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
    spec, form, theta = problem.spec, problem.form, np.array(fit.theta)
    at_form = np.clip(form.from_model(theta), form.box.lower, form.box.upper)
    box = Box.of(spec).with_bounds(problem.settings.bounds)
    slopes = Slopes.at(problem.objective, form, at_form)
    covariance, n_effective = covariance_at(slopes)
    derivative = slopes.by_model()
    remarks = remarks_of(form, at_form)
    # Fixed by the form for the sake of a redundant scale, not by the user.
    held = {each.name for each in fit.estimates if each.remark == "fixed"} & set(form.fixed)
    taken = [index for index in box.free if remarks[index] == "" or spec.names[index] in form.fixed]
    scale = Scale.of(spec, box, problem.objective.tests, theta)
    # Signed, so that the magnitude of a negative value increases, and products and ratios keep their form.
    size = (np.where(scale.of_range | (theta >= 0.0), 1.0, -1.0) * scale.size)[taken]
    found = identifiability_from(
        derivative[:, taken] * size,
        covariance[np.ix_(taken, taken)] / np.outer(size, size),
        scales=[scale.of_parameter(spec, index, derivative[:, index]) for index in taken],
        n_effective=n_effective,
        held=held,
    )
    on_bound = (
        Verdict(
            name=spec.names[index],
            verdict="weakly identifiable",
            standard_error=None,
            reason=f"{remarks[index]}: the data bound it from one side only",
        )
        for index in box.free
        if remarks[index].startswith("at ")
    )
    verdicts = sorted((*found.verdicts, *on_bound), key=lambda each: spec.names.index(each.name))
    return replace(found, verdicts=tuple(verdicts))
