"""Seconds and memory of an incremental dynamic analysis in both programs, and of a whole study with laws."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from studies.former.arrays import Floats
from studies.former.command import Say
from studies.yielding_frame import frame, opensees
from studies.yielding_frame.frame import Case

RECORDS, LEVELS = 20, tuple(round(0.1 * number, 1) for number in range(1, 16))
ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """A program with its step [s]; ours has a thread or two. It runs every so many of the records, at all levels."""

    name: str
    step: float
    every: int = 1
    ours: bool = False
    threads: int = 1


class Spent(NamedTuple):
    """Seconds of a clock, and of the processors."""

    wall: float
    processor: float

    @classmethod
    def now(cls) -> Self:
        return cls(time.perf_counter(), time.process_time())

    def __sub__(self, other: Spent) -> Spent:
        return Spent(self.wall - other.wall, self.processor - other.processor)


ENGINES = (
    Engine(name="OpenSees", step=1e-2),
    Engine(name="OpenSees", step=5e-3),
    Engine(name="OpenSees", step=1e-3, every=5),
    Engine(name="mrwork", step=5e-3, ours=True),
    Engine(name="mrwork", step=5e-4, ours=True),
    Engine(name="mrwork", step=5e-4, ours=True, threads=2),
)

# That of the package's default step, on one thread.
_OURS = ENGINES[4]


def scaled_records(records: int, levels: Sequence[float]) -> list[mr.GroundMotion]:
    """Each record of the suite at each level."""
    suite = mr.motions.suite(n=records, rng=1)
    return [frame.at_level(motion, level) for motion in suite for level in levels]


def analysed(engine: Engine, motions: Sequence[mr.GroundMotion]) -> tuple[Floats, Spent]:
    """Peak drifts [m], shape (n_motions, 6), NaN of a run that does not converge, and the time without imports."""
    case = Case(motion=motions[0], damper=True)
    if engine.ours:
        sample = max(engine.step, frame.SAMPLE)
        hardware = mr.Hardware(sample_time=sample, step=engine.step)
        began = Spent.now()
        found = frame.responses(case, list(motions), hardware=hardware, threads=engine.threads)
        return found.peak_drift, Spent.now() - began
    ops = opensees.openseespy()
    peaks = np.full((len(motions), len(frame.MASSES)), np.nan)
    with tempfile.TemporaryDirectory() as folder:
        began = Spent.now()
        for number, motion in enumerate(motions):
            try:
                peaks[number] = opensees.peak_drifts(
                    ops, Case(motion=motion, damper=True), engine.step, Path(folder) / "peaks"
                )
            except RuntimeError:
                continue
        return peaks, Spent.now() - began


def peak_memory() -> float:
    """Largest memory of this process so far [MB], on Linux."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(float(line.split()[1]) / 1024.0 for line in lines if line.startswith("VmHWM"))


def _with_memory(work: Callable[[], Any]) -> tuple[Any, float]:
    return work(), peak_memory()


