"""Simulate buildings in closed loop: candidates x motions x draws of the dampers in one call."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.arguments import Threads, checked
from mrwork.buildings.devices import Device
from mrwork.buildings.matrices import Building
from mrwork.closed_loop.core_arguments import (
    curve_of,
    dampers_of,
    matrices_of,
    observer_arrays,
    stretched_theta,
)
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
from mrwork.errors import MrworkError, MrworkWarning, SettingError
from mrwork.motions.ground_motion import GroundMotion

__all__ = ["Device", "simulate_loop"]

Floats = NDArray[np.float64]

_RUNS_AT_A_TIME = 4096
_MOST_SAMPLES = 100_000_000
# Largest commands that are worked out as shares of others are rounded.
_ROUNDED = 1.0 + 1e-9


@checked
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
    largest_commands: ArrayLike | None = None,
    threads: Threads = 0,
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
        The building for which the observer is designed; by default the building itself. It goes with the feedback of
        an observer only.
    largest_commands
        Largest command of each candidate, shape (n_candidates,), up to that of the devices, for laws that send a share
        of the largest command. Dampers then follow the scaled command, so results agree to rounding with those of
        devices of that largest command.
    threads
        Threads to use, 0 for all.
    on_progress
        Called with the number of runs done and their total.

    Raises
    ------
    SettingError
        If devices, law and building do not match, a constant command is negative or above the largest one, the law
        sends a command to dampers that follow none, or there is a nominal building and no observer.

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
    if nominal is not None and hardware.feedback == "state":
        raise SettingError(
            "`nominal` is the building of an observer, and the feedback is of the state; leave it out, or set "
            "`feedback` of the hardware to 'observer'"
        )
    n_states = 2 * len(building.mass)
    gains = law.gain_rows(len(devices), n_states)
    if not len(gains):
        raise SettingError(f"the gains of {law.name} are of no candidate; give those of one or more")
    actuators = law.spec.commands_force
    if not (actuators or devices[0].spec.follows_command or (gains.size and not gains.any())):
        raise SettingError(
            f"{law.name} commands {devices[0].name}, a {devices[0].spec.name} of which no parameter depends on the "
            "command: it would have no effect; give the model current laws, or simulate the passive damper with the "
            "law passive and a command of zero"
        )
    _check_commands(law, devices)
    model, laws, theta, ranges = dampers_of(devices, actuators=actuators)
    n_draws, factors = len(theta), np.ones((1, len(devices)))
    if largest_commands is not None:
        factors = _command_factors(law, hardware, devices, largest_commands, histories=histories)
        if len(gains) not in (1, len(factors)):
            raise SettingError(
                f"the gains are of {len(gains)} candidates and `largest_commands` of {len(factors)}; give one for each"
            )
        gains = np.ascontiguousarray(np.broadcast_to(gains, (len(factors), gains.shape[1])))
        theta = stretched_theta(devices[0].spec, theta, factors)
    shape = (len(gains), len(motions), n_draws)
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
    candidate = runs[:, 0].copy()
    if len(theta) > n_draws:
        # Each candidate has draws of its own, with its scale of the command.
        runs = np.column_stack([candidate, runs[:, 1], candidate * np.uint32(n_draws) + runs[:, 2]])
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
    found = _responses(parts, matrices, hardware, shape, () if actuators else tuple(devices), motions)
    if largest_commands is None:
        return found
    scale = factors[candidate]
    return replace(
        found,
        peak_current=found.peak_current * scale,
        mean_current=found.mean_current * scale,
        rms_current=found.rms_current * scale,
    )


def _check_commands(law: ControlLaw, devices: Sequence[Device]) -> None:
    """Warn of constant commands that no driver of the devices gives."""
    for gain in law.spec.gains:
        if not gain.is_command:
            continue
        commands = np.asarray(law.gains[gain.name], dtype=np.float64).reshape(-1, len(devices))
        for device, column in zip(devices, commands.T, strict=True):
            wrong = (column < 0.0) | (column > device.largest_command * _ROUNDED)
            if wrong.any():
                warnings.warn(
                    f"`{gain.name}` of {law.name} is {column[wrong][0]:g} for {device.name}, whose driver gives 0 to "
                    f"{device.largest_command:g} and no more; give a command within it, or a larger `largest_command` "
                    "of the device",
                    MrworkWarning,
                    stacklevel=4,
                )


def _command_factors(
    law: ControlLaw,
    hardware: Hardware,
    devices: Sequence[Device],
    largest_commands: ArrayLike,
    *,
    histories: bool,
) -> Floats:
    """Largest command of each candidate over that of each device, shape (n_candidates, n_devices)."""
    if not law.spec.sends_share:
        raise SettingError(
            f"{law.name} sends commands that are no share of the largest one; simulate devices of that largest command"
        )
    faulty = any(fault.channel == "command" for fault in hardware.faults)
    if histories or faulty or np.isfinite(hardware.command_rate):
        raise SettingError(
            "largest commands of candidates go with neither histories nor a rate limit or faults of the command; "
            "simulate devices of that largest command"
        )
    given = np.atleast_1d(np.asarray(largest_commands, dtype=np.float64))
    if given.ndim != 1 or not given.size:
        raise SettingError(f"`largest_commands` has shape {given.shape}; give (n_candidates,)")
    factors: Floats = given[:, None] / np.array([device.largest_command for device in devices])
    if not ((factors > 0.0) & (factors <= 1.0)).all():
        raise SettingError(
            f"`largest_commands` are from {given.min():g} to {given.max():g}; give one for each candidate, positive "
            "and up to that of the devices"
        )
    return factors


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
