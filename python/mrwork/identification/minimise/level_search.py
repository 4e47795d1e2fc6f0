"""Starting points of a model with current laws: the plain model is fitted at each command, then the laws to all tests.

The laws are searched by their values at commands, which never vanish: a polynomial that has left the admissible range
is limited to it, has no slope there, and no local minimisation returns from that. Where every command varies, no test
shows the plain model alone: its parameters are searched with laws that scale as the measured force does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.arguments import Seed
from mrwork.base.numbers import of_unit
from mrwork.base.remark import Remark
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.spec import DamperSpec, plain_parameters
from mrwork.identification.commands import CommandedTests, excerpts_of, form_through_values
from mrwork.identification.equivalent import (
    Form,
    fitted_coefficients,
    in_other_dependences,
    joint_box,
    leaves_range,
    plain_of,
    search_box,
    widened,
    within_range,
)
from mrwork.identification.fit_progress import EXCERPTS, Identifying, OnSearch, part_of
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.minimise.plain_search import Population, optimise, plain_routes
from mrwork.identification.minimise.polish import StartingPoints, no_simulation
from mrwork.identification.minimise.race import (
    Raced,
    Route,
    best_first,
    distinct_minima,
    minima_from,
    race,
    same_minimum,
)
from mrwork.identification.minimise.varying_search import scaled_dependences
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import Problem
from mrwork.identification.settings import Race, Start
from mrwork.identification.suspicious import far_worse, worse_together
from mrwork.records import DamperTest

if TYPE_CHECKING:
    from mrwork.search import Optimiser

# Tests at a command on which starting points are searched: others refine what these have found.
_PER_COMMAND = 4
# Minima of the plain model that are kept at each command.
_MINIMA = 4
# What the routes of the joint fit are, in words.
_LEVELS = "local minimisations from fits at each command"
_SCALED = "a population of laws in proportion to the measured force"
# The fit of a test alone: starts, from the minima at its command; iterations; decrease of the squared misfit that ends
# it. Joint fits that are several times as bad are looked for, so that it need not be exact.
_OWN_STARTS = 2
_OWN_ITERATIONS = 30
_OWN_TOLERANCE = 1e-4
# Commands whose minimum gives further starts of the joint fit; starts with a minimum at random at each command.
_MOST_SHAPES = 4
_RANDOM_STARTS = 4
# Standard deviation of the logarithm of the random factor on the values to which random starts are fitted.
_SPREAD = 0.25


@array_dataclass()
class LevelFit:
    """Minima of the plain model at one command [A or V], shape (n_minima, n_plain), best first."""

    command: float
    minima: Floats


def at_levels(spec: DamperSpec, theta: Floats, commands: Sequence[float]) -> list[LevelFit]:
    """What laws `theta`, (n_params,), are at commands, as the only minima there."""
    return [
        LevelFit(command=command, minima=plain_parameters(spec, theta, command)[None]) for command in commands
    ]


def points_from_levels(
    problem: Problem, search: Race | Optimiser, *, call: Identifying, near: Start | None = None
) -> StartingPoints:
    """Starting points from fits of the plain model at each constant command, then of the laws to all tests.

    Polynomials are searched by as many values at tested commands, other laws as they are. Some tests of each command
    find the minima; all of them where the others cannot be simulated at these. A fit of the laws `near` which they are
    takes the place of those at each command, unless no other route meets it.
    """
    for per_command in (_PER_COMMAND, None):
        levels = _LevelSearch.of(problem, search, call, per_command)
        if (points := levels.points(near)) is not None:
            return points
    raise no_simulation(problem.form.spec, problem.objective.tally.simulations)


@dataclass(slots=True, kw_only=True)
class _LevelSearch:
    """A search of laws: `fits` at the commands of `levels`, then of laws of the form `joint` to the `searched` tests.

    The laws of the `form` are those that the fit has. `force` is the magnitude of the measured force at each command.
    """

    problem: Problem
    search: Race | Optimiser
    call: Identifying
    form: Form
    joint: Form
    commands: Floats
    levels: dict[float, tuple[DamperTest, ...]]
    on_tests: Objective
    on_searched: Objective
    force: dict[float, float]
    fits: list[LevelFit] = field(default_factory=list)

    @classmethod
    def of(
        cls, problem: Problem, search: Race | Optimiser, call: Identifying, per_command: int | None
    ) -> _LevelSearch:
        """One of `per_command` tests at a command at most, or of all."""
        form, excerpts = problem.form, excerpts_of(problem)
        tested = CommandedTests.of(form.spec, excerpts)
        tested.refuse_few()
        commands = np.array([*tested.at])
        levels = {
            command: unlike_tests(tests, per_command or len(tests)) for command, tests in tested.at.items()
        }
        left_out = {id(test) for tests in tested.at.values() for test in tests} - {
            id(test) for tests in levels.values() for test in tests
        }
        form = replace(form, box=joint_box(form, excerpts, commands))
        joint = form_through_values(form, excerpts, commands)
        on_tests = problem.objective.on(joint.spec, excerpts)
        searched = tuple(test for test in excerpts if id(test) not in left_out)
        return cls(
            problem=problem,
            search=search,
            call=call,
            form=form,
            joint=joint,
            commands=commands,
            levels=levels,
            on_tests=on_tests,
            on_searched=problem.objective.on(joint.spec, searched) if left_out else on_tests,
            force={
                command: float(np.mean([np.std(test.force) for test in tests]))
                for command, tests in levels.items()
            },
        )

    @property
    def settings(self) -> Race:
        """Settings of the search at all commands together: those of the requested race, else the default ones."""
        return self.search if isinstance(self.search, Race) else Race()

    def points(self, near: Start | None) -> StartingPoints | None:
        """The starting points; `None` where some tests were searched, and others cannot be simulated there."""
        rng = self.problem.settings.rng

        def starts(number: int) -> Floats:
            if near is not None and number == 0:
                theta = self.problem.inside([near[name] for name in self.problem.spec.names])
                joint = in_other_dependences(self.form.spec, theta, self.joint.spec, self.commands)
                self.fits = at_levels(self.joint.spec, joint, self.commands.tolist())
                return np.asarray(self.joint.box.inside(joint[None]))
            if number == (near is not None):
                self._fit_levels()
            return self._starts(self.fits, rng + number)

        raced = self._race_joint(starts, rng)
        theta, misfit = self._on_all_tests(raced)
        if not len(theta) or not np.isfinite(misfit[0]):
            if self.on_searched is not self.on_tests:
                return None
            raise no_simulation(self.form.spec, self.on_tests.tally.simulations)
        _, alone = _better_alone(self.problem, self.on_tests, theta[0], self.fits)
        is_limited = bool(leaves_range(self.joint.spec, theta[0], self.commands))
        if alone or is_limited:
            # More starts: each command that has such tests takes the parameters of their own fits.
            fits = []
            for fit in self.fits:
                better = [own.theta for own in alone.values() if own.command == fit.command]
                fits.append(replace(fit, minima=np.array([*better, *fit.minima])))
            more = self._starts(fits, rng + 1)
            if is_limited:
                # No local minimisation returns from a law that is limited to its range.
                more = np.array(
                    [within_range(self.joint.spec, start, self.commands) for start in (theta[0], *more)]
                )
            if self._leads_lower(more, raced):
                again = self._race_joint(lambda number: more if number == 0 else more[:0], rng + 1)
                if len(again.theta) and again.misfit[0] < raced.misfit[0]:
                    raced = again
                    theta, misfit = self._on_all_tests(raced)
        return StartingPoints(
            objective=up_to(
                self.problem.objective.on(self.form.spec, self.on_tests.tests), raced.objective.stiffest
            ),
            form=self.form,
            theta=self._in_own_laws(distinct_minima(self.joint.box, theta, misfit)),
            trace=raced.trace,
            doubt=raced.doubt,
        )

    def _leads_lower(self, starts: Floats, raced: Raced) -> bool:
        """Whether local minimisations from the starts end visibly below the minimum of a race."""
        minima = minima_from(raced.objective, self.joint.box, starts)
        least = float(raced.misfit[0])
        return bool(least > same_minimum(float(np.min(raced.objective(minima), initial=least))))

    def _fit_levels(self) -> None:
        """Fit the plain model at every command, from the middle one on."""
        self.fits = []
        middle = len(self.commands) // 2
        for command in (*self.commands[middle:].tolist(), *self.commands[:middle][::-1].tolist()):
            self.fits.append(self._fit_level(command))
        self.fits.sort(key=lambda fit: fit.command)

    def _race_joint(self, starts: Callable[[int], Floats], seed: int) -> Raced:
        """The laws of all tests, from the starts of each round, and from a population that shares none of them."""
        fitted = EXCERPTS if self.on_searched is self.on_tests else f"{EXCERPTS} of some tests"
        on_search = self._part(fitted, lambda theta: self._in_own_laws(theta[None])[0])
        objective, box = self.on_searched, self.joint.box
        plain, plain_box = plain_of(self.problem.form)
        population = Population(
            objective=objective,
            box=plain_box,
            searched=search_box(plain, plain_box, objective.tests),
            settings=self.settings,
            rng=seed,
            on_search=on_search,
            laws_of=scaled_dependences(self.joint, objective.tests, self.commands),
        )
        return race(
            objective,
            box,
            (Route(name=_LEVELS, draw=starts), Route(name=_SCALED, draw=population.elite)),
            self.settings,
            searched=search_box(self.joint.spec, box, self.on_tests.tests),
            rng=seed,
            on_search=on_search,
        )

    def _on_all_tests(self, raced: Raced) -> tuple[Floats, Floats]:
        """Minima and their misfits on all tests, best first; refined if the search compared some of the tests."""
        if self.on_searched is self.on_tests or not len(raced.theta):
            return raced.theta, raced.misfit
        starts = distinct_minima(self.joint.box, raced.theta, raced.misfit)
        minima = find_minima(
            up_to(self.on_tests, raced.objective.stiffest),
            self.joint.box,
            starts,
            max_iterations=self.settings.most_iterations,
        )
        return best_first(minima.theta, minima.misfit)

    def _in_own_laws(self, theta: Floats) -> Floats:
        """Points of the joint form in the laws of the fit."""
        rows = [in_other_dependences(self.joint.spec, row, self.form.spec, self.commands) for row in theta]
        return np.asarray(self.form.box.inside(np.array(rows)))

    def _part(self, fitted: str, best: Callable[[Floats], Floats]) -> OnSearch:
        """The callback of the next of the searches, which are of the same share of the whole."""
        share = 1.0 / (len(self.levels) + 1)
        return part_of(self.call.on_search, len(self.fits) * share, share, fitted=fitted, best=best)

    def _fit_level(self, command: float) -> LevelFit:
        """Minima of the plain model at one command, by the search and from the minima at the nearest command."""
        tests, search = self.levels[command], self.search
        nearest = min(self.fits, key=lambda fit: abs(fit.command - command), default=None)
        plain, box = plain_of(self.problem.form)
        objective = self.problem.objective.on(plain, tests)
        searched = search_box(plain, box, tests)
        near = widened(searched, box)
        starts = np.empty((0, len(plain.names)))
        if nearest is not None:
            # Each minimum gives two starts: unchanged, and with its forces scaled by the ratio of the measured ones.
            is_force = np.array([parameter.scales_with_force for parameter in plain.parameters])
            ratio = self.force[command] / self.force[nearest.command]
            scaled = np.where(is_force, ratio * nearest.minima, nearest.minima)
            starts = np.concatenate([nearest.minima, scaled])
        rng = self.problem.settings.rng
        unit = self.problem.form.spec.command_unit
        assert unit is not None

        def laws_so_far(theta: Floats) -> Floats:
            """Before a command is done, the best point at the first command gives them."""
            fits = self.fits or [LevelFit(command=command, minima=theta[None])]
            return np.asarray(self._in_own_laws(joint_starts(self.joint.spec, fits, 1, rng=rng))[0])

        on_search = self._part(f"tests at {of_unit(command, unit)}", laws_so_far)
        near_starts = near.inside(starts) if len(starts) else None
        if isinstance(search, Race):
            routes = plain_routes(objective, near, search, rng=rng, on_search=on_search, near=near_starts)[:1]
        else:

            def draw_elite(number: int) -> Floats:
                elite, _ = optimise(search, objective, searched, rng=rng + number, on_search=on_search)
                return np.concatenate([starts, elite])

            routes = (Route(name=search.name, draw=draw_elite),)
        # Stiffer loops are looked for by all tests together, unless fixed parameters make every candidate stiff.
        for each in (up_to(objective, min(friction_limit(tests), objective.stiffest)), objective):
            theta = race(
                each,
                near,
                routes,
                replace(self.settings, most_rounds=1),
                searched=searched,
                rng=rng,
                on_search=on_search,
            ).theta
            if len(theta):
                return LevelFit(command=command, minima=theta[:_MINIMA])
        raise no_simulation(plain, objective.tally.simulations)

    def _starts(self, fits: Sequence[LevelFit], rng: int) -> Floats:
        """Starting laws from the minima at single commands: coefficients, shape (n_starts, n_params).

        First of the best minimum at each command; then one command after the other gives its minimum to all, scaled
        with the measured force, or only its constant parameters; last come the `joint_starts`.
        """
        spec = self.joint.spec
        best = np.array([fit.minima[0] for fit in fits])
        follows = np.array([parameter.name in spec.following for parameter in spec.plain])
        scales = follows & np.array([parameter.scales_with_force for parameter in spec.plain])
        force = np.array([self.force[fit.command] for fit in fits])
        chosen = []
        for index in np.unique(np.linspace(0, len(fits) - 1, _MOST_SHAPES).round().astype(int)):
            ratio = (force / force[index])[:, None]
            chosen.append(np.where(scales, ratio * best[index], best[index]))
            chosen.append(np.where(follows, best, best[index]))
        shapes = [fitted_coefficients(spec, self.commands, values) for values in chosen]
        first, *others = joint_starts(spec, list(fits), 1 + _RANDOM_STARTS, rng=rng)
        return np.array([first, *shapes, *others])


@array_dataclass()
class _OwnFit:
    """Fit of the plain model to one test alone: command, parameters (n_plain,), NRMSE."""

    command: float
    theta: Floats
    nrmse: float


def _better_alone(
    problem: Problem, objective: Objective, theta: Floats, fits: Sequence[LevelFit]
) -> tuple[Floats, dict[int, _OwnFit]]:
    """NRMSE of each test by laws, (n_tests,), and fits to single tests that these describe far worse, by their index.

    The plain model is fitted from the minima at their commands, all in one batch, to tests of constant commands.
    """
    plain, box = plain_of(problem.form)
    joint = np.sqrt(objective.squared_nrmse(theta[None])[0])
    points = CommandedTests.of(problem.form.spec, objective.tests).set_points
    doubtful = far_worse(np.where(np.isnan(points), 0.0, joint), np.zeros(joint.size)).tolist()
    if not doubtful:
        return joint, {}
    tests = tuple(objective.tests[index] for index in doubtful)
    near = widened(search_box(plain, box, tests), box)
    by_command = {fit.command: fit for fit in fits}
    own = [by_command[point] for point in points[doubtful].tolist()]
    starts = [fit.minima[np.arange(_OWN_STARTS) % len(fit.minima)] for fit in own]
    minima = find_minima(
        problem.objective.on(plain, tests),
        near,
        near.inside(np.concatenate(starts)),
        max_iterations=_OWN_ITERATIONS,
        tolerance=_OWN_TOLERANCE,
        shares=np.repeat(np.eye(len(tests)), _OWN_STARTS, axis=0),
    )
    misfit = minima.misfit.reshape(-1, _OWN_STARTS)
    return joint, {
        doubtful[number]: _OwnFit(
            command=own[number].command,
            theta=minima.theta[number * _OWN_STARTS + int(np.argmin(misfit[number]))],
            nrmse=float(misfit[number].min()),
        )
        for number in far_worse(joint[doubtful], misfit.min(axis=1)).tolist()
    }


def better_alone(
    problem: Problem, objective: Objective, theta: Floats, *, suspected: bool
) -> Iterator[Remark]:
    """Warn of the tests that a fit `theta`, (n_params,), describes far worse than their own fits, started there.

    A minimum may be `suspected` to be false.
    """
    spec, tests = problem.form.spec, objective.tests
    fits = at_levels(spec, theta, [*CommandedTests.of(spec, tests).at])
    joint, own = _better_alone(problem, objective, theta, fits)
    if own:
        alone, worse = np.full(len(tests), np.inf), np.array([*own], dtype=np.intp)
        alone[worse] = [fit.nrmse for fit in own.values()]
        yield worse_together(tests, worse, joint, alone, suspected=suspected)


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


def joint_starts(spec: DamperSpec, levels: list[LevelFit], n_starts: int, *, rng: Seed) -> Floats:
    """Starting laws fitted to minima at several commands: coefficients, shape (n_starts, n_params).

    The laws of the first start are fitted to the best minimum at each command, the other laws to a random one,
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
        starts.append(fitted_coefficients(spec, commands, values))
    return np.array(starts)
