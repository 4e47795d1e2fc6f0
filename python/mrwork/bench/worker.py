"""One process of the kernel benchmark: pinned to its cores, it times all contenders in turns.

Run as `python -m mrwork.bench.worker CORES BATCHES ROUNDS` (comma-separated numbers) by `bench_kernels`,
once per number of threads: jax and numba size their thread pools when they are imported, so the cores must be
chosen before. Each line on stdout is a JSON object with one key: `progress` (text), `measurement` or
`failure` (text).
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.bench.workload import (
    DT,
    MODEL,
    PowerForm,
    Run,
    Workload,
    candidates,
    displacement_record,
    measured_force,
)
from mrwork.errors import MrworkError

# All contenders sum the same 2000 squares in the same order; a library's power may differ by some ulp.
AGREEMENT = 1e-9
# Long enough that starting and waking threads does not count, short enough for turns to meet the same noise.
TURN_SECONDS = 0.08
TRIAL_SECONDS = 0.02


class Variant(Protocol):
    """A way to lay out and compile a contender."""

    def describe(self) -> str:
        """In a few words, for the table."""


V = TypeVar("V", bound=Variant)


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer(Generic[V]):
    """A library to compare with: where its search for the fastest variant starts and what it may change."""

    start: V
    changes: tuple[Callable[[V], V], ...]
    prepare: Callable[[Workload, PowerForm, V], Run]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """Medians over the rounds, for one batch and number of threads; speeds in Runge-Kutta steps/s."""

    batch: int
    threads: int
    general_exponent: bool
    speeds: dict[str, float]
    variants: dict[str, str]
    flops_per_step: float
    fma_peak: float
    instruction_set: str


def main() -> None:
    """Pin this process, then measure every batch with a general exponent and with n = 2."""
    cores, batches, rounds = ([int(number) for number in text.split(",")] for text in sys.argv[1:4])
    if sys.platform == "linux":
        os.sched_setaffinity(0, cores)
    try:
        for batch in batches:
            for general_exponent in (True, False):
                measurement = measure(batch, len(cores), rounds[0], general_exponent=general_exponent)
                _tell("measurement", asdict(measurement))
    except MrworkError as error:
        _tell("failure", str(error))


def measure(batch: int, threads: int, rounds: int, *, general_exponent: bool) -> Measurement:
    """Time our kernel and the fastest variant of each installed peer, in turns, on one batch."""
    from mrwork import _rust

    displacement = displacement_record()
    force = measured_force(displacement)
    theta = candidates(batch, general_exponent=general_exponent, rng=np.random.default_rng(2007))
    loading = _rust.LoadingHistory(DT, displacement, None)
    workload = Workload(theta=theta, stages=np.ascontiguousarray(loading.stages(1)), force=force, dt=DT)
    label = f"batch {batch}, {threads} thread(s), {'general exponent' if general_exponent else 'n = 2'}"

    def ours() -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32]]:
        return _rust.misfits(MODEL, theta, loading, force, threads=threads)

    expected, _, substeps = ours()
    if int(substeps.max()) != 1:
        raise MrworkError(
            "expected one step per sample for every candidate, the stiffness rule asks for "
            f"{int(substeps.max())}; use a milder candidate box in bench/workload.py"
        )

    runs: dict[str, Run] = {"ours": ours}
    variants: dict[str, str] = {}

    def enter(name: str, peer: Peer[V], form: PowerForm) -> None:
        _tell("progress", f"{label}: choosing the fastest {name}")
        runs[name], variants[name] = fastest_variant(name, peer, workload, form, expected)

    forms: dict[str, PowerForm] = {"": "power", "_exp_log": "exp_log"} if general_exponent else {"": "square"}
    for suffix, form in forms.items():
        if importlib.util.find_spec("jax") is not None:
            from mrwork.bench import jax_peer

            peer = Peer(start=jax_peer.START, changes=jax_peer.CHANGES, prepare=jax_peer.prepare)
            enter("jax" + suffix, peer, form)
        if importlib.util.find_spec("numba") is not None:
            from mrwork.bench import numba_peer

            peer_ = Peer(start=numba_peer.START, changes=numba_peer.CHANGES, prepare=numba_peer.prepare)
            enter("numba" + suffix, peer_, form)

    _tell("progress", f"{label}: timing {', '.join(runs)} in {rounds} rounds")
    seconds, fma_peak = _time_in_turns(runs, rounds, lambda: _rust.fma_peak(threads, TURN_SECONDS / 2))
    return Measurement(
        batch=batch,
        threads=threads,
        general_exponent=general_exponent,
        speeds={name: workload.steps / value for name, value in seconds.items()},
        variants=variants,
        flops_per_step=float(_rust.flops_per_step(MODEL, theta[0])),
        fma_peak=fma_peak,
        instruction_set=str(_rust.instruction_set()),
    )


def fastest_variant(
    name: str, peer: Peer[V], workload: Workload, form: PowerForm, expected: NDArray[np.float64]
) -> tuple[Run, str]:
    """Find the fastest variant by trying each change once on the best so far; return it and what it is.

    A changed variant that loses the agreement (fast-math may) is not eligible.

    Raises
    ------
    MrworkError
        If the starting variant, which takes no liberties, disagrees with our misfits.
    """
    best = peer.start
    run = peer.prepare(workload, form, best)
    difference = _disagreement(run(), expected)
    if not difference <= AGREEMENT:
        raise MrworkError(
            f"{name} and the compiled kernel were expected to agree on every misfit to {AGREEMENT:g}, "
            f"they differ by {difference:.2e} (relative); do not trust the speeds, find which one is wrong"
        )
    seconds = _trial(run)
    tried = {best}
    for change in peer.changes:
        variant = change(best)
        if variant in tried:
            continue
        tried.add(variant)
        contender = peer.prepare(workload, form, variant)
        if not _disagreement(contender(), expected) <= AGREEMENT:
            continue
        trial = _trial(contender)
        if trial < seconds:
            best, run, seconds = variant, contender, trial
    return run, best.describe()


def _disagreement(misfit: object, expected: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(np.asarray(misfit) / expected - 1.0)))


def _trial(run: Run) -> float:
    return min(_seconds_per_call(run, _calls(run, TRIAL_SECONDS)) for _ in range(5))


def _calls(run: Run, seconds: float) -> int:
    return max(1, math.ceil(seconds / min(_seconds_per_call(run, 1) for _ in range(3))))


def _seconds_per_call(run: Run, calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        run()
    return (time.perf_counter() - start) / calls


def _time_in_turns(
    runs: dict[str, Run], rounds: int, fma_peak: Callable[[], float]
) -> tuple[dict[str, float], float]:
    calls = {name: _calls(run, TURN_SECONDS) for name, run in runs.items()}
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    peaks: list[float] = []
    names = list(runs)
    for turn in range(rounds):
        first = turn % len(names)
        for name in names[first:] + names[:first]:
            runs[name]()  # wakes this contender's threads and puts the previous one's to sleep
            seconds[name].append(_seconds_per_call(runs[name], calls[name]))
        peaks.append(fma_peak())
    return {name: float(np.median(values)) for name, values in seconds.items()}, float(np.median(peaks))


def _tell(kind: str, content: object) -> None:
    print(json.dumps({kind: content}), flush=True)


if __name__ == "__main__":
    main()
