"""The six-storey frame, its motions and its damper, and its histories as the package simulates them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import mrwork as mr
from studies.former.arrays import Floats

GRAVITY = 9.80665
MASSES = (50e3,) * 6
STIFFNESSES = (60e6, 60e6, 50e6, 50e6, 40e6, 40e6)
HEIGHT = 3.5
# 0.5 % of the height.
YIELD_DRIFT = 0.0175
RATIO = 0.03
SHARPNESS = 10.0
DAMPING = 0.02
LEVELS = (0.2, 0.5, 1.0)
# Samples of all histories that are compared [s].
SAMPLE = 1e-3
# A damper across the first storey, of the model bouc_wen: it yields at 500 kN and 2 mm, beside a dashpot.
DAMPER = np.array([1e6, 0.0, 0.0, 2.5e8, 0.5 / 2e-3**2, 0.5 / 2e-3**2, 1.0, 2.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What both programs simulate; `sharpness` is that of the knee, infinite for a bilinear storey."""

    motion: mr.GroundMotion
    p_delta: bool = False
    sharpness: float = SHARPNESS
    ratio: float = RATIO
    damper: bool = False
    elastic: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Histories:
    """Drift [m], shear of springs and loops [N] and absolute acceleration of the floors [m/s2], shape (n_time, 6)."""

    drift: Floats
    shear: Floats
    acceleration: Floats


def motions() -> tuple[mr.GroundMotion, ...]:
    """Three short synthetic motions, of which two have a near-fault pulse."""
    chosen = ("Firm pulse 1", "Medium pulse 1", "Soft 1")
    return tuple(each for each in mr.motions.suite(n=6, rng=1) if each.name in chosen)


def at_level(motion: mr.GroundMotion, level: float) -> mr.GroundMotion:
    """The motion with this peak [g]."""
    return mr.motions.scaled_to_peak(motion, level * GRAVITY)


def elastic_frame() -> mr.Building:
    """The frame without yielding, with its Rayleigh damping."""
    frame = mr.buildings.shear_building(
        name="frame", masses=MASSES, stiffnesses=STIFFNESSES, heights=[HEIGHT] * len(MASSES)
    )
    return mr.buildings.with_rayleigh_damping(frame, ratios=(DAMPING, DAMPING))


def building(case: Case) -> mr.Building:
    """The frame of a case."""
    frame = elastic_frame()
    if not case.elastic:
        frame = mr.buildings.with_storeys_that_yield(
            frame, yield_drift=YIELD_DRIFT, post_yield_ratio=case.ratio, sharpness=case.sharpness
        )
    return mr.buildings.with_p_delta(frame) if case.p_delta else frame


def responses(
    case: Case,
    motions: list[mr.GroundMotion],
    *,
    histories: bool = False,
    step_factor: int = 1,
    hardware: mr.Hardware | None = None,
    threads: int = 1,
) -> mr.Responses:
    """The frame under motions; without a damper the device is an actuator without force."""
    frame, bouc_wen = building(case), mr.damper("bouc_wen")
    device = mr.Device(name="damper", spec=bouc_wen, theta=DAMPER, row=frame.storeys[0], largest_command=1.0)
    law = (
        mr.ControlLaw(name="passive", gains={"command": np.zeros((1, 1))})
        if case.damper
        else mr.ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * len(MASSES)))})
    )
    return mr.simulate_loop(
        frame,
        [device],
        law,
        motions,
        hardware,
        histories=histories,
        step_factor=step_factor,
        threads=threads,
    )


def ours(case: Case, *, step_factor: int = 1) -> Histories:
    """Histories of a case from the package, at all samples but the first, at rest."""
    found = responses(case, [case.motion], histories=True, step_factor=step_factor)
    (history,) = found.histories or ()
    shear = history.drift * STIFFNESSES if case.elastic else history.element_force
    return Histories(drift=history.drift[1:], shear=shear[1:], acceleration=history.acceleration[1:])
