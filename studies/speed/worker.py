"""One process of the kernel benchmark: pinned to its cores, it times all contenders in turns.

Run as `python -m studies.speed.worker CORES BATCHES ROUNDS` (comma-separated numbers) by `bench_kernels`,
once per number of threads: jax and numba size their thread pools when they are imported, so the cores must be
chosen before. Each line on stdout is a JSON object with one key: `progress` (text), `measurement` or
`failure` (text).
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import asdict, dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import MrworkError
from studies.speed.processes import pin, send
from studies.speed.timing import TURN_SECONDS, TimedPeer, V, fastest_variant, time_in_turns
from studies.speed.workload import (
    DT,
    MODEL,
    PowerForm,
    Run,
    Workload,
    candidates,
    displacement_record,
    measured_force,
)


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
    pin(cores)
    try:
        for batch in batches:
            for general_exponent in (True, False):
                measurement = measure(batch, len(cores), rounds[0], general_exponent=general_exponent)
                send("measurement", asdict(measurement))
    except MrworkError as error:
        send("failure", str(error))


def measure(batch: int, threads: int, rounds: int, *, general_exponent: bool) -> Measurement:
    """Time our kernel and the fastest variant of each installed peer, in turns, on one batch."""
    from mrwork import dampers as core

    displacement = displacement_record()
    force = measured_force(displacement)
    theta = candidates(batch, general_exponent=general_exponent, rng=np.random.default_rng(2007))
    loading = core.LoadingHistory(DT, displacement, None)
    workload = Workload(theta=theta, stages=np.ascontiguousarray(loading.stages(1)), force=force, dt=DT)
    label = f"batch {batch}, {threads} thread(s), {'general exponent' if general_exponent else 'n = 2'}"

    def ours() -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32]]:
        return core.misfits(MODEL, theta, loading, force, threads=threads)[:3]

    expected, _, substeps = ours()
    if int(substeps.max()) != 1:
        raise MrworkError(
            "expected one step per sample for every candidate, the stiffness rule asks for "
            f"{int(substeps.max())}; use a milder candidate box in bench/workload.py"
        )

    runs: dict[str, Run] = {"ours": ours}
    variants: dict[str, str] = {}

    def enter(name: str, peer: TimedPeer[V]) -> None:
        send("progress", f"{label}: choosing the fastest {name}")
        runs[name], variants[name] = fastest_variant(name, peer, expected)

    forms: dict[str, PowerForm] = {"": "power", "_exp_log": "exp_log"} if general_exponent else {"": "square"}
    for suffix, form in forms.items():
        if importlib.util.find_spec("jax") is not None:
            from studies.speed import jax_peer

            peer = TimedPeer(
                start=jax_peer.START,
                changes=jax_peer.CHANGES,
                prepare=partial(jax_peer.prepare, workload, form),
            )
            enter("jax" + suffix, peer)
        if importlib.util.find_spec("numba") is not None:
            from studies.speed import numba_peer

            peer_ = TimedPeer(
                start=numba_peer.START,
                changes=numba_peer.CHANGES,
                prepare=partial(numba_peer.prepare, workload, form),
            )
            enter("numba" + suffix, peer_)

    send("progress", f"{label}: timing {', '.join(runs)} in {rounds} rounds")
    seconds, fma_peak = time_in_turns(runs, rounds, lambda: core.fma_peak(threads, TURN_SECONDS / 2))
    return Measurement(
        batch=batch,
        threads=threads,
        general_exponent=general_exponent,
        speeds={name: workload.steps / value for name, value in seconds.items()},
        variants=variants,
        flops_per_step=float(core.flops_per_step(MODEL, theta[0])),
        fma_peak=fma_peak,
        instruction_set=core.instruction_set().used,
    )


if __name__ == "__main__":
    main()
