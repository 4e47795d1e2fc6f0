"""The five-storey frame under the four records: laws and baselines simulated, and scored against i = 0."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrwork.buildings import Building, building
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, Device, Hardware, Responses, simulate_loop
from mrwork.control import ControlLaw, DesignProblem, RegulatorSettings, design_candidates
from mrwork.dampers import damper
from mrwork.motions import GroundMotion, read_motion, scaled_to_peak, synthetic_motion, trimmed
from studies.former.arrays import Floats
from studies.former.scores import constant_commands

RECORDS = (
    ("El Centro", "el_centro_1940_ns.csv"),
    ("Hachinohe", "hachinohe_1968_ns.csv"),
    ("Kobe", "kobe_1995_jma_ns.csv"),
    ("Northridge", "northridge_1994_sylmar_ns.csv"),
)
LEVELS = (0.1, 0.3)
"""Peaks of the ground motions [g]."""
LONGEST = 50.0
"""Largest duration of a record [s]; the rest is cut off."""
LARGEST_CURRENT = 1.88
"""Largest current [A]; above it the friction of the static model decreases again."""
DRIVER_RATE = 190.0
"""Rate at which the current follows the command [1/s]."""
FRAME = building("uts")
HARDWARE = Hardware(sample_time=1e-3, step=5e-4)
"""Hardware of the tables, unless stated otherwise: state feedback, no delay, no noise."""
CHOOSING, JUDGING = (1940, 1995), (1968, 1994)
"""Seeds of the synthetic motions on which settings are chosen, and of those that judge them."""


def level_name(level: float) -> str:
    """Name of a level in tables and files."""
    return f"{level:g} g"


def record_title(motion: str) -> str:
    """Name of the record of a motion, which is called by its file."""
    return next(title for title, file in RECORDS if Path(file).stem == motion)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Results of the runs of one or many candidates; the first axis is candidates, the second levels.

    `ratios` to i = 0 have two axes more, for records and for the criteria of the score; those of a run that failed are
    infinite. `mean_current` [A] is the mean over records, `peak_force` [N], `stroke` [m] and `energy_error` the
    largest.
    """

    ratios: Floats
    mean_current: Floats
    peak_force: Floats
    stroke: Floats
    energy_error: Floats

    @property
    def parts(self) -> Floats:
        """Each criterion of the score, the mean of its ratios over the records; third axis criteria."""
        return np.asarray(self.ratios.mean(axis=2))

    @property
    def score(self) -> Floats:
        """The mean of the parts."""
        return np.asarray(self.parts.mean(axis=2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """The motions of all levels, and `score_criteria` of i = 0 under them."""

    motions: tuple[GroundMotion, ...]
    passive: Floats
    threads: int


def bench(records: Path, *, names: Sequence[str] = (), threads: int = 0) -> Bench:
    """The records of a folder at every level; those named, or all four."""
    motions = tuple(motion for level in LEVELS for motion in recorded_motions(records, level, names=names))
    responses = simulate_loop(FRAME, [pair()], constant_commands(0.0), motions, HARDWARE, threads=threads)
    return Bench(motions=motions, passive=score_criteria(responses), threads=threads)


def recorded_motions(records: Path, peak: float, *, names: Sequence[str] = ()) -> list[GroundMotion]:
    """The records of a folder, those named or all four, scaled to a peak [g]."""
    return scaled_records([records / file for title, file in RECORDS if not names or title in names], peak)


def scaled_records(files: Iterable[Path], peak: float) -> list[GroundMotion]:
    """The first seconds of records, scaled to a peak [g]."""
    return [
        scaled_to_peak(trimmed(read_motion(file), end=LONGEST), peak * STANDARD_GRAVITY) for file in files
    ]


def synthetic_motions(seeds: Sequence[int], peak: float, *, quick: bool) -> list[GroundMotion]:
    """Draws of the Clough-Penzien spectrum of firm soil with a peak [g]; the quick form has one short one."""
    return [
        scaled_to_peak(
            synthetic_motion(rng=seed, duration=8.0 if quick else 20.0, name=f"seed {seed}"),
            peak * STANDARD_GRAVITY,
        )
        for seed in (seeds[:1] if quick else seeds)
    ]


def regulators(law: str, frame: Building, device: Device, control_weights: Sequence[float]) -> ControlLaw:
    """A law with a linear quadratic regulator, a candidate for each control weight."""
    problem = DesignProblem(building=frame, devices=[device], sample_time=HARDWARE.sample_time)
    settings = [RegulatorSettings(control_weight=float(weight)) for weight in control_weights]
    designed = design_candidates(law, problem, settings).law
    assert designed is not None, "every positive control weight has a regulator"
    return designed


def actuator(row: Floats, name: str = "none") -> Device:
    """An ideal actuator in the place of a damper; `idle` sends it no command."""
    spec = damper("dahl")
    return Device(name=name, spec=spec, theta=spec.nominal, row=row, largest_command=1.0)


def idle(frame: Building) -> ControlLaw:
    """The law by which an actuator has no force."""
    return ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * frame.n_coordinates))})


