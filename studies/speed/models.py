"""`study.py models`: every registered damper model beside its own twin in jax, in the same run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mrwork import dampers as core
from mrwork.dampers import damper, damper_models
from mrwork.errors import SettingError
from studies.former.table import table_of
from studies.speed.timing import TimedPeer, beside_peers
from studies.speed.workers import Benchmark, Say, cores_for, rows_of, silent
from studies.speed.workload import N_TIME, SUBSTEPS, ModelWorkload, model_workload


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRow:
    """One model on one number of threads.

    Attributes
    ----------
    substeps : Runge-Kutta steps per sample, the same for both.
    dt : sampling step of the record [s], at which one step per sample resolves the batch.
    ours, jax, jax_scan : Runge-Kutta steps per second; without a state, evaluations of the force per second. `jax`
        is the twin as users run it, `jax_scan` its equations rewritten for misfits alone; see `twin_peer`.
    variants : the fastest layout and compilation of each, which was timed.
    peak_fraction : our floating-point operations per second over those of independent fused multiply-adds.
    """

    model: str
    n_states: int
    batch: int
    threads: int
    substeps: int
    dt: float
    ours: float
    jax: float
    jax_scan: float
    ratio_jax: float
    ratio_jax_scan: float
    peak_fraction: float
    flops_per_step: float
    fma_peak: float
    variants: dict[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelBenchmark(Benchmark):
    """All rows of one run."""

    rows: tuple[ModelRow, ...]
    instruction_set: str
    n_time: int
    rounds: int

    def text(self) -> Iterator[str]:
        """Speeds in million steps/s, ratios, share of the peak."""
        yield (
            f"models beside their twins in jax: batch {self.rows[0].batch}, {self.n_time} samples, {SUBSTEPS} step "
            f"per sample, misfit only, {self.instruction_set};"
        )
        yield f"medians of {self.rounds} rounds, in million steps/s"
        yield ""
        ranked = sorted(self.rows, key=lambda row: (row.threads, row.n_states == 0))
        yield from table_of(
            "",
            "model",
            ((row.model, asdict(row)) for row in ranked),
            {
                "states": "{n_states}",
                "threads": "{threads}",
                "ours": lambda row: f"{row['ours'] / 1e6:.1f}",
                "jax": lambda row: f"{row['jax'] / 1e6:.1f}",
                "jax_scan": lambda row: f"{row['jax_scan'] / 1e6:.1f}",
                "ours/jax": "{ratio_jax:.1f}",
                "ours/jax_scan": "{ratio_jax_scan:.1f}",
                "of FMA peak": "{peak_fraction:.1%}",
            },
        ).lines()
        yield ""
        yield "jax: vmap of the twin's simulate. jax_scan: its equations in one scan that keeps the misfit alone."
        if any(row.n_states == 0 for row in self.rows):
            yield "A model without a state has no step to take, only a force to evaluate: XLA makes one loop of that,"
            yield "which runs in vectors as ours does. The share of the peak limits what is left to gain."
        yield ""
        for row in self.rows:
            for name, variant in row.variants.items():
                where = f"{row.model}, {row.threads} thread(s), samples {row.dt:.3g} s apart"
                yield f"fastest {name} of {where}: {variant}"


def bench_models(
    *,
    models: Sequence[str] = (),
    batch: int = 1024,
    threads: Sequence[int] = (1,),
    n_time: int = N_TIME,
    rounds: int = 7,
    say: Say = silent,
) -> ModelBenchmark:
    """Misfits of a batch of candidates of each model: our kernel and the model's twin, in turns.

    Each number of threads gets a process of its own, pinned to that many cores. The twin's layout and compiler
    settings are searched first and the fastest is timed; compilation is never timed.
    """
    names = [damper(name).name for name in models] or [spec.name for spec in damper_models()]
    if not threads or min(*threads, batch, rounds) < 1 or n_time < 4:
        raise SettingError("`batch`, `threads` and `rounds` must be 1 or more, `n_time` 4 or more")
    cores = cores_for(threads)
    settings = {"models": names, "batch": batch, "n_time": n_time, "rounds": rounds}
    return ModelBenchmark(
        rows=tuple(row for count in threads for row in rows_of(measure, cores[:count], settings, say)),
        instruction_set=core.instruction_set().used,
        n_time=n_time,
        rounds=rounds,
    )


def measure(
    *, threads: int, models: Sequence[str], batch: int, n_time: int, rounds: int
) -> Iterator[ModelRow | str]:
    """Every model and its twin, in turns."""
    from studies.speed.twin_peer import twins_of

    for name in models:
        workload = model_workload(damper(name), batch, n_time)
        yield from measured(workload, twins_of(workload), threads, rounds)


def measured(
    workload: ModelWorkload, peers: Mapping[str, TimedPeer[Any]], threads: int, rounds: int
) -> Iterator[ModelRow | str]:
    """One model and its twin."""
    spec = workload.spec
    for told in beside_peers(
        lambda: workload.misfits(threads)[0],
        peers,
        label=spec.name,
        steps=workload.steps,
        rounds=rounds,
        threads=threads,
        flops_per_step=float(core.flops_per_step(spec.name, workload.theta[0])),
    ):
        yield (
            told
            if isinstance(told, str)
            else ModelRow(
                model=spec.name,
                n_states=spec.n_states,
                batch=len(workload.theta),
                threads=threads,
                substeps=SUBSTEPS,
                dt=workload.loading.dt,
                **told,
            )
        )
