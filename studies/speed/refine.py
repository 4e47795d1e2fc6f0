"""`study.py refine`: seconds and simulations from a start to a minimum, both our engines beside SciPy on numba."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from mrwork.errors import MrworkError, SettingError
from studies.speed.bars import Bar
from studies.speed.refine_engines import Ended, Engine, engines
from studies.speed.refine_job import RefineJob, joint_job, reference_job

# 0.01 points of fit.
_NEAR = 1e-4
# Residuals of the peer differ from ours by rounding and by its power.
_AGREEMENT = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class RefineRow:
    """One engine on one job: medians over the starts, share of those that came within 0.01 points of the best known."""

    engine: str
    job: str
    seconds: float
    simulations: float
    success: float
    n_starts: int
    compile_seconds: float
    is_ours: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RefineBenchmark:
    """All that one run found; `best_known_percent` and whether a test was synthetic by job."""

    rows: tuple[RefineRow, ...]
    bars: tuple[Bar, ...]
    best_known_percent: dict[str, float]
    synthetic: dict[str, bool]
    numba_layout: dict[str, str]
    missing: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self) | {"bars": [asdict(bar) | {"met": bar.met} for bar in self.bars]}


def bench_refine(
    *,
    seeds: int = 20,
    threads: int = 0,
    quick: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> RefineBenchmark:
    """Refine the same starts with every engine in turns, start by start.

    First calls, with loading and compiling, come before and are reported separately.

    Parameters
    ----------
    seeds : starts of each job.
    threads : threads of our simulation, 0 for all; numba has all.
    quick : one record only, without the twin, the first numba that comes.
    on_progress : called with one line of text.
    """
    if seeds < 1:
        raise SettingError(f"`seeds` is {seeds}; give 1 or more")
    report = on_progress or (lambda _: None)
    jobs: list[RefineJob] = [reference_job(seeds, threads)]
    missing = []
    joint = None if quick else joint_job(seeds, threads)
    if joint is not None:
        jobs.append(joint)
    elif not quick:
        missing.append("measured records of the joint job")
    if find_spec("numba") is None:
        missing.append("numba")
    rows: list[RefineRow] = []
    best: dict[str, float] = {}
    layouts: dict[str, str] = {}
    for job in jobs:
        report(f"{job.name}: {len(job.objective.tests)} test(s), {job.objective.n_time} samples")
        peer = None
        if "numba" not in missing:
            from studies.speed.numba_residuals import LAYOUTS, fastest_layout

            peer = fastest_layout(job, LAYOUTS[-1:] if quick else LAYOUTS)
            layouts[job.name] = peer.layout.describe()
            difference = np.max(np.abs(peer(job.starts) - job.objective.residuals(job.starts)))
            if difference > _AGREEMENT:
                raise MrworkError(
                    f"residuals of numba on the {job.name} job differ from ours by {difference:.2g}"
                )
        # Thirty scans take minutes to compile and differentiate.
        taking_part = engines(job, twin=not quick and job.name == "reference", peer=peer)
        own, best[job.name] = _rows(job, taking_part, report)
        rows += own
    return RefineBenchmark(
        rows=tuple(rows),
        bars=tuple(_bars(rows)),
        best_known_percent=best,
        synthetic={job.name: job.synthetic for job in jobs},
        numba_layout=layouts,
        missing=tuple(missing),
    )


def _rows(
    job: RefineJob, taking_part: list[Engine], report: Callable[[str], None]
) -> tuple[list[RefineRow], float]:
    """Rows of one job, and the fit in % of the best minimum that any engine found."""
    first_call: dict[str, float] = {}
    for engine in taking_part:
        began = time.perf_counter()
        engine.run(job.starts[: engine.at_once])
        first_call[engine.name] = time.perf_counter() - began
        report(f"{job.name}, {engine.name}: first call {first_call[engine.name]:.2f} s")
    found: dict[str, list[tuple[float, Ended]]] = {engine.name: [] for engine in taking_part}
    for index in range(len(job.starts)):
        for engine in taking_part:
            if index % engine.at_once:
                continue
            starts = job.starts[index : index + engine.at_once]
            began = time.perf_counter()
            ended = engine.run(starts)
            found[engine.name].append(((time.perf_counter() - began) / len(starts), ended))
    misfits = {name: np.concatenate([ended.misfit for _, ended in own]) for name, own in found.items()}
    least = min(float(own.min()) for own in misfits.values())
    rows = []
    for engine in taking_part:
        seconds = float(np.median([spent for spent, _ in found[engine.name]]))
        rows.append(
            RefineRow(
                engine=engine.name,
                job=job.name,
                seconds=seconds,
                simulations=float(np.median([ended.simulations for _, ended in found[engine.name]])),
                success=float(np.mean(misfits[engine.name] <= least + _NEAR)),
                n_starts=len(misfits[engine.name]),
                compile_seconds=max(first_call[engine.name] - seconds * engine.at_once, 0.0),
                is_ours=engine.is_ours,
            )
        )
    return rows, 100.0 * (1.0 - least)


def _bars(rows: list[RefineRow]) -> list[Bar]:
    bars = []
    for job in dict.fromkeys(row.job for row in rows):
        # Of several starts at once each has its share only where there are several.
        ours = min(
            (row for row in rows if row.job == job and row.is_ours and "at once" not in row.engine),
            key=lambda row: (-row.success, row.seconds),
        )
        theirs = [row for row in rows if row.job == job and not row.is_ours]
        bars.append(
            Bar(
                claim=f"{job}, {ours.engine}: share of starts that arrive",
                threads=0,
                aim=1.0,
                measured=ours.success,
            )
        )
        bars += [
            Bar(
                claim=f"{job}, {ours.engine}: times faster than {row.engine}",
                threads=0,
                aim=3.0,
                measured=row.seconds / ours.seconds,
            )
            for row in theirs
        ]
    return bars


def format_refine(benchmark: RefineBenchmark) -> str:
    """Return the benchmark as aligned text."""
    lines = [
        "from starts near a minimum to the minimum, normalised_bouc_wen; medians over the starts, in turns",
        "",
    ]
    lines.append(
        f"{'job':<10} {'engine':<25} {'ms':>9} {'simulations':>11} {'success':>8} {'starts':>6} {'compile s':>9}"
    )
    lines += [
        f"{row.job:<10} {row.engine:<25} {1e3 * row.seconds:>9.2f} {row.simulations:>11.0f} {row.success:>8.0%} "
        f"{row.n_starts:>6} {row.compile_seconds:>9.2f}"
        for row in benchmark.rows
    ]
    lines += [
        "",
        "A simulation of ours brings its exact Jacobian along. Success: within 0.01 points of the best known.",
    ]
    for job, percent in benchmark.best_known_percent.items():
        kind = "SYNTHETIC, the measured record is not here" if benchmark.synthetic[job] else "measured"
        lines.append(f"{job}: best known {percent:.3f} % ({kind})")
    lines += [f"{job}: fastest numba {layout}" for job, layout in benchmark.numba_layout.items()]
    lines += [f"not here: {name}" for name in benchmark.missing]
    for bar in benchmark.bars:
        measured = "nothing" if bar.measured is None else f"{bar.measured:.3g}"
        lines.append(f"{'met' if bar.met else 'NOT MET':<8} {bar.claim}: {measured}, aim {bar.aim:g}")
    return "\n".join(lines)
