"""Saving of an exact early abort: the same search with complete simulations and with simulations stopped early."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.identification import Objective
from mrwork.search import AbortableObjective, SearchResult, run_search
from studies.speed.contenders import ABORTED, UNSTOPPED, ending
from studies.speed.search_job import SearchJob


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


def early_aborts(job: SearchJob, *, generations: int, seeds: int, threads: int) -> list[EarlyAbort]:
    """Each of our searches that can abort, medians over the seeds."""
    rules = replace(UNSTOPPED, max_generations=generations)
    return [
        _measured(name, ending(optimiser, rules), job, seeds=seeds, threads=threads)
        for name, optimiser in ABORTED.items()
    ]


def _measured(name: str, optimiser: Any, job: SearchJob, *, seeds: int, threads: int) -> EarlyAbort:
    shares, ratios, identical = [], [], True
    for seed in range(seeds):
        objective = Objective.of(job.spec, (job.test,), threads=threads)

        def without(unit: NDArray[np.float64], objective: Objective = objective) -> NDArray[np.float64]:
            return objective(job.theta(unit))

        def aborting(
            unit: NDArray[np.float64], threshold: NDArray[np.float64], objective: Objective = objective
        ) -> NDArray[np.float64]:
            return objective(job.theta(unit), threshold)

        whole, seconds_whole = _timed(optimiser, without, job, seed)
        steps_before = objective.tally.steps
        short, seconds_short = _timed(optimiser, AbortableObjective(misfits=aborting), job, seed)
        done = objective.tally.steps - steps_before
        shares.append(done / (done + objective.tally.spared))
        ratios.append(seconds_short / seconds_whole)
        identical &= _same(whole, short)
    return EarlyAbort(
        method=name,
        threads=threads,
        steps_share_done=float(np.median(shares)),
        seconds_ratio=float(np.median(ratios)),
        identical=identical,
        generations=optimiser.stop.max_generations,
        n_seeds=seeds,
    )


def _timed(optimiser: Any, objective: Any, job: SearchJob, seed: int) -> tuple[SearchResult[Any], float]:
    began = time.perf_counter()
    result = run_search(optimiser, objective, rng=seed, n_params=job.n_params)
    return result, time.perf_counter() - began


def _same(first: SearchResult[Any], second: SearchResult[Any]) -> bool:
    return first.best_unit.tobytes() == second.best_unit.tobytes() and all(
        one.tobytes() == other.tobytes() for one, other in zip(first.trace, second.trace, strict=True)
    )
