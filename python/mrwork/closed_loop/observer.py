"""Observers of a loop: Kalman filters of what its sensors measure."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mrwork import _rust
from mrwork.buildings.device import Device, elongation_rows
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.linear.lqr import Observer, kinematic_observer_of, observer_of
from mrwork.control.linear.plant import Plant, accelerations, deformations, drifts, plant_of, stack_outputs
from mrwork.errors import MrworkWarning, SettingError
from mrwork.motions.ground_motion import GroundMotion


def _floors_of(building: Building, hardware: Hardware) -> list[int]:
    """Floors whose accelerations an observer takes: all, unless the hardware names some."""
    return [*(range(len(building.floors)) if hardware.measured_floors is None else hardware.measured_floors)]


def estimates_absolute(law: ControlLaw, motions: Sequence[GroundMotion], hardware: Hardware) -> bool:
    """Whether the observer of a loop estimates absolute velocities: where a law reads them under every motion.

    One that integrates measured accelerations less that of the ground knows relative ones, as a prediction needs them.
    """
    is_filter = hardware.feedback != "state" and not (hardware.kinematic or hardware.observes_ground)
    return is_filter and not law.spec.needs_model and all(map(law.reads_absolute, motions))


def loop_observer(
    building: Building, devices: Sequence[Device], hardware: Hardware, *, is_absolute: bool = False
) -> Observer:
    """The observer of a loop: accelerations of floors, deformations of all devices, drifts that are measured.

    With `is_absolute` it estimates absolute velocities, for a ground whose velocity is white.
    """
    floors = _floors_of(building, hardware)
    for noun, rows, measured in (
        ("storeys", building.storeys, hardware.measured_storeys), ("floors", building.floors, floors)
    ):  # fmt: skip
        if unknown := [index for index in measured if index >= len(rows)]:
            raise SettingError(
                f"{building.name} has {len(rows)} {noun}, counted from 0; {unknown} do not exist"
            )
    rows, names = elongation_rows(building, devices), [device.name for device in devices]
    asked = building, rows.tolist(), names, replace(hardware, seed=0, faults=()), is_absolute
    for key, observer in _OBSERVERS:
        if key == asked:
            return observer
    observer = _design_observer(plant_of(building, rows, names), hardware, floors, is_absolute=is_absolute)
    if not hardware.kinematic and any(element.in_stiffness for element in building.elements):
        warnings.warn(
            f"the observer of {building.name} goes by its elastic stiffness, and is wrong once a storey yields; set "
            "`kinematic` of the hardware, with sensors of all drifts",
            MrworkWarning,
            stacklevel=3,
        )
    _OBSERVERS.append((asked, observer))
    return observer


# Loops of a study share the observer, which takes seconds for hundreds of floors.
_OBSERVERS: deque[tuple[tuple[Building, list[Any], list[str], Hardware, bool], Observer]] = deque(maxlen=4)


def _design_observer(plant: Plant, hardware: Hardware, floors: list[int], *, is_absolute: bool) -> Observer:
    devices = plant.device_names
    accelerated = stretched = 1.0 / hardware.noise_ratio
    if hardware.observes_ground:
        # What is left to the filter is the error of the sensors: of an elongation or a drift the error of the
        # acceleration that goes with it in the first mode.
        stretched /= (2.0 * np.pi * float(plant.building.frequencies[0])) ** 4
    if hardware.kinematic:
        if floors != list(range(plant.n_coordinates)):
            raise SettingError(
                f"a kinematic observer integrates the accelerations of all floors, and `measured_floors` are "
                f"{floors}, counted from 0; leave `measured_floors` out"
            )
        storeys = hardware.measured_storeys
        return kinematic_observer_of(plant.building, len(devices), storeys, hardware.sample_time, stretched)
    of_floors, of_storeys = accelerations(plant), drifts(plant)
    chosen = of_floors.select([of_floors.names[floor] for floor in floors])
    sensed = of_storeys.select([of_storeys.names[storey] for storey in hardware.measured_storeys])
    noise = np.full(len(floors) + len(devices) + len(hardware.measured_storeys), stretched)
    noise[: len(floors)] = accelerated
    return observer_of(
        plant,
        stack_outputs(chosen, deformations(plant), sensed),
        hardware.sample_time,
        noise_intensity=noise,
        white="velocity" if is_absolute else "acceleration",
    )


def core_observer(
    observer: Observer,
    building: Building,
    devices: Sequence[Device],
    hardware: Hardware,
    *,
    is_absolute: bool = False,
) -> _rust.Observer:
    """An observer of the loop of a building with devices, as the core takes it."""
    return _rust.Observer(
        accelerations=_floors_of(building, hardware),
        deformations=range(len(devices)),
        transition=np.ascontiguousarray(observer.Ad),
        input=np.ascontiguousarray(observer.Bd),
        gain=np.ascontiguousarray(observer.gain),
        output=np.ascontiguousarray(observer.C),
        direct=np.ascontiguousarray(observer.D),
        ground=np.ascontiguousarray(observer.Ed) if hardware.observes_ground else None,
        direct_ground=np.ascontiguousarray(observer.G) if hardware.observes_ground else None,
        is_absolute=is_absolute,
    )
