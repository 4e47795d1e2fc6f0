"""`study.py models`: every registered damper model beside its own twin in jax, in the same run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mrwork.dampers import damper, damper_models
from mrwork.errors import SettingError
from studies.speed.model_worker import ModelMeasurement
from studies.speed.processes import cores_for, run_worker
from studies.speed.workload import N_TIME


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRow:
    """One model on one number of threads.

    Attributes
    ----------
    substeps : Runge-Kutta steps per sample, the same for both.
    dt : sampling step of the record [s].
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
class ModelBenchmark:
    """All rows of one run."""

    rows: tuple[ModelRow, ...]
    instruction_set: str
    n_time: int
    rounds: int

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self)


def bench_models(
    *,
    models: Sequence[str] = (),
    batch: int = 1024,
    threads: Sequence[int] = (1,),
    n_time: int = N_TIME,
    rounds: int = 7,
    on_progress: Callable[[str], None] | None = None,
) -> ModelBenchmark:
    """Misfits of a batch of candidates of each model: our kernel and the model's twin, in turns.

    Each number of threads gets a process of its own, pinned to that many cores. The twin's layout and compiler
    settings are searched first and the fastest is timed; compilation is never timed.

    Parameters
    ----------
    models : names, all registered models if empty.
    batch : number of candidates.
    threads : numbers of threads, none above the cores of this machine.
    n_time : samples of the record.
    rounds : turns of each contender, of which the median counts.
    on_progress : called with one line of text for each model and number of threads.
    """
    names = [damper(name).name for name in models] or [spec.name for spec in damper_models()]
    if not threads or min(*threads, batch, rounds) < 1 or n_time < 4:
        raise SettingError("`batch`, `threads` and `rounds` must be 1 or more, `n_time` 4 or more")
    cores = cores_for(threads)
    measurements: list[ModelMeasurement] = []
    for count in threads:
        arguments = [",".join(names), str(batch), str(n_time), str(rounds)]
        for kind, content in run_worker("studies.speed.model_worker", cores[:count], arguments):
            if kind == "measurement":
                measurements.append(ModelMeasurement(**content))
            elif on_progress is not None:
                on_progress(f"[{len(measurements) + 1} of {len(names) * len(threads)}] {content}")
    return ModelBenchmark(
        rows=tuple(row_of(measurement) for measurement in measurements),
        instruction_set=measurements[0].instruction_set,
        n_time=n_time,
        rounds=rounds,
    )


def row_of(measurement: ModelMeasurement) -> ModelRow:
    """Ratio to the twin and share of the machine's peak."""
    ours, jax, jax_scan = (measurement.speeds[name] for name in ("ours", "jax", "jax_scan"))
    return ModelRow(
        model=measurement.model,
        n_states=measurement.n_states,
        batch=measurement.batch,
        threads=measurement.threads,
        substeps=measurement.substeps,
        dt=measurement.dt,
        ours=ours,
        jax=jax,
        jax_scan=jax_scan,
        ratio_jax=ours / jax,
        ratio_jax_scan=ours / jax_scan,
        peak_fraction=ours * measurement.flops_per_step / measurement.fma_peak,
        flops_per_step=measurement.flops_per_step,
        fma_peak=measurement.fma_peak,
        variants=measurement.variants,
    )


def format_models(benchmark: ModelBenchmark) -> str:
    """Return the benchmark as aligned text: speeds in million steps/s, ratios, share of the peak."""
    first = benchmark.rows[0]
    lines = [
        f"models beside their twins in jax: batch {first.batch}, {benchmark.n_time} samples, {first.substeps} step "
        f"per sample, misfit only, {benchmark.instruction_set};",
        f"medians of {benchmark.rounds} rounds, in million steps/s",
        "",
        f"{'model':<36} {'states':>6} {'threads':>7} {'ours':>8} {'jax':>8} {'jax_scan':>8} {'ours/jax':>8} "
        f"{'ours/jax_scan':>13} {'of FMA peak':>11}",
    ]
    lines += [
        f"{row.model:<36} {row.n_states:>6} {row.threads:>7} {row.ours / 1e6:>8.1f} {row.jax / 1e6:>8.1f} "
        f"{row.jax_scan / 1e6:>8.1f} {row.ratio_jax:>8.1f} {row.ratio_jax_scan:>13.1f} {row.peak_fraction:>11.1%}"
        for row in sorted(benchmark.rows, key=lambda row: (row.threads, row.n_states == 0))
    ]
    lines += [
        "",
        "jax: vmap of the twin's simulate. jax_scan: the twin's equations in one scan that keeps the misfit alone.",
    ]
    if any(row.n_states == 0 for row in benchmark.rows):
        lines += [
            "A model without a state has no step to take, only a force to evaluate: XLA makes one loop of that, which",
            "runs in vectors as ours does. The share of the peak limits what is left to gain.",
        ]
    lines.append("")
    lines += [
        f"fastest {name} of {row.model}, {row.threads} thread(s), samples {row.dt:.3g} s apart: {variant}"
        for row in benchmark.rows
        for name, variant in row.variants.items()
    ]
    return "\n".join(lines)
