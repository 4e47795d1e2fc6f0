"""One process of the loop benchmark: one contender on its cores, compiled, timed, its results written to a file.

Run as `python -m studies.speed.loop_worker CORES SETTINGS` by `bench_loop`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass

import numpy as np

from studies.speed.loop_workload import Floats, LoopWorkload, loop_workload
from studies.speed.processes import send, serve

# Variants are compared on this part of the record, best of three.
_TRIAL_STEPS = 1000

Prepare = Callable[[LoopWorkload], Callable[[], Floats]]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSettings:
    """Contenders and size of the workload; `results` is the file to write (.npy)."""

    tool: str
    candidates: int
    motions: int
    seconds: float
    rounds: int
    results: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMeasurement:
    """Median seconds of `runs` runs; what compiling took, and the way it was laid out."""

    tool: str
    threads: int
    runs: int
    seconds: float
    compile_seconds: float
    variant: str


def ways(tool: str, threads: int) -> Iterator[tuple[str, Prepare]]:
    """The variants of a contender, each with its name."""
    match tool:
        case "mrwork":
            from mrwork import dampers as core
            from studies.speed import loop_ours

            name = f"simulate_loop, {core.instruction_set().used}"
            yield name, lambda workload: loop_ours.prepare(workload, threads)
        case "numba" | "numba_series":
            from studies.speed import loop_numba

            for way in loop_numba.LIBRARY if tool == "numba" else loop_numba.SERIES:
                yield way.describe(), lambda workload, way=way: loop_numba.prepare(workload, way)  # type: ignore[misc]  # its type is that of the default
        case "jax":
            from studies.speed import loop_jax

            for form in loop_jax.VARIANTS:
                yield form.describe(), lambda workload, form=form: loop_jax.prepare(workload, form)  # type: ignore[misc]  # its type is that of the default
        case "solve_ivp":
            from studies.speed import loop_scipy

            yield "RK45, called anew every control sample", loop_scipy.prepare
        case "python_control":
            from studies.speed import loop_control

            yield "input_output_response, our step as its update", loop_control.prepare


def measure(settings: LoopSettings, threads: int) -> None:
    """Find the fastest variant on a short piece, then time it on the whole."""
    workload = loop_workload(settings.candidates, settings.motions, settings.seconds)
    piece = workload.cut(
        candidates=settings.candidates,
        motions=settings.motions,
        n_steps=min(_TRIAL_STEPS, workload.n_steps),
    )
    choices = [(name, prepare, *_trial(prepare, piece)) for name, prepare in ways(settings.tool, threads)]
    name, prepare, _, compiling = min(choices, key=lambda choice: choice[2])
    run = prepare(workload)
    if settings.rounds > 1:
        run()  # compiles what is compiled for these shapes
    rounds = []
    for _ in range(settings.rounds):
        found, seconds = _timed(run)
        rounds.append(seconds)
    np.save(settings.results, found)
    measurement = LoopMeasurement(
        tool=settings.tool,
        threads=threads,
        runs=found.shape[0] * found.shape[1],
        seconds=float(np.median(rounds)),
        compile_seconds=compiling,
        variant=name,
    )
    send("measurement", asdict(measurement))


def _trial(prepare: Prepare, piece: LoopWorkload) -> tuple[float, float]:
    """Seconds of the piece, and what the first pass took beyond that."""
    began = time.perf_counter()
    run = prepare(piece)
    run()
    first = time.perf_counter() - began
    best = min(_timed(run)[1] for _ in range(3))
    return best, max(0.0, first - best)


def _timed(run: Callable[[], Floats]) -> tuple[Floats, float]:
    began = time.perf_counter()
    found = run()
    return found, time.perf_counter() - began


if __name__ == "__main__":
    serve(LoopSettings, measure)
