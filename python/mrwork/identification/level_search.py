"""Starting points of a model with current laws: the plain model is fitted at each command, then the laws to these."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import LawName, current_laws
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import Interrupted, SettingError
from mrwork.identification.equivalent import Form
from mrwork.identification.global_search import (
    OnSearch,
    StartingPoints,
    generation_reporter,
    interrupted_at,
    joined_trace,
    optimise_in_box,
    refuse_empty_elite,
)
from mrwork.identification.levenberg_marquardt import LocalMinimum, find_minimum
from mrwork.identification.objective import Objective
from mrwork.identification.problem import Problem
from mrwork.identification.search_ranges import search_box
from mrwork.records import DamperTest
from mrwork.records.command import command_level
from mrwork.records.window import excerpt
from mrwork.search import Optimiser, SearchResult
from mrwork.search.loop import GenerationEvent
from mrwork.simulate import loading_of
from mrwork.summary import Summarised

# Starting points of the joint fit.
_JOINT_STARTS = 8
# Local minimisations at each command: number of starts, evaluations of each; number of minima that are refined,
# evaluations of each of these.
_STARTS = 12
_EVALUATIONS = 15
_MINIMA = 5
_LAST_EVALUATIONS = 60
# Local minimisations at one command may leave the searched range by this factor only: laws are fitted to the minima,
# and an insensitive parameter at the end of its admissible range would distort them.
_RANGE_FACTOR = 10.0
# Standard deviation of the logarithm of the random factor on the values to which laws of further starts are fitted.
_SPREAD = 0.25
# Largest exponent of a law [1/A or 1/V], either sign.
_EXPONENT = 5.0
# Coefficients may reach this multiple of the range that is searched.
_MARGIN = 10.0


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LevelFit(Summarised):
    """Minima of the plain model at one command [A or V], shape (n_minima, n_plain), best first; the search, if any."""

    command: float
    minima: NDArray[np.float64]
    search: SearchResult[Any] | None


def points_from_levels(problem: Problem, search: Optimiser[Any], *, on_search: OnSearch) -> StartingPoints:
    """Fit the plain model at each command, then the laws to the minima.

    The global search runs at the middle command only; at each other command local minimisations start from the minima
    at the neighbouring one.

    Raises
    ------
    SimulationError
        Where no candidate could be simulated.
    Interrupted
        On Ctrl-C, carrying `StartingPoints` with one point, the laws fitted to the minima so far; `None` where there
        are none.
    """
    objective, form, rng = problem.objective, problem.form, problem.settings.rng
    excerpts = tuple(excerpt(test) for test in objective.tests)
    plain = damper(form.spec.name)
    box = Box.of(plain).with_bounds(
        {
            name: (form.box.lower[index], form.box.upper[index])
            for index, name in enumerate(form.box.names)
            if name in plain.names
        }
    )
    levels = levels_of(form.spec, excerpts)
    commands = sorted(levels)
    fits: list[LevelFit] = []
    searches: list[SearchResult[Any]] = []

    def at(command: float) -> Objective:
        return objective.on(plain, levels[command])

    middle = len(commands) // 2
    try:
        first = search_level(
            at(commands[middle]),
            box,
            commands[middle],
            search=search,
            rng=rng,
            on_generation=generation_reporter(search, on_search, n_searches=len(levels)),
        )
        fits.append(first)
        if first.search is not None:
            searches.append(first.search)
            refuse_empty_elite(form.spec, first.search)
        for outward in (commands[middle + 1 :], commands[:middle][::-1]):
            neighbour, there = first, at(first.command)
            for command in outward:
                here = at(command)
                neighbour, there = follow_level(here, box, command, neighbour, there), here
                fits.append(neighbour)
                best = float(here(neighbour.minima[:1])[0])
                on_search(0, best, np.nan, len(fits) / len(levels))
    except KeyboardInterrupt as interrupt:
        found = interrupt.result if isinstance(interrupt, Interrupted) else None
        if found is not None and np.isfinite(found.best_misfit):
            searched = search_box(plain, box, levels[commands[middle]])
            best_so_far = np.asarray(searched.theta_from_unit(found.best_unit))
            fits.append(LevelFit(command=commands[middle], minima=best_so_far[None], search=None))
            searches.append(found)
        if not fits:
            raise Interrupted(None, "search") from interrupt
        theta = joint_starts(form.spec, fits, 1, rng=rng)[0]
        raise interrupted_at(theta, objective, form, joined_trace(searches)) from interrupt
    fits.sort(key=lambda fit: fit.command)
    starts = joint_starts(form.spec, fits, _JOINT_STARTS, rng=rng)
    searched = search_box(plain, box, excerpts)
    joint_form = replace(
        form, box=_limited(form, law_box(form.spec, searched, np.array(commands), margin=_MARGIN))
    )
    return StartingPoints(
        objective=objective.on(form.spec, excerpts),
        form=joint_form,
        theta=np.array([joint_form.box.inside(start) for start in starts]),
        trace=joined_trace(searches),
    )


def levels_of(spec: DamperSpec, tests: tuple[DamperTest, ...]) -> dict[float, tuple[DamperTest, ...]]:
    """The tests at each command, lowest first.

    Raises
    ------
    SettingError
        Where there are fewer commands than a law has coefficients.
    """
    commands = [float(np.mean(np.asarray(loading_of(test, spec).command))) for test in tests]
    level_of = [command_level(command) for command in commands]
    levels = {
        level: tuple(test for test, own in zip(tests, level_of, strict=True) if own == level)
        for level in sorted(set(level_of))
    }
    current = spec.current
    if current is not None:
        needed = 1 + max(_fitted_degree(law) for law in current.laws)
        if len(levels) < needed:
            raise SettingError(
                f"the tests run at {len(levels)} command(s), the current laws need {needed}; "
                "add tests at other commands, or choose laws of a lower degree"
            )
    return levels


def search_level(
    objective: Objective,
    box: Box,
    command: float,
    *,
    search: Optimiser[Any],
    rng: int,
    on_generation: Callable[[GenerationEvent[Any]], None],
) -> LevelFit:
    """Fit the plain model at one command by a global search followed by local minimisations."""
    searched = search_box(objective.spec, box, objective.tests)
    found = optimise_in_box(search, objective, searched, rng=rng, on_generation=on_generation)
    starts = np.asarray(searched.theta_from_unit(found.elite[:_STARTS]))
    return LevelFit(command=command, minima=_minima(objective, box, searched, starts), search=found)


def follow_level(
    objective: Objective, box: Box, command: float, neighbour: LevelFit, neighbours: Objective
) -> LevelFit:
    """Fit the plain model at one command from the minima at a neighbouring one.

    Each minimum gives two starts: unchanged, and with its forces scaled by the ratio of the measured ones.
    """
    searched = search_box(objective.spec, box, objective.tests)
    ratio = _force(objective) / _force(neighbours)
    is_force = np.array([parameter.scales_with_force for parameter in objective.spec.parameters])
    starts = np.concatenate(
        [neighbour.minima, np.where(is_force, ratio * neighbour.minima, neighbour.minima)]
    )
    return LevelFit(command=command, minima=_minima(objective, box, searched, starts), search=None)


def _force(objective: Objective) -> float:
    return float(np.mean([np.std(test.force) for test in objective.tests]))


def _minima(
    objective: Objective, box: Box, searched: Box, starts: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The best minima, best first, shape (n_minima, n_params)."""
    near = box.with_bounds(_widened(searched, box))

    def minimised(starts: NDArray[np.float64], evaluations: int) -> list[LocalMinimum]:
        found = (find_minimum(objective, near, start, max_evaluations=evaluations) for start in starts)
        return sorted(found, key=lambda minimum: minimum.misfit)

    inside = np.clip(starts, near.lower, near.upper)
    first = np.array([minimum.theta for minimum in minimised(inside, _EVALUATIONS)[:_MINIMA]])
    return np.array([minimum.theta for minimum in minimised(first, _LAST_EVALUATIONS)])


