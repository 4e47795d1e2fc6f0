"""Dampers of any models side by side in a building: neighbours of one model are a group."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from mrwork.buildings.matrices import Device
from mrwork.errors import SettingError


def largest_command(devices: Sequence[Device]) -> float:
    """The largest command that any of the devices gets [A or V]; each gets no more than its own."""
    return max(device.largest_command for device in devices)


def groups_of(devices: Sequence[Device]) -> list[list[int]]:
    """Indices of the devices of each group: neighbours whose dampers have equal models and laws of the command."""
    return [list(each) for _, each in groupby(range(len(devices)), key=lambda index: devices[index].spec)]


def refuse_other_drivers(devices: Sequence[Device]) -> None:
    """Refuse dampers that one law cannot command side by side.

    Raises
    ------
    SettingError
        If some follow no command or one in another unit, or dampers of the user stand beside others.
    """
    first = devices[0]
    for device in devices[1:]:
        if device.spec != first.spec and (device.spec.own is not None or first.spec.own is not None):
            raise SettingError(
                f"{device.name} is a {device.spec.name} and {first.name} a {first.spec.name}, and a damper of your own "
                'stands beside its like alone; let a model of the package take its place by like = "MODEL" beside its '
                "run, or mr.fit_like(fit)"
            )
        if _driver_of(device) != _driver_of(first):
            raise SettingError(
                f"{device.name} follows {_driver_of(device)} and {first.name} {_driver_of(first)}, and one law "
                "commands all dampers; give all a command in one unit, and what is passive to the building"
            )


def _driver_of(device: Device) -> str:
    return f"a command in {device.spec.command_unit}" if device.spec.follows_command else "no command"
