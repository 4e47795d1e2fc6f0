"""`study.py refine`: seconds and simulations from a start to a minimum, our engines beside SciPy on numba."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec

import numpy as np

from mrwork.errors import SettingError
from studies.former.table import table_of
from studies.speed.refine_engines import Engine, Refined, engines
from studies.speed.refine_job import RefineJob, joint_job, reference_job
from studies.speed.timing import require_agreement, timed
from studies.speed.workers import Bar, Benchmark, Say, record_kind, silent

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
class RefineBenchmark(Benchmark):
    """All that one run found; `best_known_percent` and whether a test was synthetic by job."""

    rows: tuple[RefineRow, ...]
    bars: tuple[Bar, ...]
    best_known_percent: dict[str, float]
    synthetic: dict[str, bool]
    numba_layout: dict[str, str]
    missing: tuple[str, ...]

    def text(self) -> Iterator[str]:
        """Milliseconds and simulations of each engine, and the aims."""
        yield "from starts near a minimum to the minimum, normalised_bouc_wen; medians over the starts, in turns"
        yield ""
        yield from table_of(
            "",
            "job",
            ((row.job, asdict(row)) for row in self.rows),
            {
                "engine": "{engine}",
                "ms": lambda row: f"{1e3 * row['seconds']:.2f}",
                "simulations": "{simulations:.0f}",
                "success": "{success:.0%}",
                "starts": "{n_starts}",
                "compile s": "{compile_seconds:.2f}",
            },
        ).lines()
        yield ""
        yield "A simulation of ours brings its exact Jacobian along. Success: within 0.01 points of the best known."
        for job, percent in self.best_known_percent.items():
            kind = record_kind(synthetic=self.synthetic[job])
            yield f"{job}: best known {percent:.3f} % ({kind})"
        for job, layout in self.numba_layout.items():
            yield f"{job}: fastest numba {layout}"
        for name in self.missing:
            yield f"not here: {name}"
        yield from map(str, self.bars)


def bench_refine(
    *,
    seeds: int = 20,
    threads: int = 0,
    quick: bool = False,
    say: Say = silent,
) -> RefineBenchmark:
    """Refine the same starts with every engine in turns, start by start.

    First calls, with loading and compiling, come before and are reported separately.
    """
    if seeds < 1:
        raise SettingError(f"`seeds` is {seeds}; give 1 or more")
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
        say(f"{job.name}: {len(job.objective.tests)} test(s), {job.objective.n_time} samples")
        peer = None
        if "numba" not in missing:
            from studies.speed.numba_objective import LAYOUTS, fastest_layout

            fastest = fastest_layout(job, LAYOUTS[-1:] if quick else LAYOUTS)
            peer = fastest.residuals
            layouts[job.name] = fastest.variant.describe()
            difference = float(np.max(np.abs(peer(job.starts) - job.objective.residuals(job.starts))))
            require_agreement("numba and the compiled kernel", "residual", difference, _AGREEMENT)
        own, best[job.name] = _rows(job, engines(job, peer), say)
        rows += own
    return RefineBenchmark(
        rows=tuple(rows),
        bars=tuple(_bars(rows)),
        best_known_percent=best,
        synthetic={job.name: job.synthetic for job in jobs},
        numba_layout=layouts,
        missing=tuple(missing),
    )


def _rows(job: RefineJob, taking_part: Sequence[Engine], say: Say) -> tuple[list[RefineRow], float]:
    """Rows of one job, and the fit in % of the best minimum that any engine found."""
    first_call: dict[str, float] = {}
    for engine in taking_part:
        _, first_call[engine.name] = timed(partial(engine.run, job.starts[: engine.at_once]))
        say(f"{job.name}, {engine.name}: first call {first_call[engine.name]:.2f} s")
    calls: dict[str, list[tuple[Refined, float]]] = {engine.name: [] for engine in taking_part}
    for index in range(len(job.starts)):
        for engine in taking_part:
            if index % engine.at_once == 0:
                starts = job.starts[index : index + engine.at_once]
                refined, spent = timed(partial(engine.run, starts))
                calls[engine.name].append((refined, spent / len(starts)))
    misfits = {name: np.concatenate([refined.misfit for refined, _ in own]) for name, own in calls.items()}
    least = min(float(own.min()) for own in misfits.values())
    rows = []
    for engine in taking_part:
        seconds = float(np.median([spent for _, spent in calls[engine.name]]))
        rows.append(
            RefineRow(
                engine=engine.name,
                job=job.name,
                seconds=seconds,
                simulations=float(np.median([refined.simulations for refined, _ in calls[engine.name]])),
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