def _widened(searched: Box, box: Box) -> dict[str, tuple[float, float]]:
    bounds = {}
    for index, name in enumerate(searched.names):
        lower, upper = searched.lower[index], searched.upper[index]
        if searched.log[index]:
            lower, upper = lower / _RANGE_FACTOR, upper * _RANGE_FACTOR
        else:
            middle, half = (lower + upper) / 2, (upper - lower) / 2
            lower, upper = middle - _RANGE_FACTOR * half, middle + _RANGE_FACTOR * half
        bounds[name] = (max(lower, box.lower[index]), min(upper, box.upper[index]))
    return bounds


def joint_starts(spec: DamperSpec, levels: list[LevelFit], n_starts: int, *, rng: int) -> NDArray[np.float64]:
    """Coefficients of laws that are fitted to minima at several commands, shape (n_starts, n_params).

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
        starts.append(_fitted_laws(spec, commands, values))
    return np.array(starts)


def _fitted_laws(
    spec: DamperSpec, commands: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients of the laws, shape (n_params,), by least squares from `values`, shape (n_levels, n_plain)."""
    if spec.current is None:
        return np.asarray(values[0])
    theta: list[float] = []
    for law, column in zip(spec.current.laws, values.T, strict=True):
        if current_laws()[law].degree == 0:
            theta.append(float(np.median(column)))
            continue
        full = _fitted_degree(law)
        degree = min(full, len(commands) - 1)
        polynomial = list(np.polyfit(commands, column, degree)[::-1]) + [0.0] * (full - degree)
        if current_laws()[law].degree is None:
            # a + b exp(-u) with the values of the straight line at the lowest and highest command.
            lowest, highest = commands.min(), commands.max()
            rise = polynomial[1] * (highest - lowest) / (np.exp(-highest) - np.exp(-lowest) or 1.0)
            polynomial = [polynomial[0] + polynomial[1] * lowest - rise * np.exp(-lowest), rise, -1.0]
        theta += polynomial
    if spec.current.lagged:
        theta.append(spec.parameters[-1].nominal)
    box = Box.of(spec)
    return np.clip(theta, box.lower, box.upper)


