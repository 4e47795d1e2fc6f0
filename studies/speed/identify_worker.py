"""One process of `study.py identify`: pinned to its cores, it lets every contender try, seed by seed, in turns.

Run as `python -m studies.speed.identify_worker CORES SETTINGS` (comma-separated cores, JSON of `IdentifySettings`) by
`bench_identify`. It sends `progress` (text), `setup`, `outcome`, `early_abort`, `usual_way`, `on_test` (their fields)
or `failure` (text).
"""

from __future__ import annotations

import importlib.util
import time
from contextlib import suppress
from dataclasses import asdict, dataclass

import numpy as np

from studies.speed.attempt import (
    NEAR,
    Attempt,
    AttemptEnded,
    AttemptResult,
    BatchObjective,
    Contender,
    RustObjective,
    attempted,
)
from studies.speed.contenders import contenders
from studies.speed.early_abort import early_aborts
from studies.speed.processes import send, serve
from studies.speed.search_job import ALL_TESTS, REFERENCE, SearchJob, record
from studies.speed.search_peers import multistart_least_squares
from studies.speed.side_by_side import OBJECTIVE, attempted_at_once, contenders_at_once
from studies.speed.timing import TimedPeer, fastest_variant
from studies.speed.usual_way import measure_usual_way
from studies.speed.workload import Run

# The compile of a method and the loading of its library, which no time includes, take this many simulations.
_WARMING = 150
# Seeds below chose the settings of the contenders.
_FIRST_SEED = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifySettings:
    """Settings of the measurement; with `last`, contenders that need only one number of threads are measured too."""

    seeds: int
    budget: int
    known_budget: int
    abort_generations: int
    abort_seeds: int
    usual_candidates: int
    choose_variant: bool
    all_tests: bool
    last: bool


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


def main() -> None:
    """Let everyone try on the cores that the command line gives."""
    serve(IdentifySettings, measure)


def measure(settings: IdentifySettings, threads: int) -> None:
    """All of one number of threads."""
    job = SearchJob.of(record(REFERENCE), threads)
    send("progress", "looking for the best known fit")
    best_known, simulated = best_known_misfit(job, settings.known_budget)
    objectives: dict[str, BatchObjective] = {}
    objectives["rust"] = objectives["rust, early abort"] = RustObjective(objective=job.objective)
    first_calls: dict[str, float] = {}
    variant = ""
    if importlib.util.find_spec("numba") is not None:
        send("progress", "choosing the fastest numba")
        objectives["numba"], variant, first_calls["numba"] = fastest_numba(
            job, threads, choose=settings.choose_variant
        )
    everyone, missing = contenders()
    for contender in everyone:
        send("progress", f"warming up: {contender.name} on {contender.objective}")
        began = time.perf_counter()
        _try(contender, job, objectives, best_known=0.0, budget=_WARMING, seed=10**6)
        first_calls.setdefault(contender.name, time.perf_counter() - began)
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
        contenders=(
            *((each.name, each.objective, each.settings) for each in everyone),
            *contenders_at_once(),
        ),
        missing=tuple(missing),
        numba_variant=variant,
        first_call_seconds=first_calls,
    )
    send("setup", asdict(setup))
    for seed in range(settings.seeds):
        # No contender always follows the same neighbour.
        first = seed % len(everyone)
        for contender in everyone[first:] + everyone[:first]:
            send(
                "progress",
                f"seed {seed + 1} of {settings.seeds}: {contender.name} on {contender.objective}",
            )
            outcome = _try(
                contender,
                job,
                objectives,
                best_known=best_known,
                budget=settings.budget,
                seed=_FIRST_SEED + seed,
            )
            named = {"method": contender.name, "objective": contender.objective, "threads": threads}
            send("outcome", named | asdict(outcome))
    send("progress", "all seeds at once")
    for name, outcomes in attempted_at_once(
        job, best_known=best_known, budget=settings.budget, first_seed=_FIRST_SEED, seeds=settings.seeds
    ):
        named = {"method": name, "objective": OBJECTIVE, "threads": threads}
        for outcome in outcomes:
            send("outcome", named | asdict(outcome))
    send("progress", "early abort")
    generations, seeds = settings.abort_generations, settings.abort_seeds
    for found in early_aborts(job, generations=generations, seeds=seeds, threads=threads):
        send("early_abort", asdict(found))
    if settings.last and importlib.util.find_spec("pyswarms") is not None:
        send("progress", "the usual way: a few candidates by solve_ivp")
        usual = measure_usual_way(
            job,
            target=best_known + NEAR,
            budget=settings.budget,
            candidates=settings.usual_candidates,
        )
        send("usual_way", asdict(usual))
    if settings.last and settings.all_tests:
        _on_all_tests(settings, threads, everyone[0])


def best_known_misfit(job: SearchJob, budget: int) -> tuple[float, int]:
    """The least misfit of a long multistart of least squares in the same box, and its simulations."""
    attempt = Attempt(job=job, objective=RustObjective(objective=job.objective), target=0.0, budget=budget)
    with suppress(AttemptEnded):
        multistart_least_squares(attempt, 2007)
    return attempt.least, attempt.evaluations


def fastest_numba(job: SearchJob, threads: int, *, choose: bool) -> tuple[BatchObjective, str, float]:
    """The fastest numba objective that agrees with ours, what it is, and the seconds of its first two calls.

    Half of the candidates of the trial are scattered over the box, half lie close together, as in a search.
    """
    import numba

    from studies.speed.numba_objective import CHANGES, START, NumbaObjective, ObjectiveVariant

    numba.set_num_threads(threads)
    unit = np.random.default_rng(1).random((60, job.n_params))
    unit[30:] = 0.5 + 0.05 * (unit[30:] - 0.5)
    theta = job.theta(unit)
    expected = job.objective(theta)
    theta = theta[np.isfinite(expected)]
    built: dict[str, NumbaObjective] = {}

    def prepare(variant: ObjectiveVariant) -> Run:
        objective = built[variant.describe()] = NumbaObjective.of(job, variant)
        return lambda: objective.misfits(theta)

    began = time.perf_counter()
    prepare(START)()
    built[START.describe()].residuals(theta[:2])
    compiling = time.perf_counter() - began
    changes = CHANGES if choose else ()
    peer = TimedPeer(start=START, changes=changes, prepare=prepare)
    _, described = fastest_variant("numba", peer, expected[np.isfinite(expected)])
    return built[described], described, compiling


def _try(
    contender: Contender,
    job: SearchJob,
    objectives: dict[str, BatchObjective],
    *,
    best_known: float,
    budget: int,
    seed: int,
) -> AttemptResult:
    return attempted(
        contender, job, objectives[contender.objective], best_known=best_known, budget=budget, seed=seed
    )


def _on_all_tests(settings: IdentifySettings, threads: int, default: Contender) -> None:
    for name in ALL_TESTS:
        test = record(name)
        if test.synthetic:
            send("progress", f"{name} is not here")
            continue
        job = SearchJob.of(test, threads)
        objective = RustObjective(objective=job.objective)
        best_known, _ = best_known_misfit(job, settings.known_budget)
        for seed in range(settings.seeds):
            send("progress", f"{default.name} on {name}, seed {seed + 1} of {settings.seeds}")
            outcome = attempted(
                default,
                job,
                objective,
                best_known=best_known,
                budget=settings.budget,
                seed=_FIRST_SEED + seed,
            )
            named = {"test": name, "best_known_percent": 100.0 * (1.0 - best_known)}
            send("on_test", named | asdict(outcome))


if __name__ == "__main__":
    main()
