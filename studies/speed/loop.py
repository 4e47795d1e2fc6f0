"""`study.py loop`: thousands of closed-loop runs of a building, beside numba, jax, SciPy and python-control."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.errors import MrworkError, SettingError
from studies.speed.loop_worker import LoopMeasurement, LoopSettings
from studies.speed.loop_workload import STEP, Floats
from studies.speed.processes import cores_for, run_worker

OURS = "mrwork"
# Each with the package it needs. The series is numba with a tanh of its own, fit for vectors.
_PACKAGES = {"numba": "numba", "numba_series": "numba", "jax": "jax"}
# One run, the rest extrapolated.
_ALONE = {"solve_ivp": "scipy", "python_control": "control"}
# Runs of 30 000 steps in double precision whose sums are formed in different orders, against the largest of a column.
AGREEMENT = 1e-9
# A method of another order on the same loop.
_LOOSE_AGREEMENT = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopRow:
    """One contender on one number of threads.

    Attributes
    ----------
    runs, seconds : all of them, and the median time they take. Where `extrapolated`, one run was timed on one core,
        and the others are taken to be like it, shared without loss among the threads.
    ratio : its seconds over ours, `None` where we did not take part.
    compile_seconds : apart from `seconds`.
    variant : the fastest layout, which was timed.
    difference : largest deviation of what is kept of the runs from what we find, against the largest of its kind.
    """

    tool: str
    threads: int
    runs: int
    seconds: float
    ratio: float | None
    extrapolated: bool
    compile_seconds: float
    variant: str
    difference: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopBenchmark:
    """All rows of one run; `left_out` names contenders that are not installed."""

    rows: tuple[LoopRow, ...]
    left_out: tuple[str, ...]
    candidates: int
    motions: int
    seconds: float
    step: float
    rounds: int

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self)


def bench_loop(
    *,
    candidates: int = 1000,
    motions: int = 4,
    seconds: float = 30.0,
    threads: Sequence[int] = (1, 2),
    rounds: int = 3,
    on_progress: Callable[[str], None] | None = None,
) -> LoopBenchmark:
    """Clipped-optimal control of a five-storey building, candidates under motions; see `loop_workload`.

    Each contender has a process of its own for each number of threads, pinned to that many cores; they follow one
    another. The peers' layout is searched on a short piece and the fastest is timed; compilation is measured
    separately. What is kept of the runs must agree.

    Parameters
    ----------
    candidates, motions, seconds : rows of gains, ground motions, and how long each lasts [s].
    threads : numbers of threads, none above the cores of this machine.
    rounds : passes of each contender, of which the median counts; those that are extrapolated make one.
    on_progress : called with one line of text for each contender.
    """
    if not threads or min(*threads, candidates, motions, rounds) < 1 or not seconds >= STEP:
        raise SettingError(
            "`candidates`, `motions`, `threads` and `rounds` must be 1 or more, `seconds` a step or more"
        )
    cores = cores_for(threads)
    tools = {OURS: "mrwork", **_PACKAGES, **_ALONE}
    present = [tool for tool, package in tools.items() if importlib.util.find_spec(package) is not None]
    rows: list[LoopRow] = []
    with tempfile.TemporaryDirectory() as folder:
        for count in threads:
            measurements: dict[str, LoopMeasurement] = {}
            found: dict[str, Floats] = {}
            for tool in present:
                alone = tool in _ALONE
                file = Path(folder) / f"{tool}.npy"
                settings = LoopSettings(
                    tool=tool,
                    candidates=1 if alone else candidates,
                    motions=1 if alone else motions,
                    seconds=seconds,
                    rounds=1 if alone else rounds,
                    results=str(file),
                )
                measurements[tool] = _measured(settings, cores[: 1 if alone else count])
                if on_progress is not None:
                    item = measurements[tool]
                    on_progress(f"{count} thread(s): {tool}, {item.runs} run(s) in {item.seconds:.2f} s")
                found[tool] = np.load(file)
            rows += summarise(measurements, found, runs=candidates * motions, threads=count)
    return LoopBenchmark(
        rows=tuple(rows),
        left_out=tuple(tool for tool in tools if tool not in present),
        candidates=candidates,
        motions=motions,
        seconds=seconds,
        step=STEP,
        rounds=rounds,
    )


def summarise(
    measurements: dict[str, LoopMeasurement], found: dict[str, Floats], *, runs: int, threads: int
) -> list[LoopRow]:
    """Rows of one number of threads."""
    whole = {
        tool: item.seconds if item.runs == runs else item.seconds * runs / item.runs / threads
        for tool, item in measurements.items()
    }
    reference = next(iter(found))
    rows = []
    for tool, item in measurements.items():
        difference = _difference(found[tool], found[reference])
        allowed = _LOOSE_AGREEMENT if tool == "solve_ivp" else AGREEMENT
        if not difference <= allowed:
            raise MrworkError(
                f"{tool} and {reference} were expected to agree on every run to {allowed:g}, they differ by "
                f"{difference:.2e} (relative); do not trust the times, find which one is wrong"
            )
        rows.append(
            LoopRow(
                tool=tool,
                threads=threads,
                runs=runs,
                seconds=whole[tool],
                ratio=whole[tool] / whole[OURS] if OURS in whole else None,
                extrapolated=item.runs != runs,
                compile_seconds=item.compile_seconds,
                variant=item.variant,
                difference=difference,
            )
        )
    return rows


def format_loop(benchmark: LoopBenchmark) -> str:
    """Return the benchmark as aligned text."""
    lines = [
        f"{benchmark.candidates} candidates x {benchmark.motions} motions of {benchmark.seconds:g} s: clipped-optimal "
        f"control of a five-storey building, command and step {1e3 * benchmark.step:g} ms; medians of "
        f"{benchmark.rounds} rounds, compilation apart",
        "",
        f"{'tool':<15} {'threads':>7} {'seconds':>10} {'ours x':>7} {'compiled':>9} {'differs':>8}  variant",
    ]
    for row in benchmark.rows:
        seconds = f"{row.seconds:.2f}" if row.seconds < 1000 else f"{row.seconds / 3600:.1f} h"
        ratio = "-" if row.ratio is None else f"{row.ratio:.1f}"
        mark = ", one run extrapolated" if row.extrapolated else ""
        lines.append(
            f"{row.tool:<15} {row.threads:>7} {seconds:>10} {ratio:>7} {row.compile_seconds:>7.1f} s "
            f"{row.difference:>8.0e}  {row.variant}{mark}"
        )
    lines += ["", "numba_series: numba with a tanh written out for vectors instead of the library's."]
    if benchmark.left_out:
        lines.append(f"not installed: {', '.join(benchmark.left_out)}")
    return "\n".join(lines)


def _measured(settings: LoopSettings, cores: Sequence[int]) -> LoopMeasurement:
    received = run_worker("studies.speed.loop_worker", cores, [json.dumps(asdict(settings))])
    (measurement,) = [LoopMeasurement(**content) for kind, content in received if kind == "measurement"]
    return measurement


def _difference(found: Floats, expected: Floats) -> float:
    motions, candidates = found.shape[:2]
    against = expected[:motions, :candidates]
    return float(np.max(np.abs(found - against) / np.abs(against).max(axis=(0, 1))))