def alone(work: Callable[[], Any]) -> tuple[Any, float]:
    """A result from a fresh process, with its peak memory [MB]."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        result: tuple[Any, float] = pool.apply(_with_memory, (work,))
        return result


def reference(motions: list[mr.GroundMotion]) -> Floats:
    """Peak drifts [m] of ours with an eighth of the step."""
    case = Case(motion=motions[0], damper=True)
    return np.asarray(frame.responses(case, motions, step_factor=8, threads=0).peak_drift)


def _job(engine: Engine, records: int, levels: Sequence[float]) -> tuple[Floats, Spent]:
    motions = scaled_records(records, levels)
    return analysed(engine, [motions[run] for run in _chosen(engine, len(motions), len(levels))])


def timings(
    say: Say, records: int = RECORDS, levels: Sequence[float] = LEVELS, rounds: int = ROUNDS
) -> list[dict[str, Any]]:
    """A row for each engine: medians of the rounds, which take turns, and errors of the largest drift of a run."""
    motions = scaled_records(records, levels)
    exact = reference(motions).max(axis=1)
    durations = np.array([motion.duration for motion in motions])
    spent: dict[Engine, list[Spent]] = {engine: [] for engine in ENGINES}
    rows: dict[Engine, dict[str, Any]] = {}
    for number in range(rounds):
        for engine in ENGINES:
            (peaks, own), memory = alone(partial(_job, engine, records, levels))
            spent[engine].append(own)
            say(f"round {number + 1}, {engine.name} at {1e3 * engine.step:g} ms: {own.wall:.1f} s")
            chosen = _chosen(engine, len(motions), len(levels))
            errors = np.abs(peaks.max(axis=1) / exact[chosen] - 1.0)
            rows[engine] = {
                "name": f"{engine.name}, {1e3 * engine.step:g} ms"
                + (f", {engine.threads} thread{'s' * (engine.threads > 1)}" if engine.ours else ""),
                "runs": len(chosen),
                "motion": float(durations[chosen].sum()),
                "memory": memory,
                "median_error": float(np.nanmedian(errors)),
                "largest_error": float(np.nanmax(errors)),
                "failed": int(np.isnan(errors).sum()),
            }
    rates = {
        engine: median(each.processor for each in spent[engine]) / rows[engine]["motion"]
        for engine in ENGINES
    }
    return [
        {
            **rows[engine],
            "seconds": median(each.wall for each in spent[engine]),
            "rounds": [each.processor for each in spent[engine]],
            "rate": 1e3 * rates[engine],
            "ratio": rates[engine] / rates[_OURS],
        }
        for engine in ENGINES
    ]


def _chosen(engine: Engine, runs: int, levels: int) -> NDArray[np.intp]:
    """Numbers of the runs of an engine."""
    return np.flatnonzero(np.arange(runs) // levels % engine.every == 0)


BUILDING: dict[str, Any] = {
    "n_storeys": 6,
    "masses": ["50 t"],
    "stiffnesses": [f"{each / 1e6:g} MN/m" for each in frame.STIFFNESSES],
    "height": frame.HEIGHT,
    "rayleigh": {"ratios": [frame.DAMPING, frame.DAMPING]},
    "storeys_that_yield": {"yield_drift": frame.YIELD_DRIFT, "post_yield_ratio": frame.RATIO},
    "p_delta": True,
}
"""The frame with P-delta, as a study has it."""


def study(records: int = RECORDS, levels: Sequence[float] = LEVELS) -> mr.Study:
    """The frame with P-delta and a damper of 1000 kN in each of the lower storeys, under three laws."""
    return mr.study_of(
        title="Six storeys that yield",
        building=BUILDING,
        dampers=[{"storey": storey, "preset": "yoshida2004"} for storey in (1, 2, 3)],
        laws=["passive_off", "passive_on", "clipped_optimal"],
        motions=[{"suite": {"motions": records}, "seed": 1, "pga": [f"{level:g} g" for level in levels]}],
        design_level="0.3 g",
    )


def study_alone(records: int, levels: Sequence[float], picture: Path) -> dict[str, Any]:
    """Seconds of a study on all threads, read and run, the medians at 2 % of drift, and a picture of the responses."""
    began = Spent.now()
    given = study(records, levels)
    read = Spent.now() - began
    results = mr.run_study(given)
    spent = Spent.now() - began
    found = mr.fragility(results, limit={"peak_drift_ratio": "2 %"})
    picture.parent.mkdir(parents=True, exist_ok=True)
    found.plot.ida(rows=["uncontrolled", "Clipped-optimal"])[0].figure.savefig(picture)
    return {
        "seconds": spent.wall,
        "processor": spent.processor,
        "reading": read.processor,
        "runs": len(given.rows) * len(given.motions),
        "medians": {label: each.median for label, each in found.rows.items()},
    }
