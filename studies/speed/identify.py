"""`study.py identify`: simulations and seconds until a search is near the best known fit, ours beside others."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mrwork.errors import SettingError
from studies.former.table import table_of
from studies.speed.attempt import (
    NEAR,
    Attempt,
    AttemptEnded,
    AttemptResult,
    BatchObjective,
    Contender,
    attempted,
)
from studies.speed.contenders import contenders
from studies.speed.own_searches import EarlyAbort, attempted_at_once, contenders_at_once, early_aborts
from studies.speed.search_job import ALL_TESTS, REFERENCE, SearchJob, record
from studies.speed.search_peers import UsualWay, measure_usual_way, multistart_least_squares
from studies.speed.search_rows import USUAL, SearchRow, TestRow, bars_of, extrapolated, row_of
from studies.speed.timing import rotated, timed
from studies.speed.workers import (
    InterruptibleBenchmark,
    Say,
    cores_for,
    record_kind,
    rows_until_interrupted,
    silent,
)

# The compile of a method and the loading of its library, which no time includes, take this many simulations.
_WARMING = 150
# Seeds below chose the settings of the contenders.
_FIRST_SEED = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Values measured before the turns began; `missing` libraries are left out."""

    test: str
    synthetic: bool
    n_time: int
    free: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    best_known_percent: float
    known_simulations: int
    threads: int
    contenders: tuple[tuple[str, str, str], ...]
    missing: tuple[str, ...]
    numba_variant: str
    first_call_seconds: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchBenchmark(InterruptibleBenchmark):
    """All that one run found; `interrupted` before all seeds had their turn."""

    rows: tuple[SearchRow, ...]
    early_abort: tuple[EarlyAbort, ...]
    tests: tuple[TestRow, ...]
    setups: tuple[Setup, ...]
    usual_way: UsualWay | None

    def text(self) -> Iterator[str]:
        """Medians over the attempts that came near, their share, the aims."""
        if not self.setups:
            yield "interrupted before anything was measured"
            return
        setup = self.setups[0]
        kind = record_kind(synthetic=setup.synthetic)
        yield (
            f"searches of non_symmetric_bouc_wen on {setup.test} ({kind}), {setup.n_time} samples, {len(setup.free)} "
            "free parameters:"
        )
        yield f"simulations and seconds to within 0.2 points of the best known fit, {setup.best_known_percent:.2f} %"
        yield f"(multistart of least squares, {setup.known_simulations} simulations, in the same box)"
        yield ""
        yield from table_of(
            "",
            "method",
            ((row.method, row) for row in self.rows),
            {
                "objective": lambda row: row.objective,
                "threads": lambda row: str(row.threads),
                "simulations": lambda row: _number(row.evaluations, ".0f"),
                "seconds": lambda row: ("~" if row.extrapolated else "") + _number(row.seconds, ".3g"),
                "success": lambda row: f"{row.success:.0%}",
                "seeds": lambda row: str(row.n_seeds),
                "s/success": lambda row: _number(row.expected_seconds, ".3g"),
                "gap, points": lambda row: f"{row.gap_points:.2f}",
            },
        ).lines()
        yield ""
        yield "Medians over the attempts that came near; s/success counts what failures spent. Compiling and loading"
        yield "are not counted; of seeds run at once each has its share. ~ extrapolated. identify is its whole run, and"
        yield "may leave the box: its gap can be negative. A simulation with its derivatives counts as one, as in the"
        yield "local minimisations of identify and multistart; for the difference quotients of SciPy a column counts."
        yield ""
        for abort in self.early_abort:
            same = "the same to the last bit" if abort.identical else "NOT THE SAME RESULT"
            yield (
                f"early abort, {abort.method}, {abort.threads} thread(s), {abort.generations} generations: "
                f"{abort.steps_share_done:.0%} of the steps, {abort.seconds_ratio:.0%} of the time, {same}"
            )
        for test in self.tests:
            yield (
                f"identify on {test.test}: {test.success:.0%} of {test.n_seeds} seeds near "
                f"{test.best_known_percent:.2f} %, {test.evaluations:.0f} simulations, {test.seconds:.2f} s"
            )
        yield ""
        yield from map(str, self.bars)
        yield ""
        yield from dict.fromkeys(f"{row.method}: {row.settings}" for row in self.rows)
        for setup in self.setups:
            if setup.numba_variant:
                yield f"fastest numba, {setup.threads} thread(s): {setup.numba_variant}"
        first = ", ".join(f"{name} {seconds:.1f}" for name, seconds in setup.first_call_seconds.items())
        yield f"first calls, with loading and compiling [s]: {first}"
        if setup.missing:
            yield f"not installed: {', '.join(setup.missing)}; to compare, run: pip install 'mrwork[bench]'"
        if self.interrupted:
            yield "interrupted: the rows hold the attempts made until then"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def bench_identify(
    *,
    seeds: int | None = None,
    threads: Sequence[int] = (),
    budget: int | None = None,
    quick: bool = False,
    all_tests: bool = False,
    say: Say = silent,
) -> SearchBenchmark:
    """Let our searches and those of other libraries look for the same fit, in turns, seed by seed.

    Each number of threads gets a process of its own, pinned to that many cores. Loading, compiling and choosing the
    fastest numba come first and are not timed. The target is within 0.2 points of the best fit that a long multistart
    of least squares found at the start of the same run. Ctrl-C ends the run; what was measured until then is returned.
    """
    seeds = (2 if quick else 20) if seeds is None else seeds
    budget = (1000 if quick else 5000) if budget is None else budget
    if min(seeds, budget, *threads, 1) < 1:
        raise SettingError("`seeds`, `budget` and `threads` must be 1 or more; give positive numbers")
    cores = cores_for(threads or (1,))
    counts = threads or ((1,) if quick else tuple(dict.fromkeys((1, len(cores)))))
    settings: dict[str, Any] = {
        "seeds": seeds,
        "budget": budget,
        "known_budget": 1000 if quick else 10_000,
        "abort_generations": 10 if quick else 60,
        "abort_seeds": 1 if quick else 5,
        "choose_variant": not quick,
    }
    # What needs only one number of threads.
    last = {"usual_candidates": 2 if quick else 20, "tests": ALL_TESTS if all_tests else ()}
    runs = {count: settings | {"usual_candidates": 0, "tests": ()} for count in counts}
    runs[counts[-1]] = settings | last
    began = time.perf_counter()
    received, interrupted = rows_until_interrupted(measure, runs, cores, say)
    everything = [row for rows in received.values() for row in rows]
    usual = next((row for row in everything if isinstance(row, UsualWay)), None)
    rows = [row for count, own in received.items() for row in _search_rows(own, count)]
    if usual is not None:
        swarms = [row for row in rows if row.method == USUAL and row.threads == counts[-1]]
        rows += [row for swarm in swarms[:1] for row in extrapolated(swarm, usual)]
    tests = [row for row in everything if isinstance(row, TestRow)]
    aborts = [row for row in everything if isinstance(row, EarlyAbort)]
    return SearchBenchmark(
        rows=tuple(rows),
        early_abort=tuple(aborts),
        tests=tuple(tests),
        bars=bars_of(rows, tests, aborts),
        setups=tuple(row for row in everything if isinstance(row, Setup)),
        usual_way=usual,
        seconds=time.perf_counter() - began,
        interrupted=interrupted,
    )


