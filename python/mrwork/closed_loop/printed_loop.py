"""The controller of a loop as the core prints it: the loop without motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrwork import _rust
from mrwork.buildings.device import Device
from mrwork.buildings.groups import commanded
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.core_loop import (
    LoopOfRuns,
    core_controller,
    core_dampers,
    core_own_law,
    theta_of,
    with_actuators,
)
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.laws_of_users import law_in_loop, loop_shape, recorded_for
from mrwork.closed_loop.observer import estimates_absolute, loop_observer
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.linear.lqr import Observer
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrintedLoop:
    """Building, dampers, law, hardware and observer as the core takes them; it reads the fields by name."""

    building: _rust.Building
    dampers: list[_rust.Dampers]
    controller: _rust.Controller
    hardware: Hardware
    observer: _rust.Observer | None
    n_commanded: int
    own: _rust.LawTape | None
    matrices: Observer | None
    is_absolute: bool


def printed_loop(
    building: Building,
    devices: Sequence[Device],
    law: ControlLaw,
    hardware: Hardware,
    motions: Sequence[GroundMotion] = (),
) -> PrintedLoop:
    """The loop of a law with one set of gains; laws and hardware that cannot be printed are refused by name.

    The `motions` say whether an observer estimates absolute velocities, as on roads.
    """
    if hardware.ground_preview > 0.0:
        raise SettingError("no sensor tells the ground ahead; leave ground_preview of the hardware out")
    if hardware.faults:
        raise SettingError("faults are of a simulation; leave the faults of the hardware out")
    driven = commanded(devices)
    user, law = law_in_loop(law, driven, 2 * building.n_coordinates)
    own, settings = None, np.zeros((1, 0))
    if user is not None:
        own, settings, reason = recorded_for(user, loop_shape(building, driven, hardware))
        if own is None:
            raise SettingError(
                f"{user.in_words} is printed only where it can be recorded: {reason or 'record is False'}"
            )
        if "time" in {name for name, _, _ in own.inputs}:
            raise SettingError(
                f"{user.in_words} reads the time, which a controller does not know; keep it in the memory"
            )
    driven, devices, hardware = with_actuators(devices, law, hardware)
    gains = law.gain_rows(len(driven), 2 * building.n_coordinates)
    if len(gains) != 1:
        raise SettingError(
            f"{law.name} has {len(gains)} candidates, and one is printed; give one set of gains"
        )
    observer = None
    if hardware.feedback == "state":
        is_absolute = bool(motions) and law.spec.reads_state and all(map(law.reads_absolute, motions))
    else:
        is_absolute = bool(motions) and estimates_absolute(law, motions, hardware)
        observer = loop_observer(building, devices, hardware, is_absolute=is_absolute)
    loop = LoopOfRuns(
        building=building,
        varied=(),
        devices=tuple(devices),
        law=law,
        hardware=hardware,
        observer=observer,
        motions=(),
        step_factor=1,
        estimates_absolute=is_absolute and observer is not None,
    )
    core = loop.core()
    return PrintedLoop(
        building=core.building,
        dampers=core_dampers(devices, [theta[:1] for theta in theta_of(devices)]),
        controller=core_controller(law, gains, None if law.shaping is None else np.array([law.shaping])),
        hardware=hardware,
        observer=core.observer,
        n_commanded=len(driven),
        own=None if own is None else core_own_law(own, settings),
        matrices=observer,
        is_absolute=is_absolute,
    )