def law_box(spec: DamperSpec, searched: Box, commands: NDArray[np.float64], *, margin: float = 1.0) -> Box:
    """Ranges of the coefficients of the laws, `margin` times as wide as the searched ranges of the plain model imply.

    A coefficient may have either sign, and at the largest command its term reaches the end of the parameter's range.
    """
    largest = max(float(np.max(np.abs(commands))), 1e-3)
    bounds: dict[str, tuple[float, float]] = {}
    admissible = Box.of(spec)
    for index, parameter in enumerate(spec.parameters):
        coefficient = parameter.coefficient
        if coefficient is None:
            continue
        plain = searched.names.index(coefficient.parameter)
        reach = margin * max(abs(searched.lower[plain]), abs(searched.upper[plain]))
        if coefficient.is_exponent:
            reach = _EXPONENT
        elif spec.current is not None and current_laws()[spec.current.laws[plain]].degree is not None:
            reach /= largest**coefficient.number
        bounds[parameter.name] = (max(-reach, admissible.lower[index]), min(reach, admissible.upper[index]))
    return admissible.with_bounds(bounds)


def _limited(form: Form, limits: Box) -> Box:
    """The box of a form, where parameters that the user has not bounded have the range of `limits`.

    Local minimisations run in the logit of the range; for a range of +-1e9 the logit resolves useful values poorly.
    """
    admissible = Box.of(form.spec)
    narrowed = {}
    for index, name in enumerate(admissible.names):
        own = (form.box.lower[index], form.box.upper[index])
        if own == (admissible.lower[index], admissible.upper[index]):
            narrowed[name] = (limits.lower[index], limits.upper[index])
    return form.box.with_bounds(narrowed)


def _fitted_degree(law: LawName) -> int:
    """Degree of the polynomial that is fitted to values over the command; 1 for an exponential law."""
    degree = current_laws()[law].degree
    return 1 if degree is None else degree
