"""`study.py kernels`: our Runge-Kutta steps per second beside jax and numba, in the same run."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from mrwork import dampers as core
from mrwork.errors import MrworkError, SettingError
from studies.former.table import table_of
from studies.speed.timing import TimedPeer, beside_peers
from studies.speed.workers import Benchmark, Say, cores_for, rows_of, silent
from studies.speed.workload import (
    DT,
    MODEL,
    N_TIME,
    PowerForm,
    Workload,
    candidates,
    displacement_record,
    measured_force,
)

PEERS = ("jax", "numba")


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelRow:
    """One batch on one number of threads; speeds in Runge-Kutta steps per second, `None` where not installed.

    `jax` and `numba` evaluate |w|^n as we do, by a power (or w w for n = 2). `jax_exp_log` and
    `numba_exp_log` write exp(n ln|w|) instead, which keeps fewer digits and is faster; the misfits still
    agree to 1e-9.
    """

    model: str
    batch: int
    threads: int
    general_exponent: bool
    ours: float
    jax: float | None = None
    numba: float | None = None
    ratio_jax: float | None = None
    ratio_numba: float | None = None
    jax_exp_log: float | None = None
    numba_exp_log: float | None = None
    ratio_jax_exp_log: float | None = None
    ratio_numba_exp_log: float | None = None
    peak_fraction: float
    flops_per_step: float
    fma_peak: float
    variants: dict[str, str]

    @property
    def where(self) -> str:
        """What was measured, for the text."""
        return f"batch {self.batch}, {self.threads} thread(s), {_exponent(self.general_exponent)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreadScaling:
    """Our speed on several threads over our speed on one."""

    batch: int
    general_exponent: bool
    threads: int
    scaling: float


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelBenchmark(Benchmark):
    """All rows of one run.

    `peak_fraction` is that of the largest batch with a general exponent on the most threads: floating-point
    operations per second of our kernel over those of independent fused multiply-adds, measured in the same
    run.
    """

    rows: tuple[KernelRow, ...]
    peak_fraction: float
    thread_scaling: tuple[ThreadScaling, ...]
    instruction_set: str
    n_time: int
    rounds: int

    def text(self) -> Iterator[str]:
        """Speeds in million steps/s, ratios, the peers' variants."""
        yield f"RK4 steps of {MODEL}, record of {self.n_time} samples, misfit only, {self.instruction_set};"
        yield f"medians of {self.rounds} rounds, in million steps/s"
        yield ""
        yield from table_of(
            "",
            "batch",
            (line for row in self.rows for line in _lines(row)),
            {
                "threads": "{threads}",
                "|w|^n": "{form}",
                **{name: partial(_million, name) for name in ("ours", *PEERS)},
                **{f"ours/{name}": partial(_ratio, f"ratio_{name}") for name in PEERS},
                "of FMA peak": "{peak_fraction:.1%}",
            },
        ).lines()
        yield ""
        yield "exp(n ln|w|): the peers with a faster, less accurate power; ours unchanged."
        yield ""
        for item in self.thread_scaling:
            exponent = _exponent(item.general_exponent)
            yield f"{item.threads} threads over 1, batch {item.batch}, {exponent}: {item.scaling:.2f}"
        yield ""
        for row in self.rows:
            for name, variant in row.variants.items():
                yield f"fastest {name}, {row.where}: {variant}"
        missing = [name for name in PEERS if all(name not in row.variants for row in self.rows)]
        if missing:
            yield f"not installed: {', '.join(missing)}; to compare, run: pip install 'mrwork[bench]'"


def _lines(row: KernelRow) -> Iterator[tuple[str, dict[str, Any]]]:
    """Lines of the table: one with our form of the power, and one with the peers' faster form."""
    cells = asdict(row)
    yield str(row.batch), cells | {"form": "power" if row.general_exponent else "w w (n = 2)"}
    if row.general_exponent:
        faster = {key: cells[f"{key}_exp_log"] for name in PEERS for key in (name, f"ratio_{name}")}
        yield str(row.batch), cells | faster | {"form": "exp(n ln|w|)"}


def _million(name: str, cells: Mapping[str, Any]) -> str:
    return "-" if cells[name] is None else f"{cells[name] / 1e6:.1f}"


