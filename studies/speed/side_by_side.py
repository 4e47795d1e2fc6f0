"""All seeds of one of our searches at once, as a study runs it: what the replicate axis is for."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

from mrwork.search import AbortableObjective, run_replicates
from studies.speed.attempt import NEAR, AttemptResult, ObjectiveName
from studies.speed.contenders import ABORTED, UNSTOPPED, described, ending
from studies.speed.search_job import SearchJob

OBJECTIVE: ObjectiveName = "rust, seeds at once"


def contenders_at_once() -> list[tuple[str, str, str]]:
    """Method, objective and settings of each."""
    return [(name, OBJECTIVE, described(optimiser)) for name, optimiser in ABORTED.items()]


def attempted_at_once(
    job: SearchJob, *, best_known: float, budget: int, first_seed: int, seeds: int
) -> Iterator[tuple[str, list[AttemptResult]]]:
    """Let each search come within 0.2 points of the best known misfit `seeds` times, side by side.

    One crossing to the kernel a generation for all that still run, with early abort. The seconds of an outcome are an
    equal share of the whole.
    """
    rules = replace(UNSTOPPED, target=best_known + NEAR, max_evaluations=budget)
    objective = AbortableObjective(misfits=lambda unit, limit: job.objective(job.theta(unit), limit))
    for name, optimiser in ABORTED.items():
        began = time.perf_counter()
        run = run_replicates(
            ending(optimiser, rules),
            objective,
            rng=first_seed,
            n_params=job.n_params,
            replicates=range(seeds),
        )
        share = (time.perf_counter() - began) / seeds
        yield (
            name,
            [
                AttemptResult(
                    evaluations=result.evaluations,
                    seconds=share,
                    success=result.stop_reason == "target",
                    gap_points=100.0 * (result.best_misfit - best_known),
                )
                for result in run.results
            ],
        )
