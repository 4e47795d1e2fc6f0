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
from mrwork.control.linear.lqr import Observer, kinematic_observer_of, observer_of
from mrwork.control.linear.plant import Plant, accelerations, deformations, drifts, plant_of, stack_outputs
from mrwork.errors import MrworkWarning, SettingError


def _floors_of(building: Building, hardware: Hardware) -> list[int]:
    """Floors whose accelerations an observer takes: all, unless the hardware names some."""
    return [*(range(len(building.floors)) if hardware.measured_floors is None else hardware.measured_floors)]


def loop_observer(building: Building, devices: Sequence[Device], hardware: Hardware) -> Observer:
    """The observer of a loop: accelerations of floors, deformations of all devices, drifts that are measured."""
    floors = _floors_of(building, hardware)
    for noun, rows, measured in (
        ("storeys", building.storeys, hardware.measured_storeys), ("floors", building.floors, floors)
    ):  # fmt: skip
        if unknown := [index for index in measured if index >= len(rows)]:
            raise SettingError(
                f"{building.name} has {len(rows)} {noun}, counted from 0; {unknown} do not exist"
            )
    rows, names = elongation_rows(building, devices), [device.name for device in devices]
    asked = building, rows.tolist(), names, replace(hardware, seed=0, faults=())
    for key, observer in _OBSERVERS:
        if key == asked:
            return observer
    observer = _design_observer(plant_of(building, rows, names), hardware, floors)
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
_OBSERVERS: deque[tuple[tuple[Building, list[Any], list[str], Hardware], Observer]] = deque(maxlen=4)


def _design_observer(plant: Plant, hardware: Hardware, floors: list[int]) -> Observer:
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
        plant, stack_outputs(chosen, deformations(plant), sensed), hardware.sample_time, noise_intensity=noise
    )


def core_observer(
    observer: Observer, building: Building, devices: Sequence[Device], hardware: Hardware
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
    )
