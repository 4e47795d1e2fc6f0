"""Published buildings: their natural frequencies, and the peaks of Dyke et al. 1996 with why its first row departs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.buildings import Building, building, buildings
from mrwork.closed_loop import Device, Hardware, simulate_loop
from mrwork.control import ControlLaw, plant_of, published_regulator, regulator_as_published
from mrwork.dampers import damper
from mrwork.motions import GroundMotion, read_motion, time_scaled
from studies.former.arrays import Floats

# By mode [Hz], as their papers state them or as they follow from what these state; utfpr comes without.
STATED: dict[str, dict[int, float]] = {
    "dyke1996": {1: 5.46, 2: 15.81, 3: 23.64},
    "jansen2000": {1: 1.388, 6: 11.18},
    "uts": {1: 3.00, 2: 8.74, 3: 13.76, 4: 17.68, 5: 20.21},
    "frame": {1: 3.0},
    "sac3": {1: 0.990, 2: 3.061, 3: 5.855},
}


def frequencies() -> dict[str, dict[str, Any]]:
    """Frequencies of every published building [Hz], and the largest relative deviation from those that are stated."""
    found = {}
    for published in buildings():
        ours, stated = published.frequencies.tolist(), STATED.get(published.name, {})
        deviations = [abs(ours[mode - 1] / value - 1.0) for mode, value in stated.items()]
        found[published.name] = {
            "hertz": ours,
            "stated": {str(mode): value for mode, value in stated.items()},
            "deviation": max(deviations, default=None),
        }
    return found


HARDWARE = Hardware(sample_time=5e-4, step=1.25e-4)
FRAME = building("dyke1996")
QUANTITIES = (
    *(f"displacement {floor} [cm]" for floor in (1, 2, 3)),
    *(f"drift {storey} [cm]" for storey in (1, 2, 3)),
    *(f"acceleration {floor} [cm/s2]" for floor in (1, 2, 3)),
    "force [N]",
)
# Smart Mater. Struct. 5, 1996, 565-575. There is no force without a damper.
PUBLISHED = {
    "uncontrolled": (0.538, 0.820, 0.962, 0.538, 0.319, 0.201, 856.0, 1030.0, 1400.0),
    "passive-off": (0.211, 0.357, 0.455, 0.211, 0.153, 0.103, 420.0, 480.0, 717.0, 258.0),
    "passive-on": (0.0798, 0.196, 0.306, 0.0798, 0.158, 0.110, 281.0, 494.0, 767.0, 979.0),
    "clipped-optimal": (0.114, 0.185, 0.212, 0.114, 0.0902, 0.101, 696.0, 739.0, 703.0, 941.0),
}
# Half a unit of the last digit printed, of M, C and K: 98.3 kg, 175 -50 100 50 N s/m, 12.0 -6.84 13.7 6.84 1e5 N/m.
_ROUNDING_M = 0.05
_ROUNDING_C = 0.5
_ROUNDING_K = 1e5 * np.array([[0.05, 0.005, 0.0], [0.005, 0.05, 0.005], [0.0, 0.005, 0.005]])


PeakRow = tuple[str, dict[str, Any]]
"""A label, and peaks by quantity: ours, published, ours over published less 1."""


def motion_of(records: Path) -> GroundMotion:
    """El Centro, its time axis divided by 5."""
    return time_scaled(read_motion(records / "el_centro_1940_ns.csv"), 0.2)


def rows(motion: GroundMotion) -> Iterator[PeakRow]:
    """All rows of the paper; the laws that need the state with that itself and with a Kalman filter."""
    gain = regulator_as_published(plant_of(FRAME, FRAME.storeys[:1]), published_regulator("dyke1996")).gain
    yield uncontrolled(motion, FRAME, "uncontrolled")
    laws = {
        "passive-off": ControlLaw(name="passive", gains={"command": [0.0]}),
        "passive-on": ControlLaw(name="passive", gains={"command": [2.25]}),
        "clipped-optimal": ControlLaw(name="clipped_optimal", gains={"gain": gain}),
    }
    for label, law in laws.items():
        yield _row(motion, label, law, FRAME, HARDWARE)
    observed = replace(HARDWARE, feedback="observer")
    yield _row(motion, "clipped-optimal", laws["clipped-optimal"], FRAME, observed, says=", observer")
    finer = replace(HARDWARE, step=HARDWARE.step / 2.0)
    yield _row(motion, "clipped-optimal", laws["clipped-optimal"], FRAME, finer, says=", half the step")


def uncontrolled(motion: GroundMotion, frame: Building, label: str, hardware: Hardware = HARDWARE) -> PeakRow:
    """The row without a damper."""
    none = ControlLaw(name="active", gains={"gain": np.zeros((1, 6))})
    return label, _row(motion, "uncontrolled", none, frame, hardware)[1]


def causes(motion: GroundMotion) -> Iterator[PeakRow]:
    """The row without a damper, one thing changed at a time."""
    # With 6.84 and 6.84 the sum of the upper storeys is 13.68, which the paper prints as 13.7.
    stiffness = FRAME.stiffness.copy()
    stiffness[1, 1] = 13.68e5
    yield uncontrolled(motion, replace(FRAME, stiffness=stiffness), "K22 13.68 instead of 13.7")
    yield uncontrolled(motion, replace(FRAME, damping=1.2 * FRAME.damping), "damping x 1.2")
    for factor in (0.995, 1.005):
        yield uncontrolled(time_scaled(motion, factor), FRAME, f"time axis x {factor:g}")
    yield uncontrolled(_held(motion), FRAME, "ground held between its samples")
    yield uncontrolled(motion, FRAME, "step x 8", replace(HARDWARE, sample_time=1e-3, step=1e-3))


def rounding(motion: GroundMotion, count: int) -> tuple[Floats, Floats]:
    """Least and largest deviations of the row without a damper, over what M, C and K may be before rounding."""
    rng = np.random.default_rng(1996)
    drawn = (uncontrolled(motion, _unrounded(rng), "")[1]["deviation"] for _ in range(count))
    found = np.array([list(deviation.values()) for deviation in drawn])
    return found.min(axis=0), found.max(axis=0)


def _unrounded(rng: np.random.Generator) -> Building:
    damping = _symmetric(rng) * _ROUNDING_C * (FRAME.damping != 0.0)
    return replace(
        FRAME,
        mass=FRAME.mass + _ROUNDING_M * rng.uniform(-1.0, 1.0) * np.eye(3),
        damping=FRAME.damping + damping,
        stiffness=FRAME.stiffness + _symmetric(rng) * _ROUNDING_K,
    )


def _symmetric(rng: np.random.Generator) -> Floats:
    drawn = np.tril(rng.uniform(-1.0, 1.0, (3, 3)))
    return np.asarray(drawn + np.tril(drawn, -1).T)


def _held(motion: GroundMotion) -> GroundMotion:
    times = 64
    return replace(motion, dt=motion.dt / times, acceleration=np.repeat(motion.acceleration, times))


def _row(
    motion: GroundMotion, label: str, law: ControlLaw, frame: Building, hardware: Hardware, says: str = ""
) -> PeakRow:
    responses = simulate_loop(frame, [_prototype(frame)], law, [motion], hardware, threads=1)
    ours = np.concatenate(
        [
            100.0 * responses.peak_displacement[0],
            100.0 * responses.peak_drift[0],
            100.0 * responses.peak_acceleration[0],
            responses.peak_force[0],
        ]
    )
    published = np.array(PUBLISHED[label])
    ours = ours[: len(published)]
    deviation = ours / published - 1.0
    columns = {"ours": ours, "published": published, "deviation": deviation}
    return label + says, {
        **{name: dict(zip(QUANTITIES, column.tolist(), strict=False)) for name, column in columns.items()},
        "largest": float(np.abs(deviation).max()),
        "energy_error": float(responses.energy_error[0]),
    }


def _prototype(frame: Building) -> Device:
    preset = damper("modified_bouc_wen").preset("dyke1996")
    theta = np.array(preset.theta)
    # The constant force of the accumulator is left out, as in building simulations.
    theta[preset.spec.names.index("x0")] = 0.0
    return Device(name="prototype", spec=preset.spec, theta=theta, row=frame.storeys[0], largest_command=2.25)
