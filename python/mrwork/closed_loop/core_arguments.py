"""Devices, building, law and observer in the form that the Rust core takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.arguments import checked
from mrwork.buildings.devices import Device, elongation_rows
from mrwork.buildings.matrices import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.control.counterpart import is_curve
from mrwork.control.laws import ControlLaw
from mrwork.control.observer import Observer, observer_of
from mrwork.control.plant import accelerations, deformations, plant_of, stacked
from mrwork.dampers.parameters import law_named
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError

Floats = NDArray[np.float64]
# Current laws by name, `None` for a model without, and whether the driver lags.
Laws = tuple[list[str] | None, bool]

# Seconds of the factors of the mass matrix and of the bounds on the frequencies, per coordinate cubed.
_SECONDS = 3e-9
# They are ready in ten seconds.
_MOST_COORDINATES = 1500

# Numbers of an element in the core.
_ELEMENT_NUMBERS = 6

# Limit of an ideal actuator [N]: so large that an unstable loop overflows and ends as diverged before it.
_NO_LIMIT = 1e300


def dampers_of(devices: Sequence[Device], *, actuators: bool) -> tuple[str, Laws, Floats, list[list[float]]]:
    """Model, current laws, parameters of all draws and devices, and ranges of the command."""
    if actuators:
        theta = np.tile([0.0, 1.0], (1, len(devices), 1))
        return "ideal_actuator", (["linear"], False), theta, [[-_NO_LIMIT, _NO_LIMIT] for _ in devices]
    spec = devices[0].spec
    for device in devices[1:]:
        if (device.spec.name, device.spec.current) != (spec.name, spec.current):
            raise SettingError(
                f"{device.name} is a {device.spec.name} and {devices[0].name} a {spec.name}, or their current laws "
                f"differ; one loop takes devices of one model with the same laws"
            )
    n_draws = max(len(device.draws) for device in devices)
    if any(len(device.draws) not in (1, n_draws) for device in devices):
        counts = ", ".join(str(len(device.draws)) for device in devices)
        raise SettingError(f"the devices have {counts} draws; give the same number for each device, or one")
    shape = (n_draws, len(spec.parameters))
    theta = np.stack([np.broadcast_to(device.draws, shape) for device in devices], axis=1)
    return (
        spec.name,
        _laws(spec),
        np.ascontiguousarray(theta),
        [[0.0, float(device.largest_command)] for device in devices],
    )


def _laws(spec: DamperSpec) -> Laws:
    return (None, False) if spec.current is None else ([*spec.current.laws], spec.current.lagged)


def stretched_theta(spec: DamperSpec, theta: Floats, factors: Floats) -> Floats:
    """Parameters with which dampers follow `factors` times the command, for each candidate and draw.

    Parameters
    ----------
    theta
        Shape (n_draws, n_devices, n_columns).
    factors
        Shape (n_candidates, n_devices).

    Returns
    -------
    Floats
        Shape (n_candidates * n_draws, n_devices, n_columns); draws vary fastest.
    """
    assert spec.current is not None
    found = np.repeat(theta[None], len(factors), axis=0)
    for candidate, device in np.ndindex(*factors.shape):
        factor, start = float(factors[candidate, device]), 0
        for parameter, law in zip(spec.plain, spec.current.laws, strict=True):
            kind = law_named(law)
            columns = slice(start, start + kind.n_coefficients)
            found[candidate, :, device, columns] = kind.stretched(
                theta[:, device, columns], factor, log=parameter.scale == "log"
            )
            start = columns.stop
    return np.ascontiguousarray(found.reshape(-1, *theta.shape[1:]))


def matrices_of(building: Building, devices: Sequence[Device]) -> _rust.Building:
    """The building with the positions of its devices."""
    n = building.n_coordinates
    if n > _MOST_COORDINATES:
        raise SettingError(
            f"{building.name} has {n:,} coordinates, of which the equations of a loop would take about "
            f"{_SECONDS * n**3:.0f} s to prepare; reduce it to at most {_MOST_COORDINATES:,}, as by "
            "`mr.buildings.modal_truncation`"
        )
    arrays: list[ArrayLike] = [
        building.mass,
        building.damping,
        building.stiffness,
        building.influence,
        building.floors,
        building.storeys,
        elongation_rows(building, devices),
        np.reshape([element.row for element in building.elements], (-1, n)),
        np.reshape([element.numbers for element in building.elements], (-1, _ELEMENT_NUMBERS)),
    ]
    try:
        return _rust.Building(*(np.ascontiguousarray(array, dtype=np.float64) for array in arrays))
    except ValueError as error:
        raise SettingError(f"{building.name}: {error}") from error


def curve_of(law: ControlLaw) -> tuple[Laws, Floats] | None:
    """The model of the damper in the law, if it has one."""
    if law.curve is None:
        return None
    spec, theta = law.curve
    if not is_curve(spec):
        raise SettingError(
            f"the curve of {law.name} is a {spec.name}; give a static_hysteretic with current laws"
        )
    if np.shape(theta) != (len(spec.parameters),):
        raise SettingError(
            f"the curve of {law.name} has parameters of shape {np.shape(theta)}, this {spec.name} takes "
            f"({len(spec.parameters)},)"
        )
    return _laws(spec), np.ascontiguousarray(theta, dtype=np.float64)


def observer_arrays(
    building: Building, devices: Sequence[Device], hardware: Hardware
) -> tuple[list[int], list[int], Floats, Floats, Floats, Floats, Floats] | None:
    """Measured floors and devices, and Ad, Bd, L, C, D of the observer; `None` for feedback of the true state."""
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


@checked
def loop_observer(
    building: Building, devices: Sequence[Device], hardware: Hardware, floors: Sequence[int]
) -> Observer:
    """The observer of a loop, which measures accelerations of these floors and the deformations of all devices.

    Raises
    ------
    SettingError
        If a floor does not exist or is named twice, or no observer can be designed.
    """
    unknown = [floor for floor in floors if not 0 <= floor < len(building.floors)]
    if unknown:
        raise SettingError(
            f"{building.name} has {len(building.floors)} floors, counted from 0; {unknown} do not exist"
        )
    if len(set(floors)) < len(floors):
        raise SettingError(f"the measured floors are {list(floors)}; give each once")
    plant = plant_of(building, elongation_rows(building, devices), [device.name for device in devices])
    measured = accelerations(plant)
    chosen = measured.select([measured.names[floor] for floor in floors])
    return observer_of(
        plant,
        stacked(chosen, deformations(plant)),
        hardware.sample_time,
        noise_intensity=1.0 / hardware.noise_ratio,
    )
