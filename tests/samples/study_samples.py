"""Runs of a study in closed form: a building of three storeys that swings in its first mode, less with each law."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mrwork.base.units import STANDARD_GRAVITY
from mrwork.closed_loop.evaluation import Scales
from mrwork.dampers.simulation import Outcome
from mrwork.dampers.tested_range import OperatingRange
from mrwork.motions.spectrum import Intensity
from mrwork.study import StudyResults
from mrwork.study.histories import RunHistory
from mrwork.study.judged_motions import JudgedMotions
from mrwork.study.results import BuildingFacts, DamperFacts, PageContent
from mrwork.study.runs import HALF_STEP, NOMINAL, Runs, numbered, study_quantities
from mrwork.study.study import MotionFacts, Row

Run = dict[str, Any]
"""Numbers of a run by name, and its outcome."""

RunsByPlace = Mapping[tuple[int, int], Run]

SHAPE = np.array([0.4, 0.75, 1.0])
ROWS = (
    Row(label="uncontrolled", kind="uncontrolled"),
    Row(label="Passive-off", kind="passive_off"),
    Row(label="Isolation", kind="baseline"),
    Row(label="Clipped-optimal", kind="controller"),
    Row(label="Lyapunov <1 A>", kind="controller"),
)
BUILDING = BuildingFacts(
    name="three storeys",
    masses=(1e3,) * 3,
    stiffnesses=(1e6,) * 3,
    periods=(0.5, 0.2, 0.1),
    damping_ratios=(0.02,) * 3,
)


def motion_facts(name: str, peak: float = 1.0, record: str = "", **changes: Any) -> MotionFacts:
    """Facts of a motion of 8 s that stands at its peak."""
    intensity = Intensity(measure="pga", value=peak)
    return MotionFacts(
        name=name, peak=peak, duration=8.0, record=record or name, intensity=intensity, **changes
    )


MOTIONS = (
    motion_facts("El Centro", 3.4, source="el_centro.csv", changes=("time axis x 0.2",)),
    motion_facts("filtered noise", synthetic=True),
)


def ranges(**changes: object) -> OperatingRange:
    """Tested ranges that no run leaves, but where they are changed."""
    limits = {"stroke": 1.0, "velocity": 10.0, "frequency": (0.01, 100.0), "force": 1e5, "power": 1e5}
    wide = OperatingRange(**limits, command=(0.0, 1.5), command_unit="A")
    return replace(wide, **changes)


def history(amplitude: float, n_devices: int) -> RunHistory:
    """A swing that grows and decays."""
    time = np.arange(0.0, 8.0, 0.004)
    swing = amplitude * np.sin(12.0 * time) * np.exp(-(((time - 3.0) / 1.5) ** 2))
    displacement = swing[:, None] * SHAPE
    drift = np.diff(displacement, axis=1, prepend=0.0)
    deformation = np.repeat(drift[:, :1], n_devices, axis=1)
    velocity = np.gradient(deformation, time, axis=0)
    force = 5e4 * velocity + 2e5 * deformation
    into = np.cumsum(np.abs(swing))
    signals = {
        "ground_acceleration": swing[::-1].copy(),
        "displacement": displacement,
        "acceleration": -144.0 * displacement,
        "drift": drift,
        "deformation": deformation,
        "rate": velocity,
        "force": force,
        "command": (force * velocity > 0.0) * 1.0,
        "current": (force * velocity > 0.0) * 1.0,
        "energy": np.stack([into, 0.1 * into, 0.1 * into, 0.3 * into, 0.5 * into], axis=1),
    }
    return RunHistory(time=time, numbers=signals)


def run(amplitude: float, n_devices: int) -> Run:
    """Peaks and RMS values of that swing, as the numbers of a run by name."""
    found = history(amplitude, n_devices)

    def peak(signal: np.ndarray) -> np.ndarray:
        return np.asarray(np.abs(signal).max(axis=0))

    def rms(signal: np.ndarray) -> np.ndarray:
        return np.asarray(np.sqrt((signal**2).mean(axis=0)))

    shear = found.acceleration.sum(axis=1) * 1e3
    peaks = ("displacement", "drift", "acceleration")
    numbers = {f"peak_{name}": peak(getattr(found, name)) for name in peaks}
    numbers |= {f"rms_{name}": rms(getattr(found, name)) for name in peaks}
    numbers |= {
        "peak_storey_shear": np.abs(np.cumsum(found.acceleration[:, ::-1], axis=1)[:, ::-1]).max(axis=0)
        * 1e3,
        "peak_frame_shear": peak(found.drift) * 1e6,
        "peak_overturning": np.full(3, np.nan),
        "residual_drift": found.drift[-1],
        "storey_energy": np.zeros(3),
        "peak_base_shear": peak(shear),
        "rms_base_shear": rms(shear),
        "peak_force": peak(found.force),
        "peak_stroke": peak(found.deformation),
        "peak_rate": peak(found.rate),
        "peak_current": peak(found.command),
        "mean_current": found.command.mean(axis=0),
        "rms_current": rms(found.command),
        "command_travel": np.abs(np.diff(found.command, axis=0)).sum(axis=0) / found.time[-1],
        "switching_rate": np.full(n_devices, 2.0),
        "device_energy": np.full(n_devices, 0.5 * found.energy[-1, 0] / max(n_devices, 1)),
        "energy_error": 1e-9,
    }
    energies = ("input_energy", "kinetic_energy", "strain_energy", "damping_energy")
    numbers |= dict(zip(energies, found.energy[-1].tolist(), strict=False))
    return {**numbers, "outcome": Outcome.FINISHED, "steps": 2.0}


def amplitude(row: int, motion: int) -> float:
    """Amplitude of the top floor [m]."""
    return 0.05 * (1.0 - 0.15 * row) * (1.0 + motion)


def devices(row: int) -> int:
    """Number of devices in a row."""
    return 0 if ROWS[row].kind in ("uncontrolled", "baseline") else 2


def results() -> StudyResults:
    """A whole study; the fourth row's second run chatters."""
    runs = {
        (row, motion): run(amplitude(row, motion), devices(row))
        for row in range(len(ROWS))
        for motion in range(len(MOTIONS))
    }
    runs[3, 1]["energy_error"] = 3e-4
    quantities = runs_of(ROWS, MOTIONS, runs)
    return StudyResults(
        title="Three storeys & a law",
        rows=ROWS,
        motions=JudgedMotions(motions=MOTIONS),
        quantities=quantities,
        criteria_of_runs=criteria_of(quantities),
        building=BUILDING,
        dampers=tuple(map(damper_facts, ("damper 1", "damper 1, opposed"))),
        command_unit="A",
        page=PageContent(facts=(("Building", "three storeys"),), detailed=1, with_histories=(0, 1, 2, 3, 4)),
    )


