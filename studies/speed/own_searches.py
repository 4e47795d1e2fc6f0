"""Our searches as no peer runs: all seeds at once, what the replicate axis is for, and with an exact early abort."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from mrwork.identification import Objective
from mrwork.search import AbortableObjective, SearchResult, run_replicates, run_search
from studies.former.arrays import Floats
from studies.speed.attempt import NEAR, AttemptResult, ObjectiveName
from studies.speed.contenders import ABORTED, UNSTOPPED, described, ending
from studies.speed.search_job import SearchJob
from studies.speed.timing import timed

AT_ONCE: ObjectiveName = "rust, seeds at once"


def contenders_at_once() -> list[tuple[str, str, str]]:
    """Method, objective and settings of each."""
    return [(name, AT_ONCE, described(optimiser)) for name, optimiser in ABORTED.items()]


def attempted_at_once(
    job: SearchJob, *, best_known: float, budget: int, first_seed: int, seeds: int
) -> Iterator[AttemptResult]:
    """Let each search come within 0.2 points of the best known misfit `seeds` times, side by side.

    One crossing to the kernel a generation for all that still run, with early abort. The seconds of an outcome are an
    equal share of the whole.
    """
    rules = replace(UNSTOPPED, target=best_known + NEAR, max_evaluations=budget)
    objective = AbortableObjective(misfits=lambda unit, limit: job.objective(job.theta(unit), limit))
    for name, optimiser in ABORTED.items():
        search = partial(run_replicates, ending(optimiser, rules), objective, rng=first_seed)
        run, seconds = timed(partial(search, n_params=job.n_params, replicates=range(seeds)))
        for result in run.results:
            yield AttemptResult(
                method=name,
                objective=AT_ONCE,
                evaluations=result.evaluations,
                seconds=seconds / seeds,
                success=result.stop_reason == "target",
                gap_points=100.0 * (result.best_misfit - best_known),
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class EarlyAbort:
    """Share of the time steps that were still done, seconds with over seconds without, and whether nothing changed.

    Identical means to the last bit: the best candidate, and the course of every generation.
    """

    method: str
    threads: int
    steps_share_done: float
    seconds_ratio: float
    identical: bool
    generations: int
    n_seeds: int


def early_aborts(job: SearchJob, *, generations: int, seeds: int, threads: int) -> Iterator[EarlyAbort]:
    """Each of our searches that can abort, medians over the seeds."""
    rules = replace(UNSTOPPED, max_generations=generations)
    for name, optimiser in ABORTED.items():
        search = partial(run_search, ending(optimiser, rules), n_params=job.n_params)
        shares, ratios, identical = [], [], True
        for seed in range(seeds):
            objective = Objective.of(job.spec, (job.test,), threads=threads)

            def misfits(
                unit: Floats,
                threshold: Floats | None = None,
                objective: Objective = objective,
            ) -> Floats:
                return objective(job.theta(unit), threshold)

            whole, seconds_whole = timed(partial(search, misfits, rng=seed))
            steps_before = objective.tally.steps
            aborting = AbortableObjective(misfits=misfits)
            short, seconds_short = timed(partial(search, aborting, rng=seed))
            done = objective.tally.steps - steps_before
            shares.append(done / (done + objective.tally.spared))
            ratios.append(seconds_short / seconds_whole)
            identical &= _same(whole, short)
        yield EarlyAbort(
            method=name,
            threads=threads,
            steps_share_done=float(np.median(shares)),
            seconds_ratio=float(np.median(ratios)),
            identical=identical,
            generations=generations,
            n_seeds=seeds,
        )


def _same(first: SearchResult[Any], second: SearchResult[Any]) -> bool:
    return first.best_unit.tobytes() == second.best_unit.tobytes() and all(
        one.tobytes() == other.tobytes() for one, other in zip(first.trace, second.trace, strict=True)
    )
