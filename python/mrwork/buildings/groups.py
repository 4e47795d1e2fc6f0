"""Dampers of any models side by side in a building: neighbours of one model are a group."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from math import isfinite

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.errors import InvalidSettingError, SettingError

BOTH_UNITS = "A and V"
"""Unit of the commands where dampers of both units follow them: what a law sends to all is then a share."""


def joined_units(units: Iterable[str | None]) -> str:
    """The unit of commands, or `BOTH_UNITS`; empty where there is none."""
    return " and ".join(sorted({unit for unit in units if unit is not None}))


def sends_shares(devices: Sequence[Device]) -> bool:
    """Whether commanded devices follow commands in several units: one for all is a share of the largest of each."""
    return len({device.command_unit for device in commanded(devices)}) > 1


def sends_forces(devices: Sequence[Device]) -> bool:
    """Whether the devices that a law commands are actuators, of which the command is a force [N]."""
    return any(device.is_actuator for device in commanded(devices))


def largest_command(devices: Sequence[Device]) -> float:
    """Largest command that a law sends to any device [A or V], 1 where commands are shares; drivers limit their own."""
    return 1.0 if sends_shares(devices) else max(device.largest_command for device in commanded(devices))


def refuse_rate(devices: Sequence[Device], rate: float, name: str) -> None:
    """Refuse a limit on the change of the command, which is in one unit, of devices of both units."""
    if isfinite(rate) and sends_shares(devices):
        raise InvalidSettingError(
            name,
            f"{name} is {rate:g} per second in one unit, and the dampers follow commands in A and in V; leave it out, "
            "or give dampers of one unit",
        )


def device_groups(devices: Sequence[Device]) -> list[list[int]]:
    """Indices of the devices of each group: neighbours whose dampers have equal models and laws of the command."""
    return [list(group) for _, group in groupby(range(len(devices)), key=lambda index: devices[index].spec)]


def commands_of(devices: Sequence[Device], command: float | Sequence[float], name: str = "command") -> Floats:
    """Commands of devices that a law commands [A or V], shape (n_devices,); refused by this `name`.

    One number holds for all devices, each limited to its largest command; several numbers are one for each device.
    """
    if not devices:
        return np.empty(0)
    if not np.ndim(command) and command and sends_shares(devices):
        raise InvalidSettingError(
            name,
            f"{name} is one number, and the dampers follow commands in A and in V; give one for each damper",
        )
    largest, commands = np.array([device.largest_command for device in devices]), np.atleast_1d(command)
    most = largest if np.ndim(command) else largest.max(keepdims=True)
    if commands.shape != most.shape:
        raise InvalidSettingError(
            name,
            f"{name} has {counted(commands.size, 'number')} for {counted(most.size, 'damper')} that follow a command; "
            "give one for each, or one for all",
        )
    for one, limit in zip(commands.tolist(), most.tolist(), strict=True):
        if one > limit:
            raise InvalidSettingError(name, f"{name} is {one:g}, and the driver gives {limit:g} at most")
    return np.asarray(np.minimum(commands, largest))


def products_of(devices: Sequence[Device]) -> list[list[int]]:
    """Indices of the devices that are one product each: dampers of equal model, parameters and largest command."""
    products: dict[object, list[int]] = {}
    for index, device in enumerate(devices):
        product = device.spec, device.draws.tobytes(), device.largest_command
        products.setdefault(product, []).append(index)
    return [*products.values()]


def commanded(devices: Sequence[Device]) -> tuple[Device, ...]:
    """The devices that a law commands; all devices if a law commands none, since zero then changes nothing."""
    return tuple(device for device in devices if device.is_commanded) or tuple(devices)


def refuse_order(devices: Sequence[Device]) -> None:
    """Refuse devices of which those that hold a command or follow none are not the last ones."""
    driven = commanded(devices)
    if tuple(devices[: len(driven)]) != driven:
        raise SettingError(
            f"{devices[0].name} is not commanded and stands before {driven[-1].name}, which is; give the devices that "
            "a law commands first"
        )