def damper_facts(name: str, count: float = 1.0, storey: int = 0) -> DamperFacts:
    """Facts of dampers of 2 A with no known tests."""
    return DamperFacts(name=name, model="dahl", count=count, largest_command=2.0, storey=storey, tested=None)


def runs_of(
    rows: Sequence[Row], motions: Sequence[MotionFacts], runs: RunsByPlace, halved: RunsByPlace | None = None
) -> Runs:
    """Runs by row and motion as one array."""
    steps = [runs] if halved is None else [runs, halved]
    axes = {
        "row": tuple(row.label for row in rows),
        "motion": tuple(motion.name for motion in motions),
        "realisation": (NOMINAL, HALF_STEP)[: len(steps)],
        "floor": ("floor 1", "floor 2", "roof"),
        "storey": ("storey 1", "storey 2", "storey 3"),
        "device": numbered(max((len(each.get("peak_force", ())) for each in runs.values()), default=0)),
    }
    made = Runs.empty(axes, study_quantities("A"))
    for number, each in enumerate(steps):
        for key, one in each.items():
            put(made, (*key, number), one)
    return made


def put(runs: Runs, place: tuple[int, int, int], one: Run) -> None:
    """Fill in the numbers of a run."""
    runs.outcome[place] = one["outcome"]
    for name, value in one.items():
        if name != "outcome":
            runs.numbers[name][place + (slice(np.size(value)),) * np.ndim(value)] = value


def criteria_of(runs: Runs) -> Runs:
    """Criteria of runs of a building of three storeys."""
    return runs.criteria(Scales(weight=3e3 * STANDARD_GRAVITY, heights=np.array([4.0, 3.0, 3.0])), "A")


