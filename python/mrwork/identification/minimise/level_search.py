"""Starting points of a model with current laws: the plain model is fitted at each command, then the laws to all tests.

The laws are searched by their values at commands, which never vanish: a polynomial that has left the admissible range
is limited to it, has no slope there, and no local minimisation returns from that. Where every command varies, no test
shows the plain model alone: its parameters are searched with laws that scale as the measured force does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import Seed, Shape, checked
from mrwork.base.numbers import of_unit
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import command_level, levels_of_command
from mrwork.dampers.coordinates import Box
from mrwork.dampers.laws import CommandLaw, LawName
from mrwork.dampers.spec import DamperSpec, plain_parameters, with_changed_laws
from mrwork.errors import SettingError
from mrwork.identification.equivalent import (
    Form,
    bounds_of,
    fitted_laws,
    identifiable_form,
    joint_box,
    leaves_range,
    levels_needed,
    plain_of,
    search_box,
    with_other_laws,
    within_range,
)
from mrwork.identification.minimise.levenberg_marquardt import LocalMinima, find_minima
from mrwork.identification.minimise.multistart import (
    EXCERPTS,
    MultistartResult,
    OnSearch,
    StartingPoints,
    distinct_minima,
    doubts_about,
    examine_limit,
    far_worse,
    far_worse_sentence,
    friction_warning,
    minima_from,
    nested_fit,
    no_simulation,
    optimise,
    search_starts,
    trace_of,
    trace_of_generations,
)
from mrwork.identification.objective import Objective, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Found, Identifying
from mrwork.identification.settings import Multistart
from mrwork.records import DamperTest
from mrwork.records.damper_test import loading_of
from mrwork.records.window import middle_excerpt, varied_excerpt
from mrwork.search import EfficientGA, Optimiser, StopRules

# Samples of a cycle in the excerpts on which laws are searched: fits differ by 0.02 points from those with 400.
PER_CYCLE = 100
# Tests at a command on which starting points are searched: others refine what these have found.
_PER_COMMAND = 4
# Minima of the plain model that are kept at each command, rounds of their search, and iterations of the others.
_MINIMA = 4
_LEVEL_ROUNDS = 3
_ITERATIONS = 60
# The fit of a test alone: starts, from the minima at its command; iterations; decrease of the squared misfit that ends
# it. Joint fits that are several times as bad are looked for, so that it need not be exact.
_OWN_STARTS = 2
_OWN_ITERATIONS = 30
_OWN_TOLERANCE = 1e-4
# Commands whose minimum gives further starts of the joint fit; starts with a minimum at random at each command.
_MOST_SHAPES = 4
_RANDOM_STARTS = 4
# Local minimisations at one command may leave the searched range by this factor only: laws are fitted to the minima,
# and an insensitive parameter at the end of its admissible range would distort them.
_RANGE_FACTOR = 10.0
# Standard deviation of the logarithm of the random factor on the values to which random starts are fitted.
_SPREAD = 0.25


@checked
@array_dataclass(repr=False)
class LevelFit(Summarised):
    """Minima of the plain model at one command [A or V], shape (n_minima, n_plain), best first."""

    command: float
    minima: Annotated[Floats, Shape(("n_minima", "n_plain"))]


def points_of_laws(problem: Problem, search: Multistart | Optimiser, *, call: Identifying) -> StartingPoints:
    """Starting points from the tests at constant commands if these determine the laws, else from all tests."""
    if has_levels(problem.form.spec, problem.objective.tests):
        return points_from_levels(problem, search, call=call)
    if isinstance(search, Multistart):
        # It only has to find the basin of the minimum.
        search = EfficientGA(stop=StopRules(max_generations=_GENERATIONS))
    return points_from_scaled_forces(problem, search, call=call)


def excerpts_of_laws(problem: Problem) -> tuple[DamperTest, ...]:
    """The parts of the tests on which laws are searched, and their fit is examined."""
    tests = problem.objective.tests
    if has_levels(problem.form.spec, tests):
        return tuple(middle_excerpt(test, per_cycle=PER_CYCLE) for test in tests)
    return tuple(varied_excerpt(test) for test in tests)


def points_from_levels(
    problem: Problem,
    search: Multistart | Optimiser,
    *,
    call: Identifying,
    per_command: int | None = _PER_COMMAND,
) -> StartingPoints:
    """Starting points from fits of the plain model at each constant command, then of the laws to all tests.

    Polynomials are searched by as many values at tested commands, other laws as they are. At most `per_command` tests
    of a command find the minima; all of them where the others cannot be simulated at these.
    """
    objective, form, rng = problem.objective, problem.form, problem.settings.rng
    excerpts = excerpts_of_laws(problem)
    constant = levels_of(form.spec, [test for test in excerpts if command_is_constant(test, form.spec)])
    commands = np.array(sorted(constant))
    levels = {command: unlike_tests(tests, per_command or len(tests)) for command, tests in constant.items()}
    left_out = {id(test) for tests in constant.values() for test in tests} - {
        id(test) for tests in levels.values() for test in tests
    }
    searched = tuple(test for test in excerpts if id(test) not in left_out)
    own_form = replace(form, box=joint_box(form, excerpts, commands))
    joint = form_through_values(own_form, excerpts, commands)
    settings = search if isinstance(search, Multistart) else Multistart()
    relative = {
        command: float(np.mean([np.std(test.force) for test in tests])) for command, tests in levels.items()
    }
    fits: list[LevelFit] = []
    n_parts = len(levels) + 1

    def at_level(command: float, fitted: str, found: Found) -> None:
        """Before a command is done, the laws so far are those of the best point at the first."""

        def best() -> Floats:
            known = fits or [LevelFit(command=command, minima=found.best()[None])]
            return np.asarray(in_own_laws(joint_starts(joint.spec, known, 1, rng=rng))[0])

        call.on_search(fitted, replace(found, best=best, share=(len(fits) + found.share) / n_parts))

    def together(found: Found) -> None:
        fitted = f"{EXCERPTS} of some tests" if left_out else EXCERPTS
        own = replace(
            found,
            best=lambda: in_own_laws(found.best()[None])[0],
            share=(len(fits) + found.share) / n_parts,
        )
        call.on_search(fitted, own)

    def in_own_laws(theta: Floats) -> Floats:
        rows = [with_other_laws(joint.spec, row, form.spec, commands) for row in theta]
        return _move_inside(own_form.box, np.array(rows))

    on_tests = objective.on(joint.spec, excerpts)
    on_searched = objective.on(joint.spec, searched) if left_out else on_tests

    def search_joint(starts: Floats, seed: int) -> MultistartResult:
        return search_starts(
            on_searched,
            joint.box,
            search_box(joint.spec, joint.box, excerpts),
            replace(settings, least_rounds=1),
            rng=seed,
            mirrored=joint.mirrored,
            nested=_move_inside(joint.box, starts),
            on_search=together,
        )

    def on_all_tests(result: MultistartResult) -> tuple[Floats, Floats]:
        """Minima and their misfits on all tests, best first; refined if the search compared some of the tests."""
        if not left_out or not len(result.theta):
            return result.theta, result.misfit
        starts = distinct_minima(joint.box, result.theta, result.misfit)
        minima = find_minima(on_tests, joint.box, starts, max_iterations=settings.most_iterations)
        order = np.argsort(minima.misfit, kind="stable")
        return minima.theta[order], minima.misfit[order]

    suspected = False
    middle = len(commands) // 2
    for command in (*commands[middle:].tolist(), *commands[:middle][::-1].tolist()):
        nearest = min(fits, key=lambda fit: abs(fit.command - command), default=None)
        fits.append(
            _fit_level(
                problem,
                levels[command],
                command,
                nearest,
                relative,
                search,
                on_search=partial(at_level, command),
            )
        )
    fits.sort(key=lambda fit: fit.command)
    starts = _starts_of_levels(joint.spec, fits, relative, rng)
    alone = _fit_each(problem, excerpts, fits)
    result = search_joint(starts, rng)
    theta, misfit = on_all_tests(result)
    is_simulated = not len(theta) or bool(np.isfinite(misfit[0]))
    worse = alone.worse_in(on_tests, theta)
    is_limited = len(theta) > 0 and leaves_range(joint.spec, theta[0], commands)
    if len(theta) and is_simulated and (worse.size or is_limited):
        # More starts: each command that has such tests takes the parameters of their own fits.
        more = _starts_of_levels(joint.spec, alone.at(worse, fits), relative, rng + 1)
        if is_limited:
            # No local minimisation returns from a law that is limited to its range.
            more = np.array([within_range(joint.spec, start, commands) for start in (theta[0], *more)])
        result = _merge_searches(result, search_joint(more, rng + 1))
        theta, misfit = on_all_tests(result)
        worse = alone.worse_in(on_tests, theta)
        if worse.size:
            least = (1.0 + settings.closeness) * result.misfit[0]
            suspected = int(np.count_nonzero(result.misfit <= least)) < settings.found
    if left_out and not is_simulated:
        return points_from_levels(problem, search, call=call, per_command=None)
    if not len(theta):
        raise no_simulation(form.spec, result.evaluations[-1])
    return StartingPoints(
        objective=objective.on(form.spec, excerpts),
        form=own_form,
        theta=in_own_laws(distinct_minima(joint.box, theta, misfit)),
        trace=trace_of(result),
        minima=True,
        warnings=doubts_about(result, None, settings),
        is_suspected=suspected,
    )


@array_dataclass()
class _OwnFits:
    """Fits of the plain model to each test alone: command, parameters (n_tests, n_plain), NRMSE; NaN if it varies."""

    command: Floats
    theta: Floats
    nrmse: Floats

    def worse_in(self, objective: Objective, theta: Floats) -> NDArray[np.intp]:
        """Indices of the tests whose NRMSE at the first minimum is far above that of their own fits."""
        if not len(theta):
            return np.empty(0, dtype=np.intp)
        return far_worse(objective.nrmse_of_tests(theta[:1])[:, 0], self.nrmse)

    def at(self, tests: NDArray[np.intp], fits: Sequence[LevelFit]) -> list[LevelFit]:
        """Minima at each command, those of these tests alone first."""
        levels = []
        for fit in fits:
            own = self.theta[[index for index in tests if self.command[index] == fit.command]]
            levels.append(LevelFit(command=fit.command, minima=np.concatenate([own, fit.minima])))
        return levels


def _fit_each(problem: Problem, tests: tuple[DamperTest, ...], fits: Sequence[LevelFit]) -> _OwnFits:
    """Fits of the plain model to each test alone, started at the minima of its command."""
    plain, box = plain_of(problem.form)
    theta = np.full((len(tests), len(plain.names)), np.nan)
    command, nrmse = np.full(len(tests), np.nan), np.full(len(tests), np.nan)
    for index, test in enumerate(tests):
        if not command_is_constant(test, problem.form.spec):
            continue
        own = float(np.mean(np.asarray(loading_of(test, problem.form.spec).command)))
        fit = min(fits, key=lambda fit: abs(fit.command - own))
        searched = search_box(plain, box, (test,))
        near = _widen_box(searched, box)
        minima = find_minima(
            problem.objective.on(plain, (test,)),
            near,
            _move_inside(near, fit.minima[:_OWN_STARTS]),
            max_iterations=_OWN_ITERATIONS,
            tolerance=_OWN_TOLERANCE,
        )
        least = int(np.argmin(minima.misfit))
        command[index], theta[index], nrmse[index] = fit.command, minima.theta[least], minima.misfit[least]
    return _OwnFits(command=command, theta=theta, nrmse=nrmse)


def worse_together(
    problem: Problem, objective: Objective, theta: Floats, *, suspected: bool
) -> tuple[str, ...]:
    """Sentence on the tests that a fit `theta`, (n_params,), describes far worse than their own fits, started there.

    A minimum may be `suspected` to be false.
    """
    spec, tests = problem.form.spec, objective.tests
    joint, alone = objective.nrmse_of_tests(theta[None])[:, 0], np.full(len(tests), np.nan)
    levels = _group_by_level(spec, [test for test in tests if command_is_constant(test, spec)])
    fits = [LevelFit(command=each, minima=plain_parameters(spec, theta, each)[None]) for each in levels]
    doubtful = far_worse(joint, np.zeros(len(tests)))
    alone[doubtful] = _fit_each(problem, tuple(tests[index] for index in doubtful), fits).nrmse
    worse = far_worse(joint, alone)
    sentence = far_worse_sentence(tests, worse, joint, alone, found_again=not suspected)
    return (sentence,) if worse.size else ()


def unlike_tests(tests: Sequence[DamperTest], most: int) -> tuple[DamperTest, ...]:
    """Subset of at most `most` tests whose strokes and velocities differ most, in their order.

    The first has the largest velocity, each further one is the farthest from all before in the logarithms of both.
    """
    if len(tests) <= most:
        return tuple(tests)
    extents = [[np.ptp(test.displacement), np.abs(test.velocity).max()] for test in tests]
    size = np.log(np.maximum(extents, np.finfo(np.float64).tiny))
    taken = [int(np.argmax(size[:, 1]))]
    while len(taken) < most:
        distance = np.linalg.norm(size[:, None] - size[taken], axis=2).min(axis=1)
        # A motion that is repeated has no distance from itself.
        distance[taken] = -1.0
        taken.append(int(np.argmax(distance)))
    return tuple(tests[index] for index in sorted(taken))


def _merge_searches(first: MultistartResult, second: MultistartResult) -> MultistartResult:
    theta, misfit = np.concatenate([first.theta, second.theta]), np.concatenate([first.misfit, second.misfit])
    order = np.argsort(misfit, kind="stable")
    return MultistartResult(
        theta=theta[order],
        misfit=misfit[order],
        stop_reason=second.stop_reason,
        evaluations=(*first.evaluations, *second.evaluations),
        best=(*first.best, *(min(first.best[-1], best) for best in second.best)),
        median=(*first.median, *second.median),
    )


def spec_by_values(spec: DamperSpec, commands: Floats) -> DamperSpec:
    """The model with its polynomial laws written by as many values at tested commands; other laws stay.

    Positive parameters are then interpolated in their logarithms: on measured tests the force at commands between those
    that were fitted is predicted better, by up to four points in the mean and ten in the worst test.
    """
    return with_changed_laws(spec, _laws_at(spec, commands, logarithms=True))


def _laws_at(spec: DamperSpec, commands: Floats, *, logarithms: bool) -> dict[str, CommandLaw]:
    return {
        name: law.at_commands(commands.tolist(), logarithms=logarithms)
        for name, law in spec.laws_by_name.items()
    }


def tested_commands(spec: DamperSpec, tests: Sequence[DamperTest]) -> Floats:
    """Commands of all tests in the unit of the laws, and levels of varying ones, shape (n_commands,), lowest first."""
    unit = spec.command_unit or "A"
    commands = (loading_of(test, spec).command for test in tests)
    known = [command for command in commands if command is not None]
    return np.array(
        sorted({command_level(level, unit) for command in known for level in levels_of_command(command)})
    )


def form_through_values(form: Form, tests: tuple[DamperTest, ...], commands: Floats) -> Form:
    """The form with each polynomial law written by its values at tested commands; other bounds stay."""
    spec = with_changed_laws(form.spec, _laws_at(form.spec, commands, logarithms=False))
    if spec == form.spec:
        return form
    through = identifiable_form(spec, bounds_of(form.box, spec.names))
    return replace(through, box=joint_box(through, tests, commands))


def has_levels(spec: DamperSpec, tests: Sequence[DamperTest]) -> bool:
    """Whether the tests at constant commands determine the laws, or there are no others."""
    constant = [test for test in tests if command_is_constant(test, spec)]
    return len(constant) == len(tests) or len(_group_by_level(spec, constant)) >= levels_needed(spec)


def command_is_constant(test: DamperTest, spec: DamperSpec) -> bool:
    """Whether the command of a test in the unit of the model is constant."""
    return not isinstance(loading_of(test, spec).command, np.ndarray)


def _group_by_level(spec: DamperSpec, tests: Sequence[DamperTest]) -> dict[float, tuple[DamperTest, ...]]:
    commands = [float(np.mean(np.asarray(loading_of(test, spec).command))) for test in tests]
    unit = spec.command_unit or "A"
    level_of = [command_level(command, unit) for command in commands]
    return {
        level: tuple(test for test, own in zip(tests, level_of, strict=True) if own == level)
        for level in sorted(set(level_of))
    }


def levels_of(spec: DamperSpec, tests: Sequence[DamperTest]) -> dict[float, tuple[DamperTest, ...]]:
    """The tests at each command, lowest first."""
    levels = _group_by_level(spec, tests)
    if spec.command_unit is not None:
        refuse_few_levels(spec, len(levels))
    return levels


def count_levels(spec: DamperSpec, tests: Sequence[DamperTest]) -> int:
    """Number of distinct commands from which a search of these tests determines the laws."""
    if has_levels(spec, tests):
        return len(_group_by_level(spec, [test for test in tests if command_is_constant(test, spec)]))
    return len(tested_commands(spec, tests))


def refuse_few_levels(spec: DamperSpec, n_levels: int) -> None:
    """Refuse laws with more coefficients than there are commands."""
    if n_levels < levels_needed(spec):
        raise SettingError(
            f"the tests run at {n_levels} command(s), the current laws need {levels_needed(spec)}; "
            "add tests at other commands, or choose laws of a lower degree"
        )


def _fit_level(
    problem: Problem,
    tests: tuple[DamperTest, ...],
    command: float,
    nearest: LevelFit | None,
    relative: Mapping[float, float],
    search: Multistart | Optimiser,
    *,
    on_search: OnSearch,
) -> LevelFit:
    """Minima of the plain model at one command, by the search and from the minima at the nearest command.

    `relative` has the magnitude of the measured force at each command.
    """
    plain, box = plain_of(problem.form)
    objective = problem.objective.on(plain, tests)
    searched = search_box(plain, box, tests)
    near = _widen_box(searched, box)
    starts = np.empty((0, len(plain.names)))
    if nearest is not None:
        # Each minimum gives two starts: unchanged, and with its forces scaled by the ratio of the measured ones.
        is_force = np.array([parameter.scales_with_force for parameter in plain.parameters])
        ratio = relative[command] / relative[nearest.command]
        scaled = np.where(is_force, ratio * nearest.minima, nearest.minima)
        starts = np.concatenate([nearest.minima, scaled])
    rng = problem.settings.rng
    spec = problem.form.spec
    assert spec.command_unit is not None
    at_command = f"at {of_unit(command, spec.command_unit)}"
    if isinstance(search, Multistart):
        settings = replace(search, least_rounds=1, most_rounds=min(search.most_rounds, _LEVEL_ROUNDS))
        nested = None
        if not len(starts):
            nested = nested_fit(
                objective,
                near,
                settings,
                rng=rng,
                on_search=lambda model, found: on_search(f"{model} {at_command}", found),
            )
        theta = search_starts(
            objective,
            near,
            searched,
            settings,
            rng=rng,
            nested=_move_inside(near, starts) if nested is None else nested.starts,
            on_search=partial(on_search, at_command),
        ).theta
    else:
        ended = optimise(
            search,
            objective,
            searched.theta_from_unit,
            n_params=len(searched.free),
            rng=rng,
            on_search=partial(on_search, at_command),
        )
        starts = _move_inside(near, np.concatenate([starts, searched.theta_from_unit(ended.elite)]))
        minima = find_minima(objective, near, starts, max_iterations=_ITERATIONS)
        theta = minima.theta[np.argsort(minima.misfit, kind="stable")]
    if not len(theta):
        raise no_simulation(plain, objective.tally.simulations)
    return LevelFit(command=command, minima=theta[:_MINIMA])


def _move_inside(box: Box, theta: Floats) -> Floats:
    return np.asarray(box.inside(np.clip(theta, box.lower, box.upper)))


def _widen_box(searched: Box, box: Box) -> Box:
    """The searched range widened by `_RANGE_FACTOR`, within the box."""
    bounds = {}
    for index, name in enumerate(searched.names):
        lower, upper = searched.lower[index], searched.upper[index]
        if searched.log[index]:
            lower, upper = lower / _RANGE_FACTOR, upper * _RANGE_FACTOR
        else:
            middle, half = (lower + upper) / 2, (upper - lower) / 2
            lower, upper = middle - _RANGE_FACTOR * half, middle + _RANGE_FACTOR * half
        bounds[name] = (max(lower, box.lower[index]), min(upper, box.upper[index]))
    return box.with_bounds(bounds)


def _starts_of_levels(
    spec: DamperSpec, fits: Sequence[LevelFit], relative: Mapping[float, float], rng: int
) -> Floats:
    """Starting laws from the minima at single commands: coefficients, shape (n_starts, n_params).

    First of the best minimum at each command; then one command after the other gives its minimum to all, scaled with
    the measured force, or only its constant parameters; last those of `joint_starts`.
    """
    commands = np.array([fit.command for fit in fits])
    best = np.array([fit.minima[0] for fit in fits])
    follows = np.array([parameter.name in spec.following for parameter in spec.plain])
    scales = follows & np.array([parameter.scales_with_force for parameter in spec.plain])
    force = np.array([relative[fit.command] for fit in fits])
    chosen = []
    for place in np.unique(np.linspace(0, len(fits) - 1, _MOST_SHAPES).round().astype(int)):
        ratio = (force / force[place])[:, None]
        chosen.append(np.where(scales, ratio * best[place], best[place]))
        chosen.append(np.where(follows, best, best[place]))
    shapes = [fitted_laws(spec, commands, values) for values in chosen]
    first, *others = joint_starts(spec, list(fits), 1 + _RANDOM_STARTS, rng=rng)
    return np.array([first, *shapes, *others])


def joint_starts(spec: DamperSpec, levels: list[LevelFit], n_starts: int, *, rng: Seed) -> Floats:
    """Starting laws fitted to minima at several commands: coefficients, shape (n_starts, n_params).

    The laws of the first start are fitted to the best minimum at each command, those of the others to a random one,
    each parameter multiplied by a log-normal factor (standard deviation of the logarithm 0.25).
    """
    random = np.random.default_rng([rng, n_starts])
    commands = np.array([level.command for level in levels])
    starts = []
    for start in range(n_starts):
        values = np.array(
            [level.minima[0 if start == 0 else random.integers(len(level.minima))] for level in levels]
        )
        if start > 0:
            values = values * np.exp(_SPREAD * random.standard_normal(values.shape))
        starts.append(fitted_laws(spec, commands, values))
    return np.array(starts)


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
# Force at the command of the least force, relative to that of the largest.
_LEAST_FORCE = 0.1


def scaled_laws(
    spec: DamperSpec, tests: tuple[DamperTest, ...], commands: Floats
) -> Callable[[Floats], Floats]:
    """Map from plain parameters at the mean command, (n_batch, n_plain), to coefficients, (n_batch, n_params).

    Parameters that have a law and scale with the force follow the straight line of the measured force over the command;
    others with a law start constant. Each coefficient is a plain parameter times a factor, or the factor alone.
    """
    force = relative_force(spec, tests, commands)
    # The plain parameter of each coefficient; -1 where there is none.
    owner: list[int] = []
    factor: list[float] = []
    for place, (parameter, law) in enumerate(spec.law_pairs):
        column = force if parameter.scales_with_force else np.ones_like(force)
        own = law.through(parameter, commands, column)
        owner += [place] * len(own)
        factor += own
    if spec.lagged:
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


def points_from_scaled_forces(problem: Problem, search: Optimiser, *, call: Identifying) -> StartingPoints:
    """Starting points by a search of plain parameters, with laws in proportion to the measured force.

    The search and local minimisations from its elite, in one batch, compare the shortest parts of the tests that show
    every level of the command, see `varied_excerpt`. Stiff candidates cost most and are rarely better: they are left
    out by a limit of the sub-steps a second, which is raised while that pays. The final fit keeps it.
    """
    form = problem.form
    tests = problem.objective.tests
    objective = problem.objective.on(form.spec, excerpts_of_laws(problem))
    shortest = min(test.dt for test in objective.tests)
    objective = up_to(objective, _FIRST_SUBSTEPS / shortest)
    commands = tested_commands(form.spec, tests)
    refuse_few_levels(form.spec, len(commands))
    plain, bounds = plain_of(form)
    box = search_box(plain, bounds, tests)
    laws_of = scaled_laws(form.spec, tests, commands)
    joint_form = replace(form, box=joint_box(form, tests, commands))

    def from_unit(unit: Floats) -> Floats:
        theta = laws_of(np.asarray(box.theta_from_unit(unit)))
        return np.clip(theta, joint_form.box.lower, joint_form.box.upper)

    elite = optimise(
        search,
        objective,
        from_unit,
        n_params=len(box.free),
        rng=problem.settings.rng,
        on_search=partial(call.on_search, EXCERPTS),
    )
    starts = from_unit(elite.elite[:_SCALED_STARTS])
    if form.spec.lagged:
        starts[:, -1] *= np.resize(_RATES, len(starts))
    box = joint_form.box
    starts = np.array([box.inside(start) for start in np.clip(starts, box.lower, box.upper)])
    trace = trace_of_generations(elite)

    def on_iteration(minima: LocalMinima) -> None:
        misfits = minima.misfit[np.isfinite(minima.misfit)]
        found = Found(
            best=lambda: minima.theta[int(np.argmin(minima.misfit))],
            trace=trace,
            iteration=len(elite.trace.best) + minima.iterations,
            misfit=float(misfits.min()),
            median=float(np.median(misfits)),
            share=1.0,
        )
        call.on_search(EXCERPTS, found)

    theta = minima_from(objective, box, starts, mirrored=joint_form.mirrored, on_iteration=on_iteration)
    # Long records: only a share of the misfit pays for stiffer loops, whatever it is in points.
    objective, theta = examine_limit(
        objective, joint_form, theta, raised=_RAISED, points=math.inf, on_iteration=on_iteration
    )
    return StartingPoints(
        objective=objective,
        form=joint_form,
        theta=theta,
        trace=trace,
        minima=True,
        warnings=friction_warning(objective, joint_form, theta),
    )


def laws_to_type(plain: DamperSpec, given: Mapping[str, LawName | CommandLaw], commands: Floats) -> str:
    """Options that let the dampings and yield forces of a model follow these commands, beside the laws given."""
    own = {
        each.name: "linear" if each.unit == "N s/m" or len(commands) < 3 else "quadratic"
        for each in plain.parameters
        if each.scale == "log" and each.unit in ("N", "N s/m")
    }
    laws = " ".join(f"--law {name}={law}" for name, law in {**own, **given}.items())
    return f"--model {plain.name} {laws}"
