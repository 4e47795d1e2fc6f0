"""Rows of results of the attempts on the search job."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from studies.speed.attempt import AttemptResult
from studies.speed.usual_way import UsualWay


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchRow:
    """One method on one objective and number of threads, over `n_seeds` attempts.

    `evaluations` and `seconds` are medians over the attempts that came within 0.2 points of the best known fit, with
    their quartiles; `None` where none did. `success` is their share. `expected_seconds` counts the failures in, with
    all that they spent, per success; `seconds_per_simulation` is over all attempts. `gap_points` of fit are left at
    the end of an attempt, the median. `extrapolated` seconds were not waited for.
    """

    method: str
    objective: str
    threads: int
    evaluations: float | None
    seconds: float | None
    success: float
    extrapolated: bool
    n_seeds: int
    evaluations_quartiles: tuple[float, float] | None
    seconds_quartiles: tuple[float, float] | None
    expected_seconds: float | None
    seconds_per_simulation: float
    gap_points: float
    settings: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TestRow:
    """The default of `identify` on one test."""

    test: str
    best_known_percent: float
    evaluations: float
    seconds: float
    success: float
    n_seeds: int


def row_of(
    method: str, objective: str, threads: int, settings: str, outcomes: list[AttemptResult]
) -> SearchRow:
    """Medians over the attempts that reached the target."""
    reached = [outcome for outcome in outcomes if outcome.success]
    evaluations = _middle([float(outcome.evaluations) for outcome in reached])
    seconds = _middle([outcome.seconds for outcome in reached])
    spent = sum(outcome.seconds for outcome in outcomes)
    return SearchRow(
        method=method,
        objective=objective,
        threads=threads,
        evaluations=evaluations and evaluations[1],
        seconds=seconds and seconds[1],
        success=len(reached) / len(outcomes),
        extrapolated=False,
        n_seeds=len(outcomes),
        evaluations_quartiles=evaluations and (evaluations[0], evaluations[2]),
        seconds_quartiles=seconds and (seconds[0], seconds[2]),
        expected_seconds=spent / len(reached) if reached else None,
        seconds_per_simulation=spent / sum(outcome.evaluations for outcome in outcomes),
        gap_points=float(np.median([outcome.gap_points for outcome in outcomes])),
        settings=settings,
    )


def extrapolated(swarm: SearchRow, usual: UsualWay) -> list[SearchRow]:
    """The swarm with the seconds of each solver: one process, one candidate after another."""
    quartiles = swarm.evaluations_quartiles
    return [
        replace(
            swarm,
            objective=f"solve_ivp, {solver}",
            threads=1,
            seconds=swarm.evaluations and swarm.evaluations * each,
            seconds_quartiles=quartiles and (quartiles[0] * each, quartiles[1] * each),
            expected_seconds=None,
            seconds_per_simulation=each,
            extrapolated=True,
            settings=f"with solve_ivp: {usual.candidates} candidates timed, {solver} {each * 1e3:.0f} ms",
        )
        for solver, each in usual.seconds_by_solver.items()
    ]


def test_row_of(about: tuple[str, float], outcomes: list[AttemptResult]) -> TestRow:
    """Medians over all attempts on a test; `about` is its name and the best known fit in per cent."""
    test, best_known_percent = about
    return TestRow(
        test=test,
        best_known_percent=best_known_percent,
        evaluations=float(np.median([outcome.evaluations for outcome in outcomes])),
        seconds=float(np.median([outcome.seconds for outcome in outcomes])),
        success=float(np.mean([outcome.success for outcome in outcomes])),
        n_seeds=len(outcomes),
    )


def _middle(values: list[float]) -> tuple[float, float, float] | None:
    """Lower quartile, median, upper quartile."""
    if not values:
        return None
    lower, median, upper = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
    return lower, median, upper
