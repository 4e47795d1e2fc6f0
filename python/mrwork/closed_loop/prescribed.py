"""Commands that are prescribed over time instead of those of a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np

from mrwork.base.arguments import Positive, Threads, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.matrices import Building, Device
from mrwork.closed_loop.hardware import Fault, Hardware
from mrwork.closed_loop.responses import Responses
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion

_MOST_PER_INTERVAL = 10_000_000


@checked
@array_dataclass(repr=False)
class PrescribedCommands(Summarised):
    """Commands that are held over equal intervals, from the start of a motion; the last one until its end.

    Attributes
    ----------
    interval
        Length of an interval [s], a whole number of control samples.
    command
        Command of each interval and device, shape (n_intervals, n_devices) [A or V].

    Raises
    ------
    SettingError
        If the commands are not finite numbers of this shape, or negative.
    """

    _made_by: ClassVar[str] = "mr.closed_loop.PrescribedCommands(interval=..., command=...)"
    _units: ClassVar[Mapping[str, str]] = {"interval": "s", "command": "A or V"}

    interval: Positive
    command: Annotated[Floats, Within(least=0.0)]

    def __post_init__(self) -> None:
        command = np.array(self.command, dtype=np.float64)
        if command.ndim != 2 or not command.size:
            raise SettingError(f"`command` has shape {command.shape}; give (n_intervals, n_devices)")
        command.setflags(write=False)
        object.__setattr__(self, "command", command)

    @classmethod
    @checked
    def of_history(
        cls, command: Annotated[Floats, Within(least=0.0)], sample_time: Positive, interval: Positive
    ) -> PrescribedCommands:
        """The mean command of each interval of a history at the control samples, shape (n_time, n_devices)."""
        if command.ndim != 2 or not command.size:
            raise SettingError(f"`command` has shape {command.shape}; give (n_time, n_devices)")
        each = samples_of(interval, sample_time)
        rows = -(-len(command) // each)
        filled = np.pad(command, ((0, rows * each - len(command)), (0, 0)), mode="edge")
        return cls(interval=interval, command=filled.reshape(rows, each, -1).mean(axis=1))


def samples_of(interval: float, sample_time: float) -> int:
    """Control samples of an interval."""
    count = round(min(interval / sample_time, 2.0 * _MOST_PER_INTERVAL))
    if count > _MOST_PER_INTERVAL:
        raise SettingError(
            f"`interval` is {interval:g} s, more than {_MOST_PER_INTERVAL} samples of {sample_time:g} s; "
            "give a shorter one"
        )
    if count < 1 or abs(interval / sample_time - count) > 1e-6:
        raise SettingError(
            f"`interval` is {interval:g} s, which is not a whole number of control samples of {sample_time:g} s; "
            "give a multiple of them"
        )
    return count


@checked
def simulate_prescribed(
    building: Building,
    devices: Sequence[Device],
    commands: PrescribedCommands,
    motion: GroundMotion,
    hardware: Hardware | None = None,
    *,
    histories: bool = False,
    step_factor: int = 1,
    threads: Threads = 0,
) -> Responses:
    """Simulate the loop under prescribed commands, with the sampling, delay and driver of the hardware.

    Parameters
    ----------
    commands
        At most the largest command of each device.
    histories, step_factor, threads
        As for `simulate_loop`.

    Raises
    ------
    SettingError
        If the commands are not those of these devices, exceed the largest command, or the interval is not a whole
        number of control samples; or if the hardware limits the rate of the command.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> commands = mr.closed_loop.PrescribedCommands(interval=0.5, command=[[0.0], [1.0], [0.5]])
    >>> motion = mr.synthetic_motion(duration=2.0)
    >>> run = mr.closed_loop.simulate_prescribed(frame, [damper], commands, motion)
    >>> float(run.peak_current[0, 0])
    1.0
    """
    hardware = Hardware() if hardware is None else hardware
    samples_of(commands.interval, hardware.sample_time)
    if np.isfinite(hardware.command_rate):
        raise SettingError(
            f"the hardware limits the rate of the command to {hardware.command_rate:g} per second, and prescribed "
            "commands step at their intervals; leave `command_rate` out"
        )
    if commands.command.shape[1] != len(devices):
        raise SettingError(
            f"the commands are for {commands.command.shape[1]} devices, and there are {len(devices)}"
        )
    for device, column in zip(devices, commands.command.T, strict=True):
        if column.max() > device.largest_command * (1.0 + 1e-12):
            raise SettingError(
                f"{device.name}: the largest prescribed command is {column.max():g}, and the driver gives "
                f"{device.largest_command:g} at most"
            )
    # A fault of the command channel replaces the command of a law between two samples.
    faults = [
        Fault(channel="command", index=index, start=start, end=end, value=value)
        for index, column in enumerate(commands.command.T)
        for start, end, value in _stretches(column, commands.interval)
    ]
    return simulate_loop(
        building,
        devices,
        ControlLaw(name="passive", gains={"command": np.zeros(len(devices))}),
        [motion],
        replace(hardware, faults=(*faults, *hardware.faults)),
        histories=histories,
        step_factor=step_factor,
        threads=threads,
    )


def _stretches(column: Floats, interval: float) -> list[tuple[float, float, float]]:
    """Start, end and value of each stretch of equal commands; the last ends with the motion."""
    changes = np.flatnonzero(np.diff(column)) + 1
    starts = np.concatenate([[0], changes])
    ends = [*(float(change) * interval for change in changes), np.inf]
    return [
        (float(start) * interval, end, float(column[start])) for start, end in zip(starts, ends, strict=True)
    ]
