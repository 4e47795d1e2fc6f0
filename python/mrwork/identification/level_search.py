"""Starting points of a model with current laws: the plain model is fitted at each command, then the laws to these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Seed, Within, checked
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import Interrupted, SettingError
from mrwork.identification.global_search import (
    OnSearch,
    StartingPoints,
    generation_reporter,
    interrupted_at,
    joined_trace,
    optimise_in_box,
    refuse_empty_elite,
)
from mrwork.identification.law_coefficients import fitted_laws, joint_box, levels_needed, plain_of
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


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LevelFit(Summarised):
    """Minima of the plain model at one command [A or V], shape (n_minima, n_plain), best first; the search, if any."""

    command: float
    minima: NDArray[np.float64]
    search: SearchResult[Any] | None


def points_from_levels(problem: Problem, search: Optimiser[Any], *, on_search: OnSearch) -> StartingPoints:
    """Fit the plain model at each constant command, then the laws to the minima.

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
    plain, box = plain_of(form)
    levels = levels_of(form.spec, [test for test in excerpts if command_is_constant(test, form.spec)])
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
    joint_form = replace(form, box=joint_box(form, excerpts, np.array(commands)))
    return StartingPoints(
        objective=objective.on(form.spec, excerpts),
        form=joint_form,
        theta=np.array([joint_form.box.inside(start) for start in starts]),
        trace=joined_trace(searches),
    )


def has_levels(spec: DamperSpec, tests: Sequence[DamperTest]) -> bool:
    """Whether tests at constant commands suffice for the laws, or no command varies."""
    constant = [test for test in tests if command_is_constant(test, spec)]
    return len(constant) == len(tests) or len(_by_level(spec, constant)) >= levels_needed(spec)


def command_is_constant(test: DamperTest, spec: DamperSpec) -> bool:
    """Whether the command of a test in the unit of the model is constant."""
    return not isinstance(loading_of(test, spec).command, np.ndarray)


def _by_level(spec: DamperSpec, tests: Sequence[DamperTest]) -> dict[float, tuple[DamperTest, ...]]:
    commands = [float(np.mean(np.asarray(loading_of(test, spec).command))) for test in tests]
    level_of = [command_level(command) for command in commands]
    return {
        level: tuple(test for test, own in zip(tests, level_of, strict=True) if own == level)
        for level in sorted(set(level_of))
    }


@checked
def levels_of(spec: DamperSpec, tests: Sequence[DamperTest]) -> dict[float, tuple[DamperTest, ...]]:
    """The tests at each command, lowest first.

    Raises
    ------
    SettingError
        Where there are fewer commands than a law has coefficients.
    """
    levels = _by_level(spec, tests)
    if spec.current is not None:
        refuse_few_levels(spec, len(levels))
    return levels


def refuse_few_levels(spec: DamperSpec, n_levels: int) -> None:
    """Refuse laws with more coefficients than there are commands.

    Raises
    ------
    SettingError
        Where there are fewer commands than a law has coefficients.
    """
    if n_levels < levels_needed(spec):
        raise SettingError(
            f"the tests run at {n_levels} command(s), the current laws need {levels_needed(spec)}; "
            "add tests at other commands, or choose laws of a lower degree"
        )


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


@checked
def joint_starts(
    spec: DamperSpec,
    levels: list[LevelFit],
    n_starts: Annotated[int, Within(least=0, most=100_000)],
    *,
    rng: Seed,
) -> NDArray[np.float64]:
    """Coefficients of laws that are fitted to minima at several commands, shape (n_starts, n_params).

    The laws of the first start are fitted to the best minimum at each command, those of the others to a random one,
    each parameter multiplied by a log-normal factor (standard deviation of the logarithm 0.25).
    """
    if not levels or any(level.minima.ndim != 2 or not len(level.minima) for level in levels):
        raise SettingError("give the minima at one command at least, in rows, to fit laws to")
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