def _ratio(name: str, cells: Mapping[str, Any]) -> str:
    return "-" if cells[name] is None else f"{cells[name]:.1f}"


def _exponent(general: bool) -> str:
    return "general exponent" if general else "n = 2"


def bench_kernels(
    *,
    batches: Sequence[int] = (64, 1024),
    threads: Sequence[int] = (1, 2),
    rounds: int = 7,
    say: Say = silent,
) -> KernelBenchmark:
    """Misfits of a batch of normalised Bouc-Wen candidates: ours, jitted jax and parallel numba, in turns.

    Each number of threads gets a process of its own, pinned to that many cores. The peers' layout and
    compiler settings are searched first and the fastest is timed; compilation is never timed.
    """
    if not batches or not threads or min(*batches, *threads, rounds, 1) < 1:
        raise SettingError("`batches`, `threads` and `rounds` must be 1 or more; give positive numbers")
    cores = cores_for(threads)
    settings = {"batches": list(batches), "rounds": rounds}
    rows = [row for count in threads for row in rows_of(measure, cores[:count], settings, say)]
    return summarise(rows, rounds)


def measure(*, threads: int, batches: Sequence[int], rounds: int) -> Iterator[KernelRow | str]:
    """Every batch with a general exponent and with n = 2: our kernel and the fastest variant of each peer, in turns."""
    displacement = displacement_record()
    force = measured_force(displacement)
    loading = core.LoadingHistory(DT, displacement, None)
    stages = np.ascontiguousarray(loading.stages(1))
    for batch, general_exponent in product(batches, (True, False)):
        theta = candidates(batch, general_exponent=general_exponent, rng=np.random.default_rng(2007))
        _, _, substeps = core.misfits(MODEL, theta, loading, force, threads=threads)[:3]
        if int(substeps.max()) != 1:
            raise MrworkError(
                "expected one step per sample for every candidate, the stiffness rule asks for "
                f"{int(substeps.max())}; use a milder candidate box in workload.py"
            )
        workload = Workload(theta=theta, stages=stages, force=force, dt=DT)
        for told in beside_peers(
            lambda theta=theta: core.misfits(MODEL, theta, loading, force, threads=threads)[0],  # type: ignore[misc] # its type is that of the default
            _peers(workload, general_exponent=general_exponent),
            label=f"batch {batch}, {_exponent(general_exponent)}",
            steps=workload.steps,
            rounds=rounds,
            threads=threads,
            flops_per_step=float(core.flops_per_step(MODEL, theta[0])),
        ):
            yield (
                told
                if isinstance(told, str)
                else KernelRow(
                    model=MODEL, batch=batch, threads=threads, general_exponent=general_exponent, **told
                )
            )


def _peers(workload: Workload, *, general_exponent: bool) -> dict[str, TimedPeer[Any]]:
    """Those that are installed, with each form of the power."""
    forms: dict[str, PowerForm] = {"": "power", "_exp_log": "exp_log"} if general_exponent else {"": "square"}
    peers: dict[str, TimedPeer[Any]] = {}
    for (suffix, form), name in product(forms.items(), PEERS):
        if importlib.util.find_spec(name) is not None:
            module = importlib.import_module(f"studies.speed.{name}_peer")
            peers[name + suffix] = TimedPeer(
                start=module.START,
                changes=module.CHANGES,
                prepare=partial(module.prepare, workload, form),
            )
    return peers


def summarise(rows: Sequence[KernelRow], rounds: int) -> KernelBenchmark:
    """Thread scaling, and the share of the peak that counts."""
    alone = {(row.batch, row.general_exponent): row.ours for row in rows if row.threads == 1}
    return KernelBenchmark(
        rows=tuple(rows),
        peak_fraction=max(rows, key=lambda row: (row.general_exponent, row.batch, row.threads)).peak_fraction,
        thread_scaling=tuple(
            ThreadScaling(
                batch=row.batch,
                general_exponent=row.general_exponent,
                threads=row.threads,
                scaling=row.ours / alone[row.batch, row.general_exponent],
            )
            for row in rows
            if row.threads > 1 and (row.batch, row.general_exponent) in alone
        ),
        instruction_set=core.instruction_set().used,
        n_time=N_TIME,
        rounds=rounds,
    )