def changed(results: StudyResults, row: int, motion: int, **numbers: Any) -> StudyResults:
    """A study with other numbers of one run; `outcome` is one of them, and a run without an end has no numbers."""
    return replace(
        results,
        quantities=(runs := with_numbers(results.quantities, row, motion, **numbers)),
        criteria_of_runs=criteria_of(runs),
    )


def with_numbers(runs: Runs, row: int, motion: int, **numbers: Any) -> Runs:
    """The same with other numbers of a nominal run."""
    made = copy.deepcopy(runs)
    for array in (made.outcome, *made.numbers.values()):
        array.setflags(write=True)
    outcome = numbers.pop("outcome", made.outcome[row, motion, 0])
    if outcome not in (Outcome.FINISHED, Outcome.FAILED_SAFE):
        numbers = dict.fromkeys(made.numbers, np.nan)
    put(made, (row, motion, 0), {**numbers, "outcome": outcome})
    return made


def diverged(results: StudyResults, row: int, motion: int) -> StudyResults:
    """A study of which one run has diverged."""
    quantities, criteria_of_runs = (
        with_numbers(runs, row, motion, outcome=Outcome.DIVERGED)
        for runs in (results.quantities, results.criteria_of_runs)
    )
    return replace(results, quantities=quantities, criteria_of_runs=criteria_of_runs)


def with_runs(
    results: StudyResults,
    runs: RunsByPlace | None = None,
    *,
    halved: RunsByPlace | None = None,
    rows: tuple[Row, ...] | None = None,
    motions: Sequence[MotionFacts] | None = None,
) -> StudyResults:
    """A study with other runs, and with those of half the step; the last motion and every row have histories."""
    rows, motions = rows or results.rows, motions or results.motions
    quantities = runs_of(rows, motions, runs_by_place(results) if runs is None else runs, halved)
    page = replace(results.page, detailed=len(motions) - 1, with_histories=tuple(range(len(rows))))
    criteria_of_runs = criteria_of(quantities)
    return replace(
        under(results, motions),
        rows=rows,
        quantities=quantities,
        criteria_of_runs=criteria_of_runs,
        page=page,
    )


def under(results: StudyResults, motions: Sequence[MotionFacts], **judged: Any) -> StudyResults:
    """A study with other facts of its motions, and other names of those that laws are designed on."""
    return replace(results, motions=replace(results.motions, motions=tuple(motions), **judged))


def runs_by_place(results: StudyResults) -> dict[tuple[int, int], Run]:
    """The nominal runs of a study by row and motion."""
    runs = results.quantities
    return {
        (row, motion): {**runs.at(row, motion), "outcome": runs.outcome[row, motion, 0]}
        for row, motion in np.argwhere(runs.done[:, :, 0]).tolist()
    }


def histories(row: int, motion: int) -> RunHistory:
    """The history of a run."""
    return history(amplitude(row, motion), devices(row))


def many_motions(count: int = 12) -> StudyResults:
    """The study under many motions: odd ones on soft soil, the last two for training."""
    few = results()
    motions = tuple(
        motion_facts(
            f"motion {number}",
            use="training" if number >= count - 2 else "test",
            groups=("soft soil" if number % 2 else "firm soil", "0.1 g"),
        )
        for number in range(count)
    )
    runs = {
        (row, motion): run(amplitude(row, 0) * (1.0 + 0.02 * row * motion), devices(row))
        for row in range(len(ROWS))
        for motion in range(count)
    }
    chosen = tuple(motion.name for motion in motions if motion.use == "training")
    return under(with_runs(few, runs, motions=motions), motions, chosen_on=chosen)


def incremental(n_records: int = 5, n_levels: int = 4) -> StudyResults:
    """The study under records at several levels, whose responses are proportional to both."""
    motions = tuple(
        motion_facts(f"record {record}, 0.{level} g", 0.1 * level * STANDARD_GRAVITY, f"record {record}")
        for record in range(n_records)
        for level in range(1, n_levels + 1)
    )
    runs = {
        (row, motion): run(
            0.5 * amplitude(row, 0) * (1 + motion % n_levels) * (1.0 + 0.2 * (motion // n_levels)),
            devices(row),
        )
        for row in range(len(ROWS))
        for motion in range(len(motions))
    }
    building = replace(BUILDING, heights=(4.0, 3.0, 3.0))
    return replace(with_runs(results(), runs, motions=motions), building=building)
