"""Starting points of a model with current laws from tests whose command varies: no test shows the plain model alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.equivalent import fitted_law, joint_box, plain_of, search_box
from mrwork.identification.minimise.global_search import (
    EXCERPTS,
    OnSearch,
    StartingPoints,
    make_interrupt,
    search_elite,
    trace_of_generations,
)
from mrwork.identification.minimise.level_search import refuse_few_levels, tested_commands
from mrwork.identification.minimise.levenberg_marquardt import LocalMinima
from mrwork.identification.minimise.multistart import minima_from
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of
from mrwork.records.window import varied_excerpt
from mrwork.search import EfficientGA, Optimiser, StopRules

_STARTS = 8
# Generations of the default search. Local minimisations from its elite reached the same minimum after 10 to 80 in all
# runs of normalised_bouc_wen, 6 seeds on 3 records, and in 23 of 24 of normalised_modified_bouc_wen.
_GENERATIONS = 60
# The starts have the nominal rate of the driver's lag times these factors, in turn.
_RATES = (1.0, 0.2, 5.0)
# Force at the command of the least force, relative to that of the largest.
_LEAST_FORCE = 0.1


def scaled_laws(
    spec: DamperSpec, tests: tuple[DamperTest, ...], commands: Floats
) -> Callable[[Floats], Floats]:
    """A function from plain parameters at the mean command, (n_batch, n_plain), to coefficients, (n_batch, n_params).

    Parameters that have a law and scale with the force follow the straight line of the measured force over the command;
    others with a law start constant. Each coefficient is a plain parameter times a factor, or the factor alone.
    """
    assert spec.current is not None
    force = relative_force(spec, tests, commands)
    # The plain parameter of each coefficient; -1 where there is none.
    owner: list[int] = []
    factor: list[float] = []
    for place, (parameter, law) in enumerate(zip(spec.plain, spec.current.laws, strict=True)):
        column = force if parameter.scales_with_force else np.ones_like(force)
        own = fitted_law(law, parameter, commands, column)
        owner += [place] * len(own)
        factor += own
    if spec.current.lagged:
        owner.append(-1)
        factor.append(spec.parameters[-1].nominal)
    for index, parameter in enumerate(spec.parameters):
        if parameter.coefficient is not None and parameter.coefficient.is_exponent:
            owner[index] = -1
    owners, factors, box = np.array(owner), np.array(factor), Box.of(spec)

    def scale(plain: Floats) -> Floats:
        scaled = np.where(owners < 0, 1.0, plain[:, owners]) * factors
        return np.asarray(np.clip(scaled, box.lower, box.upper))

    return scale


def relative_force(spec: DamperSpec, tests: tuple[DamperTest, ...], commands: Floats) -> Floats:
    """Magnitude of the force at these commands relative to its mean over them, from a straight line over the command.

    The line is fitted to the faster half of the samples: near reversals the force is small at any command.
    """
    received, magnitude = [], []
    for test in tests:
        fast = np.abs(test.velocity) >= np.median(np.abs(test.velocity))
        command = np.broadcast_to(np.asarray(loading_of(test, spec).command), test.force.shape)
        received.append(command[fast])
        magnitude.append(np.abs(test.force - test.force.mean())[fast])
    slope, level = np.polyfit(np.concatenate(received), np.concatenate(magnitude), 1)
    line = level + slope * commands
    line = np.maximum(line, _LEAST_FORCE * np.max(line))
    return np.asarray(line / np.mean(line))


def search_of_starts() -> EfficientGA:
    """The default search, which only has to find the basin of the minimum."""
    return EfficientGA(stop=StopRules(max_generations=_GENERATIONS))


def points_from_scaled_forces(
    problem: Problem, search: Optimiser[Any], *, on_search: OnSearch
) -> StartingPoints:
    """Search the plain parameters whose laws, scaled as the measured force is by the command, fit all tests best.

    The search and local minimisations from its elite, in one batch, compare the shortest parts of the tests that show
    every level of the command, see `varied_excerpt`.
    """
    form = problem.form
    tests = problem.objective.tests
    objective = problem.objective.on(form.spec, tuple(varied_excerpt(test) for test in tests))
    commands = tested_commands(form.spec, tests)
    refuse_few_levels(form.spec, len(commands))
    plain, bounds = plain_of(form)
    box = search_box(plain, bounds, tests)
    laws_of = scaled_laws(form.spec, tests, commands)
    joint_form = replace(form, box=joint_box(form, tests, commands))
    on_excerpts = partial(on_search, EXCERPTS)

    def from_unit(unit: Floats) -> Floats:
        theta = laws_of(np.asarray(box.theta_from_unit(unit)))
        return np.clip(theta, joint_form.box.lower, joint_form.box.upper)

    elite = search_elite(
        problem, search, objective, joint_form, from_unit, n_params=len(box.free), on_search=on_excerpts
    )
    starts = from_unit(elite.elite[:_STARTS])
    if form.spec.current is not None and form.spec.current.lagged:
        starts[:, -1] *= np.resize(_RATES, len(starts))
    box = joint_form.box
    starts = np.array([box.inside(start) for start in np.clip(starts, box.lower, box.upper)])
    trace = trace_of_generations(elite)

    def on_iteration(minima: LocalMinima) -> None:
        misfits = minima.misfit[np.isfinite(minima.misfit)]
        on_excerpts(
            len(elite.trace.best) + minima.iterations, float(misfits.min()), float(np.median(misfits)), 1.0
        )

    try:
        theta = minima_from(objective, box, starts, mirrored=joint_form.mirrored, on_iteration=on_iteration)
    except KeyboardInterrupt as interrupt:
        raise make_interrupt(starts[0], objective, joint_form, trace) from interrupt
    return StartingPoints(objective=objective, form=joint_form, theta=theta, trace=trace, minima=True)
