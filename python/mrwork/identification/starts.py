"""Starts of a joint descent: the plain model fitted at each command, and laws drawn through what came out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import LawName, current_laws
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.levenberg_marquardt import Descended, descend
from mrwork.identification.objective import Objective
from mrwork.identification.search_ranges import search_box
from mrwork.records import DamperTest
from mrwork.search import Optimiser, SearchResult, run_search
from mrwork.search.loop import GenerationEvent
from mrwork.simulate import loading_of

# Starts that are descended from at each command; how far, and how far the best of them.
_STARTS = 12
_EVALUATIONS = 15
_FINDS = 5
_LAST_EVALUATIONS = 60
# At one command a descent may go so many times beyond what is searched: laws are drawn through what it finds, and a
# dashpot that ran away to 1e9 N s/m because nothing saw it would spoil them.
_BEYOND = 10.0
# Starts beside the first are drawn through values spread by this share of a parameter.
_SPREAD = 0.25

# Range of the exponent of a law [1/A or 1/V].
_EXPONENT = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelFit:
    """The plain model at one command [A or V]: finds, shape (n_finds, n_plain), best first; the search, if any."""

    command: float
    finds: NDArray[np.float64]
    search: SearchResult[Any] | None


def levels_of(spec: DamperSpec, tests: tuple[DamperTest, ...]) -> dict[float, tuple[DamperTest, ...]]:
    """The tests at each command, lowest first.

    Raises
    ------
    SettingError
        Where there are fewer commands than the laws have numbers.
    """
    commands = [float(np.mean(np.asarray(loading_of(test, spec).command))) for test in tests]
    # A command that was measured is never twice the same.
    level_of = np.round(np.array(commands), 2)
    levels = {
        float(level): tuple(test for test, own in zip(tests, level_of, strict=True) if own == level)
        for level in np.unique(level_of)
    }
    current = spec.current
    if current is not None:
        needed = 1 + max(_fitted_degree(law) for law in current.laws)
        if len(levels) < needed:
            raise SettingError(
                f"the tests run at {len(levels)} command(s), the laws asked for need {needed}; "
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
    """Fit the plain model at one command from a genetic search."""
    searched = search_box(objective.spec, box, objective.tests)
    found = run_search(
        search,
        lambda unit: objective(np.asarray(searched.theta_from_unit(unit))),
        rng=rng,
        n_params=len(searched.free),
        on_generation=on_generation,
        journal=objective.journal,
    )
    starts = np.asarray(searched.theta_from_unit(found.elite[:_STARTS]))
    return LevelFit(command=command, finds=_finds(objective, box, searched, starts), search=found)


def follow_level(
    objective: Objective, box: Box, command: float, neighbour: LevelFit, neighbours: Objective
) -> LevelFit:
    """Fit the plain model at one command from what was found at its neighbour, in proportion to the forces."""
    searched = search_box(objective.spec, box, objective.tests)
    ratio = _force(objective) / _force(neighbours)
    is_force = np.array([parameter.unit.startswith("N") for parameter in objective.spec.parameters])
    starts = np.concatenate([neighbour.finds, np.where(is_force, ratio * neighbour.finds, neighbour.finds)])
    return LevelFit(command=command, finds=_finds(objective, box, searched, starts), search=None)


def _force(objective: Objective) -> float:
    return float(np.mean([np.std(test.force) for test in objective.tests]))


def _finds(objective: Objective, box: Box, searched: Box, starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """The best minima, best first, shape (n_finds, n_params)."""
    near = box.with_bounds(_widened(searched, box))

    def descents(starts: NDArray[np.float64], evaluations: int) -> list[Descended]:
        found = (descend(objective, near, start, max_evaluations=evaluations) for start in starts)
        return sorted(found, key=lambda descended: descended.misfit)

    inside = np.clip(starts, near.lower, near.upper)
    first = np.array([descended.theta for descended in descents(inside, _EVALUATIONS)[:_FINDS]])
    return np.array([descended.theta for descended in descents(first, _LAST_EVALUATIONS)])


def _widened(searched: Box, box: Box) -> dict[str, tuple[float, float]]:
    bounds = {}
    for index, name in enumerate(searched.names):
        lower, upper = searched.lower[index], searched.upper[index]
        if searched.log[index]:
            lower, upper = lower / _BEYOND, upper * _BEYOND
        else:
            middle, half = (lower + upper) / 2, (upper - lower) / 2
            lower, upper = middle - _BEYOND * half, middle + _BEYOND * half
        bounds[name] = (max(lower, box.lower[index]), min(upper, box.upper[index]))
    return bounds


def joint_starts(spec: DamperSpec, levels: list[LevelFit], n_starts: int, *, rng: int) -> NDArray[np.float64]:
    """Coefficients of the laws drawn through fits at several commands, shape (n_starts, n_params).

    The first start goes through the best fit of each command, the others through a find taken at random, spread by a
    quarter of each parameter.
    """
    random = np.random.default_rng([rng, n_starts])
    commands = np.array([level.command for level in levels])
    starts = []
    for start in range(n_starts):
        values = np.array(
            [level.finds[0 if start == 0 else random.integers(len(level.finds))] for level in levels]
        )
        if start > 0:
            values = values * np.exp(_SPREAD * random.standard_normal(values.shape))
        starts.append(_through(spec, commands, values))
    return np.array(starts)


def _through(
    spec: DamperSpec, commands: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients whose laws come closest to `values`, shape (n_levels, n_plain)."""
    if spec.current is None:
        return np.asarray(values[0])
    theta: list[float] = []
    for law, column in zip(spec.current.laws, values.T, strict=True):
        if law == "constant":
            theta.append(float(np.median(column)))
            continue
        wanted = _fitted_degree(law)
        degree = min(wanted, len(commands) - 1)
        straight = list(np.polyfit(commands, column, degree)[::-1]) + [0.0] * (wanted - degree)
        if law == "exponential":
            # a + b exp(-u) with the end values of the straight line.
            lowest, highest = commands.min(), commands.max()
            rise = straight[1] * (highest - lowest) / (np.exp(-highest) - np.exp(-lowest) or 1.0)
            straight = [straight[0] + straight[1] * lowest - rise * np.exp(-lowest), rise, -1.0]
        theta += straight
    if spec.current.lagged:
        theta.append(spec.parameters[-1].nominal)
    box = Box.of(spec)
    return np.clip(theta, box.lower, box.upper)


def law_box(spec: DamperSpec, searched: Box, commands: NDArray[np.float64], *, margin: float = 1.0) -> Box:
    """The searched ranges of the plain model, `margin` times as wide, handed on to the coefficients of its laws.

    A coefficient may have either sign, and at the largest command its term reaches the end of the parameter's range.
    """
    largest = max(float(np.max(np.abs(commands))), 1e-3)
    bounds: dict[str, tuple[float, float]] = {}
    whole = Box.of(spec)
    for index, parameter in enumerate(spec.parameters):
        name, dot, power = parameter.name.partition(".")
        if not dot:
            continue
        plain = searched.names.index(name)
        reach = margin * max(abs(searched.lower[plain]), abs(searched.upper[plain]))
        if parameter.is_exponent:
            reach = _EXPONENT
        elif spec.current is not None and spec.current.laws[plain] != "exponential":
            reach /= largest ** int(power)
        bounds[parameter.name] = (max(-reach, whole.lower[index]), min(reach, whole.upper[index]))
    return whole.with_bounds(bounds)


def _fitted_degree(law: LawName) -> int:
    """Degree of the polynomial that is fitted over the commands; an exponential is drawn through a straight line."""
    degree = current_laws()[law].degree
    return 1 if degree is None else degree
