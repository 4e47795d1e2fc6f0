"""`study.py kernels`: our Runge-Kutta steps per second beside jax and numba, in the same run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mrwork.errors import SettingError
from studies.speed.processes import cores_for, run_worker
from studies.speed.worker import Measurement
from studies.speed.workload import MODEL, N_TIME


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
    jax: float | None
    numba: float | None
    ratio_jax: float | None
    ratio_numba: float | None
    jax_exp_log: float | None
    numba_exp_log: float | None
    ratio_jax_exp_log: float | None
    ratio_numba_exp_log: float | None
    peak_fraction: float
    flops_per_step: float
    fma_peak: float
    variants: dict[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreadScaling:
    """Our speed on several threads over our speed on one."""

    batch: int
    general_exponent: bool
    threads: int
    scaling: float


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelBenchmark:
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

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self)


def bench_kernels(
    *,
    batches: Sequence[int] = (64, 1024),
    threads: Sequence[int] = (1, 2),
    rounds: int = 7,
    on_progress: Callable[[str], None] | None = None,
) -> KernelBenchmark:
    """Misfits of a batch of normalised Bouc-Wen candidates: ours, jitted jax and parallel numba, in turns.

    Each number of threads gets a process of its own, pinned to that many cores. The peers' layout and
    compiler settings are searched first and the fastest is timed; compilation is never timed.

    Parameters
    ----------
    batches : numbers of candidates.
    threads : numbers of threads, none above the cores of this machine.
    rounds : turns of each contender, of which the median counts.
    on_progress : called with one line of text whenever something new is measured.
    """
    if not batches or not threads or min(*batches, *threads, rounds, 1) < 1:
        raise SettingError("`batches`, `threads` and `rounds` must be 1 or more; give positive numbers")
    cores = cores_for(threads)
    total = len(threads) * len(batches) * 2
    measurements: list[Measurement] = []
    for count in threads:
        arguments = [",".join(map(str, batches)), str(rounds)]
        for kind, content in run_worker("studies.speed.worker", cores[:count], arguments):
            if kind == "measurement":
                measurements.append(Measurement(**content))
            elif on_progress is not None:
                on_progress(f"[{len(measurements) + 1} of {total}] {content}")
    return summarise(measurements, rounds)


def summarise(measurements: Sequence[Measurement], rounds: int) -> KernelBenchmark:
    """Ratios, share of the machine's peak and thread scaling from what the workers measured."""
    rows = tuple(_row(measurement) for measurement in measurements)
    headline = max(rows, key=lambda row: (row.general_exponent, row.batch, row.threads))
    return KernelBenchmark(
        rows=rows,
        peak_fraction=headline.peak_fraction,
        thread_scaling=tuple(_scalings(rows)),
        instruction_set=measurements[0].instruction_set,
        n_time=N_TIME,
        rounds=rounds,
    )


def format_table(benchmark: KernelBenchmark) -> str:
    """Return the benchmark as aligned text: speeds in million steps/s, ratios, the peers' variants."""
    lines = [
        f"RK4 steps of {MODEL}, record of {benchmark.n_time} samples, misfit only, "
        f"{benchmark.instruction_set}; medians of {benchmark.rounds} rounds, in million steps/s",
        "",
        f"{'batch':>6} {'threads':>7} {'|w|^n':>12} {'ours':>9} {'jax':>9} {'numba':>9} "
        f"{'ours/jax':>9} {'ours/numba':>10} {'of FMA peak':>11}",
    ]
    for row in benchmark.rows:
        power = "power" if row.general_exponent else "w w (n = 2)"
        measured = _line(row, power, row.jax, row.numba, row.ratio_jax, row.ratio_numba)
        lines.append(f"{measured} {row.peak_fraction:>11.1%}")
        if row.general_exponent:
            ratios = row.ratio_jax_exp_log, row.ratio_numba_exp_log
            lines.append(_line(row, "exp(n ln|w|)", row.jax_exp_log, row.numba_exp_log, *ratios))
    lines += ["", "exp(n ln|w|): the peers with a faster, less accurate power; ours unchanged.", ""]
    for item in benchmark.thread_scaling:
        exponent = _exponent(item.general_exponent)
        lines.append(f"{item.threads} threads over 1, batch {item.batch}, {exponent}: {item.scaling:.2f}")
    lines.append("")
    for row in benchmark.rows:
        for name, variant in row.variants.items():
            where = f"batch {row.batch}, {row.threads} thread(s), {_exponent(row.general_exponent)}"
            lines.append(f"fastest {name}, {where}: {variant}")
    missing = [name for name in ("jax", "numba") if all(name not in row.variants for row in benchmark.rows)]
    if missing:
        lines.append(f"not installed: {', '.join(missing)}; to compare, run: pip install 'mrwork[bench]'")
    return "\n".join(lines)


def _exponent(general: bool) -> str:
    return "general exponent" if general else "n = 2"


def _line(
    row: KernelRow,
    power: str,
    jax: float | None,
    numba: float | None,
    ratio_jax: float | None,
    ratio_numba: float | None,
) -> str:
    speeds = " ".join(
        "-".rjust(9) if speed is None else f"{speed / 1e6:>9.1f}" for speed in (row.ours, jax, numba)
    )
    ratios = " ".join(
        "-".rjust(width) if ratio is None else f"{ratio:>{width}.1f}"
        for ratio, width in ((ratio_jax, 9), (ratio_numba, 10))
    )
    return f"{row.batch:>6} {row.threads:>7} {power:>12} {speeds} {ratios}"


def _row(measurement: Measurement) -> KernelRow:
    speeds = measurement.speeds
    ours = speeds["ours"]

    def ratio(name: str) -> float | None:
        return ours / speeds[name] if name in speeds else None

    return KernelRow(
        model=MODEL,
        batch=measurement.batch,
        threads=measurement.threads,
        general_exponent=measurement.general_exponent,
        ours=ours,
        jax=speeds.get("jax"),
        numba=speeds.get("numba"),
        ratio_jax=ratio("jax"),
        ratio_numba=ratio("numba"),
        jax_exp_log=speeds.get("jax_exp_log"),
        numba_exp_log=speeds.get("numba_exp_log"),
        ratio_jax_exp_log=ratio("jax_exp_log"),
        ratio_numba_exp_log=ratio("numba_exp_log"),
        peak_fraction=ours * measurement.flops_per_step / measurement.fma_peak,
        flops_per_step=measurement.flops_per_step,
        fma_peak=measurement.fma_peak,
        variants=measurement.variants,
    )


def _scalings(rows: Sequence[KernelRow]) -> Iterator[ThreadScaling]:
    alone = {(row.batch, row.general_exponent): row.ours for row in rows if row.threads == 1}
    for row in rows:
        key = row.batch, row.general_exponent
        if row.threads > 1 and key in alone:
            yield ThreadScaling(
                batch=row.batch,
                general_exponent=row.general_exponent,
                threads=row.threads,
                scaling=row.ours / alone[key],
            )
