"""Starting points of laws where every command varies: plain parameters are searched with laws that scale as the force.

No test shows the plain model alone then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers.parameters import DRIVER_RATES
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.commands import CommandedTests, excerpts_of
from mrwork.identification.equivalent import Form, joint_box, plain_of, search_box, widened
from mrwork.identification.fit_progress import EXCERPTS, Identifying, part_of
from mrwork.identification.minimise.plain_search import POPULATION, SAMPLES, Population, alone_doubt, optimise
from mrwork.identification.minimise.polish import StartingPoints
from mrwork.identification.minimise.race import Route, draw_samples, race
from mrwork.identification.problem import Problem
from mrwork.identification.settings import Race
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of
from mrwork.search import Optimiser

# The starts have the nominal rate of the driver's lag times these factors, in turn.
_RATES = (1.0, 0.2, 5.0)
# Least force over the commands, relative to the largest.
_LEAST_FORCE = 0.1


def scaled_dependences(
    form: Form, tests: tuple[DamperTest, ...], commands: Floats
) -> Callable[[Floats], Floats]:
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
    for rate in DRIVER_RATES[spec.lag]:
        owner.append(-1)
        factor.append(rate.nominal)
    for index, parameter in enumerate(spec.parameters):
        if parameter.coefficient is not None and parameter.coefficient.is_rate:
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
    problem: Problem, search: Race | Optimiser, *, call: Identifying
) -> StartingPoints:
    """Starting points by a race of searches of plain parameters, with laws in proportion to the measured force.

    It compares the shortest parts of the tests that show every level of the command, see `varied_excerpt`.
    """
    spec, tests, rng = problem.form.spec, problem.objective.tests, problem.settings.rng
    objective = problem.objective.on(spec, excerpts_of(problem))
    tested = CommandedTests.of(spec, tests)
    tested.refuse_few()
    plain, box = plain_of(problem.form)
    searched = search_box(plain, box, tests)
    wide = widened(searched, box)
    form = replace(problem.form, box=joint_box(problem.form, tests, tested.commands))
    laws_of = scaled_dependences(form, tests, tested.commands)
    on_search = part_of(call.on_search, 0.0, 1.0, fitted=EXCERPTS)
    settings = search if isinstance(search, Race) else Race(most_rounds=1)

    def with_rates(starts: Floats) -> Floats:
        starts[:, starts.shape[1] - spec.n_rates :] *= np.resize(_RATES, (len(starts), 1))
        return starts

    def draw_local(number: int) -> Floats:
        return with_rates(
            draw_samples(objective, form.box, wide, settings, rng=rng, number=number, laws_of=laws_of)
        )

    population = Population(
        objective=objective,
        box=box,
        searched=searched,
        settings=settings,
        rng=rng,
        on_search=on_search,
        laws_of=laws_of,
    )

    def draw_population(number: int) -> Floats:
        if isinstance(search, Race):
            return with_rates(population.elite(number))
        elite, _ = optimise(search, objective, searched, rng=rng, on_search=on_search, laws_of=laws_of)
        return with_rates(elite)

    routes = (Route(name=SAMPLES, draw=draw_local), Route(name=POPULATION, draw=draw_population))
    raced = race(
        objective,
        form.box,
        routes if isinstance(search, Race) else routes[1:],
        settings,
        searched=search_box(spec, form.box, tests),
        rng=rng,
        whole=problem.objective,
        on_search=on_search,
    )
    points = StartingPoints.of_race(raced, form)
    return points if isinstance(search, Race) else replace(points, doubt=alone_doubt(search))
