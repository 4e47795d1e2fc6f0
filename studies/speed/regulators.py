"""`study.py regulators`: Riccati gains of many plants beside `scipy.linalg.solve_continuous_are`."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from mrwork.errors import SettingError
from studies.speed.processes import cores_for, run_worker
from studies.speed.regulators_worker import RegulatorRow, RegulatorSettings

# Equations of a batch by states: about a tenth of a second of ours on one thread.
_BATCHES = {6: 8192, 10: 4096, 20: 512, 40: 64}
# SciPy takes its time, and its equations are solved one after another.
_OF_SCIPY = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class RegulatorBenchmark:
    """All rows of one run."""

    rows: tuple[RegulatorRow, ...]
    rounds: int

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self)


def bench_regulators(
    *,
    states: Sequence[int] = (6, 10, 20, 40),
    threads: Sequence[int] = (1, 2),
    rounds: int = 7,
    batch: int | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> RegulatorBenchmark:
    """Regulators of shear frames, each with its own plant and weight; see `regulators_worker.frames`.

    Parameters
    ----------
    states
        States of the plants, even numbers.
    threads
        Numbers of threads, each in a process of its own on as many cores. SciPy is given a pool of as many threads.
    rounds
        Repetitions, of which the median counts; ours and SciPy take turns.
    batch
        Equations of a batch; by default a number for each size that takes about a tenth of a second.
    on_progress
        Called with one line of text for each row.
    """
    if (
        not threads
        or not states
        or min(*threads, *states, rounds, batch or 1) < 1
        or any(n % 2 for n in states)
    ):
        raise SettingError("`threads`, `rounds` and `batch` must be 1 or more, `states` even and positive")
    cores = cores_for(threads)
    rows: list[RegulatorRow] = []
    for count in threads:
        for n in states:
            size = batch or _BATCHES.get(n, max(8, 4_000_000 // n**3))
            settings = RegulatorSettings(
                states=n, batch=size, scipy_batch=min(size, _OF_SCIPY), rounds=rounds
            )
            received = run_worker(
                "studies.speed.regulators_worker", cores[:count], [json.dumps(asdict(settings))]
            )
            (row,) = [RegulatorRow(**content) for kind, content in received if kind == "row"]
            rows.append(row)
            if on_progress is not None:
                on_progress(f"{count} thread(s), {n} states: {row.ours:.0f} designs/s")
    return RegulatorBenchmark(rows=tuple(rows), rounds=rounds)


def format_regulators(benchmark: RegulatorBenchmark) -> str:
    """Return the benchmark as aligned text."""
    lines = [
        "Riccati gains of shear frames with one device, a plant and a weight each; designs per second, medians of "
        f"{benchmark.rounds} rounds",
        "",
        f"{'states':>6} {'batch':>6} {'threads':>7} {'ours':>9} {'scipy':>8} {'ratio':>7} {'residual':>9} "
        f"{'of scipy':>9} {'gains differ':>12}",
    ]
    lines += [
        f"{row.states:>6} {row.batch:>6} {row.threads:>7} {row.ours:>9.0f} {row.scipy:>8.0f} {row.ratio:>7.1f} "
        f"{row.residual:>9.1e} {row.scipy_residual:>9.1e} {row.difference:>12.0e}"
        for row in benchmark.rows
    ]
    return "\n".join(lines)
