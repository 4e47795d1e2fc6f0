"""Simulate buildings in closed loop: candidates x motions x draws of the damper in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.buildings.building import Building
from mrwork.closed_loop.devices import Device
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import History, Responses
from mrwork.control.laws import ControlLaw
from mrwork.control.observer import Observer, observer_of
from mrwork.control.outputs import accelerations, deformations, stacked
from mrwork.control.plant import plant_of
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.spec import DamperSpec

Floats = NDArray[np.float64]
# Current laws by name, none where the model has none, and whether the driver lags.
Laws = tuple[list[str] | None, bool]

_RUNS_AT_A_TIME = 4096
_MOST_SAMPLES = 100_000_000
# A force that no actuator meets [N]: the ideal one has no limit, and an unstable loop leaves the finite numbers before
# it, so that it ends as diverged and not at this force.
_NO_LIMIT = 1e300


def simulate_loop(
    building: Building,
    devices: Sequence[Device],
    law: ControlLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware | None = None,
    *,
    histories: bool = False,
    step_factor: int = 1,
    threads: int = 0,
    on_progress: Callable[[int, int], None] | None = None,
) -> Responses:
    """Simulate every candidate of the law under every motion with every draw of the dampers.

    Building, dampers and driver are integrated as one by classical Runge-Kutta; the law sees what it measures at its
    sample times. A law called "active" commands forces: ideal actuators then take the places of the dampers.

    Parameters
    ----------
    devices
        At least one, all of one model with the same current laws; see `Device`.
    histories
        Whether to keep every run over time.
    step_factor
        Multiplies every run's own step count: 2 halves the step, to check that nothing changes.
    threads
        Threads to use, 0 for all.
    on_progress
        Called with the runs done and wanted.

    Raises
    ------
    SettingError
        Where devices, law and building do not fit together.

    Examples
    --------
    >>> from mrwork.closed_loop.simulate import simulate_loop
    >>> passive_on = ControlLaw(name="passive", gains={"command": [2.25]})  # doctest: +SKIP
    >>> simulate_loop(building, [device], passive_on, [motion]).peak_drift.shape  # doctest: +SKIP
    (1, 3)
    """
    hardware = Hardware() if hardware is None else hardware
    if not devices:
        raise SettingError("a closed loop has at least one device; for none, simulate one of no force")
    if not motions:
        raise SettingError("no ground motion was given; give at least one")
    for motion in motions:
        if motion.duration / hardware.sample_time > _MOST_SAMPLES:
            raise SettingError(
                f"{motion.name} lasts {motion.duration:g} s, which is more than {_MOST_SAMPLES} samples of "
                f"{hardware.sample_time:g} s; give a longer `sample_time`"
            )
    n_states = 2 * len(building.mass)
    gains = law.gain_rows(len(devices), n_states)
    active = law.name == "active"
    model, laws, theta, ranges = _dampers(devices, actuators=active)
    shape = (len(gains), len(motions), len(theta))
    matrices = _matrices(building, devices)
    arguments: dict[str, Any] = {
        "building": matrices,
        "model": model,
        "laws": laws,
        "theta": theta,
        "places": [
            (1.0, False) if active else (float(device.count), device.differential) for device in devices
        ],
        "ranges": ranges,
        "law": law.name,
        "gains": gains,
        "tables": law.table_rows(),
        "curve": _curve(law),
        "motions": [(motion.dt, np.ascontiguousarray(motion.acceleration)) for motion in motions],
        "sample_time": hardware.sample_time,
        "steps": hardware.steps,
        "delay_steps": hardware.delay_steps,
        "command_rate": hardware.command_rate,
        "sensors": hardware.sensors,
        "faults": hardware.fault_rows(),
        "observer": _observer(building, devices, hardware),
        "histories": histories,
        "step_factor": step_factor,
        "threads": threads,
    }
    runs = np.indices(shape, dtype=np.uint32).reshape(3, -1).T
    # The noise of a run goes by its motion alone, so that candidates are compared under the same.
    streams = runs[:, 1].astype(np.uint64) + np.uint64(hardware.seed) * np.uint64(2**32)
    parts = []
    for start in range(0, len(runs), _RUNS_AT_A_TIME):
        part = slice(start, start + _RUNS_AT_A_TIME)
        try:
            parts.append(
                _rust.respond(runs=np.ascontiguousarray(runs[part]), streams=streams[part], **arguments)
            )
        except ValueError as error:
            raise SettingError(str(error)) from error
        if on_progress is not None:
            on_progress(min(part.stop, len(runs)), len(runs))
    return _responses(parts, matrices, hardware, shape)


def _dampers(devices: Sequence[Device], *, actuators: bool) -> tuple[str, Laws, Floats, list[list[float]]]:
    """Model, laws, parameters of all draws and devices, and ranges of command."""
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


def _matrices(building: Building, devices: Sequence[Device]) -> _rust.Building:
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


def _curve(law: ControlLaw) -> tuple[Laws, Floats] | None:
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


def _observer(
    building: Building, devices: Sequence[Device], hardware: Hardware
) -> tuple[list[int], list[int], Floats, Floats, Floats, Floats, Floats] | None:
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


def _responses(
    parts: list[Any], building: _rust.Building, hardware: Hardware, shape: tuple[int, int, int]
) -> Responses:
    summary = np.concatenate([part[0] for part in parts])
    quantities = _split(summary, building.summary_layout)
    histories = None
    if parts[0][3] is not None:
        layout = building.history_layout
        histories = tuple(
            History(
                time=np.arange(len(rows), dtype=np.float64) * hardware.sample_time, **_split(rows, layout)
            )
            for part in parts
            for rows in part[3]
        )
    return Responses(
        shape=shape,
        outcome=np.concatenate([part[1] for part in parts]),
        steps=np.concatenate([part[2] for part in parts]),
        histories=histories,
        **quantities,
    )


_SINGLE = {"ground_acceleration", "peak_base_shear", "rms_base_shear", "energy_error"}


def _split(rows: Floats, layout: list[tuple[str, int]]) -> dict[str, Floats]:
    """Columns by name; what a building has one of loses its axis."""
    found = {}
    start = 0
    for name, count in layout:
        columns = rows[:, start : start + count]
        energy = name.endswith("_energy") and name != "device_energy"
        found[name] = columns[:, 0] if name in _SINGLE or energy else columns
        start += count
    return found
