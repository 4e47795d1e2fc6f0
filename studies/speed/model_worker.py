"""One process of the models' benchmark: pinned to its cores, it times every model and its twin, in turns.

Run as `python -m studies.speed.model_worker CORES MODELS BATCH SAMPLES ROUNDS` (comma-separated) by
`bench_models`. It sends `progress` (text), `measurement` or `failure` (text).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from mrwork import dampers as core
from mrwork.dampers import damper
from mrwork.errors import MrworkError
from studies.speed.model_workload import SUBSTEPS, ModelWorkload, model_workload
from studies.speed.processes import pin, send
from studies.speed.timing import TURN_SECONDS, TimedPeer, V, fastest_variant, time_in_turns
from studies.speed.workload import Run


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelMeasurement:
    """Medians over the rounds, for one model and number of threads.

    Speeds are in Runge-Kutta steps/s, or evaluations of the force/s where the model has no state; `dt` [s] is the
    sampling step at which one step per sample resolves the batch.
    """

    model: str
    n_states: int
    batch: int
    threads: int
    substeps: int
    dt: float
    speeds: dict[str, float]
    variants: dict[str, str]
    flops_per_step: float
    fma_peak: float
    instruction_set: str


def main() -> None:
    """Pin this process, then measure every model."""
    cores, names, *numbers = (text.split(",") for text in sys.argv[1:6])
    batch, n_time, rounds = (int(number) for (number,) in numbers)
    pin([int(core) for core in cores])
    from studies.speed.twin_peer import twins_of

    try:
        for name in names:
            send("progress", f"{name}, {len(cores)} thread(s)")
            workload = model_workload(damper(name), batch, n_time)
            measurement = measure_model(workload, twins_of(workload), len(cores), rounds)
            send("measurement", asdict(measurement))
    except MrworkError as error:
        send("failure", str(error))


def measure_model(
    workload: ModelWorkload, peers: Mapping[str, TimedPeer[V]], threads: int, rounds: int
) -> ModelMeasurement:
    """Time our kernel and the fastest variant of each peer in turns, once they agree."""
    spec = workload.spec
    expected, _, _ = workload.misfits(threads)
    runs: dict[str, Run] = {"ours": lambda: workload.misfits(threads)}
    variants: dict[str, str] = {}
    for name, peer in peers.items():
        runs[name], variants[name] = fastest_variant(f"{spec.name} as {name}", peer, expected)
    seconds, fma_peak = time_in_turns(runs, rounds, lambda: core.fma_peak(threads, TURN_SECONDS / 2))
    return ModelMeasurement(
        model=spec.name,
        n_states=spec.n_states,
        batch=len(workload.theta),
        threads=threads,
        substeps=SUBSTEPS,
        dt=workload.loading.dt,
        speeds={name: workload.steps / value for name, value in seconds.items()},
        variants=variants,
        flops_per_step=float(core.flops_per_step(spec.name, workload.theta[0])),
        fma_peak=fma_peak,
        instruction_set=core.instruction_set().used,
    )


if __name__ == "__main__":
    main()
