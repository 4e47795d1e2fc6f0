"""The five-storey frame under the four records: laws and baselines simulated, and scored against i = 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings import Building, building
from mrwork.closed_loop import SCORE, STANDARD_GRAVITY, Device, Hardware, Responses, simulate_loop, values
from mrwork.control import ControlLaw
from mrwork.dampers import damper
from mrwork.motions import GroundMotion, read_motion, scaled_to_peak, trimmed

Floats = NDArray[np.float64]

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
    """The motions of all levels, and the criteria of i = 0 under each."""

    motions: tuple[GroundMotion, ...]
    passive: dict[str, Floats]
    threads: int


def bench(records: Path, *, names: Sequence[str] = (), threads: int = 0) -> Bench:
    """The records of a folder at every level; those named, or all four."""
    chosen = [entry for entry in RECORDS if not names or entry[0] in names]
    whole = [trimmed(read_motion(records / file), end=LONGEST) for _, file in chosen]
    motions = tuple(scaled_to_peak(motion, level * STANDARD_GRAVITY) for level in LEVELS for motion in whole)
    law = ControlLaw(name="passive", gains={"command": [0.0]})
    responses = simulate_loop(FRAME, [pair()], law, motions, HARDWARE, threads=threads)
    return Bench(motions=motions, passive=values(responses, weight=_weight(FRAME)), threads=threads)


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
    found = values(_own(responses, frame), weight=_weight(FRAME))
    ratios = np.stack([found[name].reshape(shape[0], -1) / over.passive[name] for name in SCORE], axis=2)
    ratios = np.where(np.isfinite(ratios), ratios, np.inf)
    return Figures(
        ratios=ratios.reshape(*shape, len(SCORE)),
        mean_current=responses.mean_current[:, 0].reshape(shape).mean(axis=2),
        peak_force=responses.peak_force[:, 0].reshape(shape).max(axis=2),
        stroke=stroke.reshape(shape).max(axis=2),
        energy_error=responses.energy_error.reshape(shape).max(axis=2),
    )


def _own(responses: Responses, frame: Building) -> Responses:
    """Responses with the floors and storeys of the frame alone."""
    floors = [frame.floor_names.index(name) for name in FRAME.floor_names]
    storeys = [frame.storey_names.index(name) for name in FRAME.storey_names]
    return responses.with_numbers(
        peak_displacement=responses.peak_displacement[:, floors],
        rms_displacement=responses.rms_displacement[:, floors],
        peak_acceleration=responses.peak_acceleration[:, floors],
        rms_acceleration=responses.rms_acceleration[:, floors],
        peak_drift=responses.peak_drift[:, storeys],
        rms_drift=responses.rms_drift[:, storeys],
    )


def _weight(frame: Building) -> float:
    return frame.total_mass * STANDARD_GRAVITY
