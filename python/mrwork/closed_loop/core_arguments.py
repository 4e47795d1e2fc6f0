"""Devices, building and law as the Rust core takes them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.buildings.devices import Device
from mrwork.buildings.matrices import Building
from mrwork.control.laws import ControlLaw
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError

Floats = NDArray[np.float64]
# Current laws by name, none where the model has none, and whether the driver lags.
Laws = tuple[list[str] | None, bool]

# A force that no actuator meets [N]: the ideal one has no limit, and an unstable loop leaves the finite numbers before
# it, so that it ends as diverged and not at this force.
_NO_LIMIT = 1e300


def dampers_of(devices: Sequence[Device], *, actuators: bool) -> tuple[str, Laws, Floats, list[list[float]]]:
    """Model, laws, parameters of all draws and devices, and ranges of command.

    Raises
    ------
    SettingError
        Where the devices are not of one model with the same laws, or their draws differ in number.
    """
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
        raise SettingError(f"the devices have {counts} draws; give as many of each, or one")
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


def matrices_of(building: Building, devices: Sequence[Device]) -> _rust.Building:
    """The building with the places of its devices.

    Raises
    ------
    SettingError
        Where a device's row does not fit, or the matrices are not those of a building.
    """
    rows = [np.asarray(device.row, dtype=np.float64) for device in devices]
    n = len(building.mass)
    for device, row in zip(devices, rows, strict=True):
        if row.shape != (n,) or not np.isfinite(row).all() or not row.any():
            raise SettingError(
                f"{device.name}: `row` has shape {row.shape}; {building.name} takes ({n},), not all zero: "
                f"a row of `building.storeys`"
            )
    arrays: list[ArrayLike] = [
        building.mass,
        building.damping,
        building.stiffness,
        building.influence,
        building.floors,
        building.storeys,
        np.array(rows),
    ]
    try:
        return _rust.Building(*(np.ascontiguousarray(array, dtype=np.float64) for array in arrays))
    except ValueError as error:
        raise SettingError(f"{building.name}: {error}") from error


def curve_of(law: ControlLaw) -> tuple[Laws, Floats] | None:
    """What the law believes of its damper, where it wants to know.

    Raises
    ------
    SettingError
        Where it wants to and nothing is given, or something else than a static hysteretic model with current laws.
    """
    if law.curve is None:
        if law.spec.wants_curve:
            raise SettingError(
                f"{law.name} works with the force over the command; give the law a `curve`: a static_hysteretic with "
                f"current laws, of the damper itself or of its static counterpart"
            )
        return None
    spec, theta = law.curve
    if spec.name != "static_hysteretic" or spec.current is None:
        raise SettingError(
            f"the curve of {law.name} is a {spec.name}; give a static_hysteretic with current laws"
        )
    return _laws(spec), np.ascontiguousarray(theta, dtype=np.float64)
