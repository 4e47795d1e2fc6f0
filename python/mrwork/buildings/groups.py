"""Groups of dampers of one model under one law: laws of the command of one form, and the largest command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.buildings.matrices import Device
from mrwork.dampers.laws import CommandLaw, common_law
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.errors import SettingError


def largest_command(devices: Sequence[Device]) -> float:
    """The largest command that any of the devices gets [A or V]; each gets no more than its own."""
    return max(device.largest_command for device in devices)


def with_common_laws(devices: Sequence[Device]) -> tuple[Device, ...]:
    """The devices with laws of the command of one form, by which their forces are what they were.

    Raises
    ------
    SettingError
        If they are of several models, or their drivers or laws have no common form.
    """
    first = devices[0]
    if all(device.spec == first.spec for device in devices):
        return tuple(devices)
    plain, driver = first.spec.without_laws, _driver_of(first.spec)
    for device in devices[1:]:
        if device.spec.without_laws != plain:
            raise SettingError(
                f"{device.name} is a {device.spec.name} and {first.name} a {plain.name}, and the dampers of one loop "
                "are of one model, each with parameters and laws of its own; identify all of them by one model"
            )
        if _driver_of(device.spec) != driver:
            raise SettingError(
                f"{device.name} follows {_driver_of(device.spec)} and {first.name} {driver}, and one law commands all "
                "dampers; give all a driver of one kind, and what is passive to the building"
            )
    given = [by_parameter(device.spec, device.draws) for device in devices]
    laws: dict[str, CommandLaw] = {}
    theta: list[list[Floats]] = [[] for _ in devices]
    for number, parameter in enumerate(plain.parameters):
        own = [each.spec.laws[number] for each in devices]
        curves = zip(own, (parts[number] for parts in given), devices, strict=True)
        common = common_law([(law, each, device.largest_command) for law, each, device in curves], parameter)
        if common is None:
            of_each = (f"{law} for {device.name}" for law, device in zip(own, devices, strict=True))
            raise SettingError(
                f"{parameter.name} has the laws {list_names(list(of_each))}, which have no form in common within its "
                "range; give it by values at commands from 0 to the largest, as values:0,0.5,1"
            )
        laws[parameter.name] = common[0]
        for columns, each in zip(theta, common[1], strict=True):
            columns.append(each)
    lagged = first.spec.lagged and first.spec.follows_command
    spec = plain.with_current_laws(laws, unit=first.spec.command_unit or "A", lagged=lagged)
    for columns, parts in zip(theta, given, strict=True):
        columns += [parts[-1]] * lagged
    return tuple(
        replace(device, spec=spec, theta=np.concatenate(columns, axis=-1))
        for device, columns in zip(devices, theta, strict=True)
    )


def _driver_of(spec: DamperSpec) -> str:
    if not spec.follows_command:
        return "no command"
    return f"a command in {spec.command_unit} {'with' if spec.lagged else 'without'} a lag"
