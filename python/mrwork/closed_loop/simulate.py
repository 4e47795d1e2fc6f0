"""Simulate buildings in closed loop: candidates x motions x draws of the dampers in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.buildings.devices import Device
from mrwork.buildings.matrices import Building
from mrwork.closed_loop.core_arguments import curve_of, dampers_of, matrices_of, observer_arrays
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import (
    History,
    Responses,
    columns_by_name,
    history_signals,
    run_quantities,
)
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws import ControlLaw
from mrwork.errors import MrworkError, SettingError
from mrwork.motions.ground_motion import GroundMotion

__all__ = ["Device", "simulate_loop"]

Floats = NDArray[np.float64]

_RUNS_AT_A_TIME = 4096
_MOST_SAMPLES = 100_000_000


def simulate_loop(
    building: Building,
    devices: Sequence[Device],
    law: ControlLaw | UserLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware | None = None,
    *,
    histories: bool = False,
    step_factor: int = 1,
    nominal: Building | None = None,
    threads: int = 0,
    on_progress: Callable[[int, int], None] | None = None,
) -> Responses:
    """Simulate every candidate of the law under every motion with every draw of the dampers.

    Building, dampers and driver are integrated as one system by the classical Runge-Kutta method; the law receives
    measurements at its sample times. Ideal actuators replace the dampers if the law commands forces.

    Parameters
    ----------
    devices
        One or more, all of one model with the same current laws; see `Device`.
    law
        A law of the registry with its gains, or a law in Python, which takes one thread.
    histories
        Whether to keep the history of every run.
    step_factor
        Multiplies the number of steps of every run: 2 halves the step, to check convergence.
    nominal
        The building for which the observer is designed; by default the building itself.
    threads
        Threads to use, 0 for all.
    on_progress
        Called with the number of runs done and their total.

    Raises
    ------
    SettingError
        If devices, law and building do not match, or the law sends a command to dampers that follow none.

    Examples
    --------
    >>> from mrwork.closed_loop.simulate import simulate_loop
    >>> passive_on = ControlLaw(name="passive", gains={"command": [2.25]})  # doctest: +SKIP
    >>> simulate_loop(building, [device], passive_on, [motion]).peak_drift.shape  # doctest: +SKIP
    (1, 3)
    """
    hardware = Hardware() if hardware is None else hardware
    user = law if isinstance(law, UserLaw) else None
    if isinstance(law, UserLaw):
        law = law.placeholder(devices)
    if not devices:
        raise SettingError(
            "a closed loop has at least one device; without dampers, simulate a device of zero force"
        )
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
    actuators = law.spec.commands_force
    if not (actuators or devices[0].spec.follows_command or (gains.size and not gains.any())):
        raise SettingError(
            f"{law.name} commands {devices[0].name}, a {devices[0].spec.name} of which no parameter depends on the "
            "command: it would have no effect; give the model current laws, or simulate the passive damper with the "
            "law passive and a command of zero"
        )
    model, laws, theta, ranges = dampers_of(devices, actuators=actuators)
    shape = (len(gains), len(motions), len(theta))
    matrices = matrices_of(building, devices)
    arguments: dict[str, Any] = {
        "building": matrices,
        "model": model,
        "laws": laws,
        "theta": theta,
        "places": [
            (1.0, False) if actuators else (float(device.count), device.differential) for device in devices
        ],
        "ranges": ranges,
        "law": law.name,
        "gains": gains,
        "tables": law.table_rows(),
        "curve": curve_of(law),
        "motions": [(motion.dt, np.ascontiguousarray(motion.acceleration)) for motion in motions],
        "sample_time": hardware.sample_time,
        "steps": hardware.steps,
        "delay_steps": hardware.delay_steps,
        "command_rate": hardware.command_rate,
        "sensors": hardware.sensors,
        "faults": hardware.fault_rows(),
        "observer": observer_arrays(nominal or building, devices, hardware),
        "histories": histories,
        "step_factor": step_factor,
        "threads": threads,
    }
    runs = np.indices(shape, dtype=np.uint32).reshape(3, -1).T
    # The noise of a run depends on its motion only, so that candidates are compared under equal noise.
    streams = runs[:, 1].astype(np.uint64) + np.uint64(hardware.seed) * np.uint64(2**32)
    parts = []
    for start in range(0, len(runs), _RUNS_AT_A_TIME):
        part = slice(start, start + _RUNS_AT_A_TIME)
        if user is not None:
            arguments["outside"] = user.asked(runs[part], devices, hardware.sample_time)
        try:
            parts.append(
                _rust.respond(runs=np.ascontiguousarray(runs[part]), streams=streams[part], **arguments)
            )
        except MrworkError:
            raise
        except (ValueError, OverflowError) as error:
            raise SettingError(str(error)) from error
        if on_progress is not None:
            on_progress(min(part.stop, len(runs)), len(runs))
    return _responses(parts, matrices, hardware, shape, () if actuators else tuple(devices), motions)


def _responses(
    parts: list[Any],
    building: _rust.Building,
    hardware: Hardware,
    shape: tuple[int, int, int],
    devices: tuple[Device, ...],
    motions: Sequence[GroundMotion],
) -> Responses:
    summary = np.concatenate([part[0] for part in parts])
    quantities = columns_by_name(summary, run_quantities(), building.summary_layout)
    histories = None
    if parts[0][3] is not None:
        layout = building.history_layout
        histories = tuple(
            History(
                time=np.arange(len(rows), dtype=np.float64) * hardware.sample_time,
                **columns_by_name(rows, history_signals(), layout),
            )
            for part in parts
            for rows in part[3]
        )
    return Responses(
        shape=shape,
        outcome=np.concatenate([part[1] for part in parts]),
        steps=np.concatenate([part[2] for part in parts]),
        histories=histories,
        devices=devices,
        seconds=tuple(motion.duration for motion in motions),
        **quantities,
    )