def _search_rows(received: Sequence[Any], threads: int) -> Iterator[SearchRow]:
    outcomes = [row for row in received if isinstance(row, AttemptResult)]
    for setup in (row for row in received if isinstance(row, Setup)):
        for method, objective, settings in setup.contenders:
            own = [row for row in outcomes if (row.method, row.objective) == (method, objective)]
            if own:
                yield row_of(own, threads=threads, settings=settings)


def measure(
    *,
    threads: int,
    seeds: int,
    budget: int,
    known_budget: int,
    abort_generations: int,
    abort_seeds: int,
    choose_variant: bool,
    usual_candidates: int,
    tests: Sequence[str],
) -> Iterator[Setup | AttemptResult | EarlyAbort | UsualWay | TestRow | str]:
    """Every contender tries on one number of threads, seed by seed, in turns."""
    job = SearchJob.of(record(REFERENCE), threads)
    yield "looking for the best known fit"
    best_known, simulated = best_known_misfit(job, known_budget)
    objectives: dict[str, BatchObjective] = {}
    objectives["rust"] = objectives["rust, early abort"] = job.objective
    first_calls: dict[str, float] = {}
    variant = ""
    if importlib.util.find_spec("numba") is not None:
        from studies.speed.numba_objective import fastest_numba

        yield "choosing the fastest numba"
        objectives["numba"], variant, first_calls["numba"] = fastest_numba(
            job, threads, choose=choose_variant
        )

    def attempt(contender: Contender, best_known: float, budget: int, seed: int) -> AttemptResult:
        objective = objectives[contender.objective]
        return attempted(contender, job, objective, best_known=best_known, budget=budget, seed=seed)

    everyone, missing = contenders()
    for contender in everyone:
        yield f"warming up: {contender.name} on {contender.objective}"
        _, seconds = timed(partial(attempt, contender, 0.0, _WARMING, 10**6))
        first_calls.setdefault(contender.name, seconds)
    named = ((contender.name, contender.objective, contender.settings) for contender in everyone)
    setup = Setup(
        test=job.test.name,
        synthetic=job.test.synthetic,
        n_time=job.test.n_time,
        free=tuple(job.box.names[index] for index in job.box.free),
        lower=tuple(job.box.lower[index] for index in job.box.free),
        upper=tuple(job.box.upper[index] for index in job.box.free),
        best_known_percent=100.0 * (1.0 - best_known),
        known_simulations=simulated,
        threads=threads,
        contenders=(*named, *contenders_at_once()),
        missing=tuple(missing),
        numba_variant=variant,
        first_call_seconds=first_calls,
    )
    yield setup
    began = time.perf_counter()
    for seed in range(seeds):
        left = f", about {(time.perf_counter() - began) * (seeds - seed) / seed:.0f} s left" if seed else ""
        for contender in rotated(everyone, seed):
            yield f"seed {seed + 1} of {seeds}: {contender.name} on {contender.objective}{left}"
            yield attempt(contender, best_known, budget, _FIRST_SEED + seed)
    yield "all seeds at once"
    yield from attempted_at_once(
        job, best_known=best_known, budget=budget, first_seed=_FIRST_SEED, seeds=seeds
    )
    yield "early abort"
    yield from early_aborts(job, generations=abort_generations, seeds=abort_seeds, threads=threads)
    if usual_candidates and importlib.util.find_spec("pyswarms") is not None:
        yield "the usual way: a few candidates by solve_ivp"
        yield measure_usual_way(job, target=best_known + NEAR, budget=budget, candidates=usual_candidates)
    for name in tests:
        yield f"{everyone[0].name} on {name}, {seeds} seeds"
        test = record(name)
        if test.synthetic:
            yield f"{name} is not here"
        else:
            yield _on_test(SearchJob.of(test, threads), everyone[0], known_budget, budget, seeds)


def best_known_misfit(job: SearchJob, budget: int) -> tuple[float, int]:
    """The least misfit of a long multistart of least squares in the same box, and its simulations."""
    attempt = Attempt(job=job, objective=job.objective, target=0.0, budget=budget)
    with suppress(AttemptEnded):
        multistart_least_squares(attempt, 2007)
    return attempt.least, attempt.evaluations


def _on_test(job: SearchJob, default: Contender, known_budget: int, budget: int, seeds: int) -> TestRow:
    """Medians over all attempts of `default` on a test."""
    best_known, _ = best_known_misfit(job, known_budget)
    outcomes = [
        attempted(default, job, job.objective, best_known=best_known, budget=budget, seed=_FIRST_SEED + seed)
        for seed in range(seeds)
    ]
    return TestRow(
        test=job.test.name,
        best_known_percent=100.0 * (1.0 - best_known),
        evaluations=float(np.median([outcome.evaluations for outcome in outcomes])),
        seconds=float(np.median([outcome.seconds for outcome in outcomes])),
        success=float(np.mean([outcome.success for outcome in outcomes])),
        n_seeds=seeds,
    )
