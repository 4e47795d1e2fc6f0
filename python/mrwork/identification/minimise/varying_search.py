"""Starting points of laws where every command varies: plain parameters are searched with laws that scale as the force.

No test shows the plain model alone then.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.commands import excerpts_of, refuse_few_levels, tested_commands
from mrwork.identification.equivalent import Form, joint_box, plain_of, search_box
from mrwork.identification.minimise.friction import examine_limit, friction_warning
from mrwork.identification.minimise.multistart import EXCERPTS, minima_from, report_minima
from mrwork.identification.minimise.plain_search import optimise
from mrwork.identification.minimise.polish import StartingPoints
from mrwork.identification.objective import up_to
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Identifying, part_of
from mrwork.identification.settings import Multistart
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of
from mrwork.search import EfficientGA, Optimiser, StopRules

# Points of the elite from which laws are fitted where every command varies.
_SCALED_STARTS = 8
# Generations of the default search. Local minimisations from its elite reached the same minimum after 10 to 80 in all
# runs of normalised_bouc_wen, 6 seeds on 3 records, and in 23 of 24 of normalised_modified_bouc_wen.
_GENERATIONS = 60
# The starts have the nominal rate of the driver's lag times these factors, in turn.
_RATES = (1.0, 0.2, 5.0)
# Most sub-steps of a candidate in a shortest step of the parts, and the factor by which this limit is raised.
_FIRST_SUBSTEPS = 8
_RAISED = 4.0
# Least force over the commands, relative to the largest.
_LEAST_FORCE = 0.1


def scaled_laws(form: Form, tests: tuple[DamperTest, ...], commands: Floats) -> Callable[[Floats], Floats]:
    """Map from plain parameters at the mean command, (n_batch, n_plain), to coefficients, (n_batch, n_params).

    Parameters that have a law and scale with the force follow the straight line of the measured force over the command;
    others with a law start constant. Each coefficient is a plain parameter times a factor, or the factor alone.
    """
    spec, force = form.spec, relative_force(form.spec, tests, commands)
    # The plain parameter of each coefficient, -1 for none.
    owner: list[int] = []
    factor: list[float] = []
    for index, (parameter, law) in enumerate(spec.law_pairs):
        column = force if parameter.scales_with_force else np.ones_like(force)
        coefficients = law.through(parameter, commands, column)
        owner += [index] * len(coefficients)
        factor += coefficients
    if spec.lagged:
        owner.append(-1)
        factor.append(spec.parameters[-1].nominal)
    for index, parameter in enumerate(spec.parameters):
        if parameter.coefficient is not None and parameter.coefficient.is_exponent:
            owner[index] = -1
    owners, factors = np.array(owner), np.array(factor)

    def scale(plain: Floats) -> Floats:
        scaled = np.where(owners < 0, 1.0, plain[:, owners]) * factors
        return np.asarray(np.clip(scaled, form.box.lower, form.box.upper))

    return scale


def relative_force(spec: DamperSpec, tests: tuple[DamperTest, ...], commands: Floats) -> Floats:
    """Force magnitude at these commands over its mean, by linear regression on the command.

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


def points_from_scaled_forces(
    problem: Problem, search: Multistart | Optimiser, *, call: Identifying
) -> StartingPoints:
    """Starting points by a search of plain parameters, with laws in proportion to the measured force.

    The search and local minimisations from its elite, in one batch, compare the shortest parts of the tests that show
    every level of the command, see `varied_excerpt`. Stiff candidates cost most and are rarely better: they are left
    out by a limit of the sub-steps a second, which is raised while that pays. The final fit keeps it.
    """
    if isinstance(search, Multistart):
        # It only has to find the basin of the minimum.
        search = EfficientGA(stop=StopRules(max_generations=_GENERATIONS))
    spec, tests = problem.form.spec, problem.objective.tests
    objective = problem.objective.on(spec, excerpts_of(problem))
    shortest = min(test.dt for test in objective.tests)
    objective = up_to(objective, _FIRST_SUBSTEPS / shortest)
    commands = tested_commands(spec, tests)
    refuse_few_levels(spec, len(commands))
    searched = search_box(*plain_of(problem.form), tests)
    form = replace(problem.form, box=joint_box(problem.form, tests, commands))
    laws_of = scaled_laws(form, tests, commands)
    elite, trace = optimise(
        search,
        objective,
        lambda unit: laws_of(np.asarray(searched.theta_from_unit(unit))),
        n_params=len(searched.free),
        rng=problem.settings.rng,
        on_search=part_of(call.on_search, 0.0, 1.0, fitted=EXCERPTS),
    )
    starts = elite[:_SCALED_STARTS]
    if spec.lagged:
        starts[:, -1] *= np.resize(_RATES, len(starts))
    on_iteration = partial(report_minima, call, EXCERPTS, trace)
    starts = np.asarray(form.box.inside(starts))
    theta = minima_from(objective, form.box, starts, mirrored=form.mirrored, on_iteration=on_iteration)
    # Long records: only a share of the misfit pays for stiffer loops, whatever it is in points.
    objective, theta = examine_limit(
        objective, form, theta, raised=_RAISED, points=math.inf, on_iteration=on_iteration
    )
    return StartingPoints(
        objective=objective,
        form=form,
        theta=theta,
        trace=trace,
        warnings=friction_warning(objective, form, theta),
    )
