"""Rows of results of the attempts on the search job, and their targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.speed.attempt import AttemptResult
from studies.speed.own_searches import EarlyAbort
from studies.speed.search_peers import SOLVERS, UsualWay
from studies.speed.workers import Bar, ratio_bar

# Whose course the usual way is extrapolated from.
USUAL = "pyswarms"
# Ours alone, with or without early abort, and as a study runs them.
_OURS = {"one seed after another": ("rust", "rust, early abort"), "seeds at once": ("rust, seeds at once",)}
# Ours and its class of peer.
_CLASSES = (
    ("efficient_ga", "pymoo_ga"),
    ("particle_swarm_constriction", "pyswarms"),
    ("differential_evolution", "scipy_differential_evolution"),
)


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


def row_of(outcomes: Sequence[AttemptResult], *, threads: int, settings: str) -> SearchRow:
    """Medians over the attempts of one method on one objective that reached the target."""
    reached = [outcome for outcome in outcomes if outcome.success]
    evaluations = _quartiles([float(outcome.evaluations) for outcome in reached])
    seconds = _quartiles([outcome.seconds for outcome in reached])
    spent = sum(outcome.seconds for outcome in outcomes)
    return SearchRow(
        method=outcomes[0].method,
        objective=outcomes[0].objective,
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
            seconds=swarm.evaluations and swarm.evaluations * seconds,
            seconds_quartiles=quartiles and (quartiles[0] * seconds, quartiles[1] * seconds),
            expected_seconds=None,
            seconds_per_simulation=seconds,
            extrapolated=True,
            settings=f"with solve_ivp: {usual.candidates} candidates timed, {solver} {seconds * 1e3:.0f} ms",
        )
        for solver, seconds in usual.seconds_by_solver.items()
    ]


def _quartiles(values: list[float]) -> tuple[float, float, float] | None:
    """Lower quartile, median, upper quartile."""
    if not values:
        return None
    lower, median, upper = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
    return lower, median, upper


def bars_of(
    rows: Sequence[SearchRow], tests: Sequence[TestRow], aborts: Sequence[EarlyAbort]
) -> tuple[Bar, ...]:
    """The targets, each on each number of threads."""
    bars: list[Bar] = []
    for threads in dict.fromkeys(row.threads for row in rows if not row.extrapolated):
        bars += [
            Bar(
                claim="share of seeds on which identify is near",
                threads=threads,
                aim=0.95,
                measured=row.success,
            )
            for row in rows
            if (row.method, row.threads) == ("identify", threads)
        ]
        for how, objectives in _OURS.items():
            bars += _bars_of_ours(rows, how, objectives, threads)
    bars += [
        Bar(
            claim=f"{abort.method}: share of steps that an early abort spares",
            threads=abort.threads,
            aim=0.5,
            measured=(1.0 - abort.steps_share_done) if abort.identical else None,
        )
        for abort in aborts
    ]
    bars += [
        Bar(
            claim=f"share of seeds on which identify is near, {test.test}",
            threads=max(row.threads for row in rows),
            aim=0.95,
            measured=test.success,
        )
        for test in tests
    ]
    return tuple(bars)


def _bars_of_ours(
    rows: Sequence[SearchRow], how: str, objectives: tuple[str, ...], threads: int
) -> list[Bar]:
    """Our searches beside their classes of peer on numba, and beside the usual way."""

    def chosen(method: str, objectives: tuple[str, ...], threads: int) -> list[SearchRow]:
        return [
            row
            for row in rows
            if row.method == method and row.objective in objectives and row.threads == threads
        ]

    def fastest(chosen: list[SearchRow]) -> float | None:
        """Seconds to the target."""
        return min((row.seconds for row in chosen if row.seconds is not None), default=None)

    def per_simulation(chosen: list[SearchRow]) -> float | None:
        return min((row.seconds_per_simulation for row in chosen), default=None)

    bars: list[Bar] = []
    slower: list[Bar] = []
    for ours, theirs in _CLASSES:
        own, peer = chosen(ours, objectives, threads), chosen(theirs, ("numba",), threads)
        claim = f"{ours}, {how}: times faster than {theirs} on numba"
        bars.append(ratio_bar(claim, threads, 8.0, fastest(peer), fastest(own)))
        # Where ours never came near there is still how fast it simulates.
        if fastest(own) is None:
            claim = f"{ours}, {how}: simulations a second, times those of {theirs} on numba"
            slower.append(ratio_bar(claim, threads, 8.0, per_simulation(peer), per_simulation(own)))
    bars += slower
    for ours in ("particle_swarm_constriction", "multistart", "identify"):
        for solver in SOLVERS:
            if own := chosen(ours, objectives, threads):
                usual = chosen(USUAL, (f"solve_ivp, {solver}",), 1)
                claim = f"{ours}, {how}: times faster than the usual way, {solver}"
                bars.append(ratio_bar(claim, threads, 1000.0, fastest(usual), fastest(own)))
    return bars
