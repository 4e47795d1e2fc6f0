"""The observer of a loop: what it measures, and its matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.devices import Device
from mrwork.buildings.matrices import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.observer import Observer, observer_of
from mrwork.control.outputs import accelerations, deformations, stacked
from mrwork.control.plant import plant_of
from mrwork.errors import SettingError

Floats = NDArray[np.float64]


def observer_arrays(
    building: Building, devices: Sequence[Device], hardware: Hardware
) -> tuple[list[int], list[int], Floats, Floats, Floats, Floats, Floats] | None:
    """Floors and devices that are measured, and the observer's Ad, Bd, L, C, D; nothing where the state is seen."""
    if hardware.feedback == "state":
        return None
    floors = (
        list(range(len(building.floors)))
        if hardware.measured_floors is None
        else list(hardware.measured_floors)
    )
    observer = loop_observer(building, devices, hardware, floors)
    matrices = (observer.Ad, observer.Bd, observer.gain, observer.C, observer.D)
    Ad, Bd, gain, C, D = (np.ascontiguousarray(matrix) for matrix in matrices)
    return floors, list(range(len(devices))), Ad, Bd, gain, C, D


def loop_observer(
    building: Building, devices: Sequence[Device], hardware: Hardware, floors: Sequence[int]
) -> Observer:
    """The observer of a loop: accelerations of these floors, then the deformations of all devices.

    Raises
    ------
    SettingError
        Where there is no such floor, or no observer can be designed.
    """
    unknown = [floor for floor in floors if not 0 <= floor < len(building.floors)]
    if unknown:
        raise SettingError(
            f"{building.name} has {len(building.floors)} floors, counted from 0; {unknown} are none"
        )
    plant = plant_of(
        building, np.array([device.row for device in devices]), [device.name for device in devices]
    )
    measured = accelerations(plant)
    chosen = measured.select([measured.names[floor] for floor in floors])
    return observer_of(
        plant,
        stacked(chosen, deformations(plant)),
        hardware.sample_time,
        noise_intensity=1.0 / hardware.noise_ratio,
    )