def pair(largest_command: float = LARGEST_CURRENT, *, lagged: bool = True) -> Device:
    """Two RD-1005-3 in opposition between ground and floor 1, with the driver's lag or without.

    In opposition both follow one current, and the pair gives twice the force of one without its offset.
    """
    preset = damper("static_hysteretic").preset("kwok2006")
    spec, theta = preset.spec, np.array(preset.theta)
    # The published set is that of a current which is there at once.
    if lagged and spec.current is not None:
        laws = {plain.name: law for plain, law in zip(spec.plain, spec.current.laws, strict=True)}
        spec = damper("static_hysteretic").with_current_laws(laws, unit=spec.current.unit, lagged=True)
        theta = np.append(theta, DRIVER_RATE)
    return Device(
        name="pair of RD-1005-3",
        spec=spec,
        theta=theta,
        row=FRAME.storeys[0],
        largest_command=largest_command,
        differential=True,
    )


def figures(
    over: Bench,
    law: ControlLaw,
    *,
    device: Device | None = None,
    hardware: Hardware = HARDWARE,
    frame: Building = FRAME,
    step_factor: int = 1,
) -> Figures:
    """Simulate a law and compare it with i = 0.

    Parameters
    ----------
    frame
        The building, or one to which something was added; its own floors and storeys alone are judged.
    """
    device = pair() if device is None else device
    if frame is not FRAME:
        row = frame.storeys[frame.storey_names.index(FRAME.storey_names[0])]
        device = replace(device, row=row)
    responses = simulate_loop(
        frame, [device], law, over.motions, hardware, step_factor=step_factor, threads=over.threads
    )
    return figures_of(over, responses, frame)


def figures_of(over: Bench, responses: Responses, frame: Building = FRAME) -> Figures:
    """Figures of the responses to the motions of the bench."""
    shape = (responses.shape[0], len(LEVELS), -1)
    added = [number for number, name in enumerate(frame.storey_names) if name not in FRAME.storey_names]
    stroke = responses.peak_stroke[:, 0] if not added else responses.peak_drift[:, added].max(axis=1)
    ratios = score_ratios(responses, over.passive, frame)
    return Figures(
        ratios=ratios.reshape(*shape, len(SCORE)),
        mean_current=responses.mean_current[:, 0].reshape(shape).mean(axis=2),
        peak_force=responses.peak_force[:, 0].reshape(shape).max(axis=2),
        stroke=stroke.reshape(shape).max(axis=2),
        energy_error=responses.energy_error.reshape(shape).max(axis=2),
    )


def score_ratios(responses: Responses, reference: Floats, frame: Building = FRAME) -> Floats:
    """Criteria over those of the reference, shape (candidates, motions, criteria); infinite for a run that failed."""
    ratios = score_criteria(responses, frame).reshape(-1, *reference.shape) / reference
    return np.where(np.isfinite(ratios), ratios, np.inf)


def score_criteria(responses: Responses, frame: Building = FRAME) -> Floats:
    """Criteria of the score on the floors and storeys of the five-storey frame alone, shape (runs, criteria)."""
    floors = [frame.floor_names.index(name) for name in FRAME.floor_names]
    storeys = [frame.storey_names.index(name) for name in FRAME.storey_names]
    places = [storeys if name.endswith("drift") else floors for name in SCORE]
    quantities = [getattr(responses, name)[:, place] for name, place in zip(SCORE, places, strict=True)]
    return np.stack([quantity.max(axis=1) for quantity in quantities], axis=1)
