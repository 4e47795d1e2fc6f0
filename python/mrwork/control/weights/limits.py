"""Input of a weight design: limits on rms responses, a budget of force, the semi-active condition."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from mrwork.base.arguments import Level, Positive, checked
from mrwork.base.keys import keys_of, positive
from mrwork.base.units import number_in
from mrwork.base.values import Floats, array_dataclass, one_for_each
from mrwork.buildings.device import Device
from mrwork.control.linear.plant import Outputs, Plant, accelerations, displacements, drifts, stack_outputs
from mrwork.dampers.simulation import simulate_force, sinusoid
from mrwork.errors import InvalidSettingError, SettingError

Limit = float | tuple[float, ...]
"""One limit for all places, or one for each."""


@checked
class RmsLimits:
    """Limits on rms responses, one for all places or one for each; only their ratios to each other matter.

    The design finds the least factor by which all limits can be met at once with the budget of force.
    """

    _made_by: ClassVar[str] = "mr.control.RmsLimits(rms_drift=...)"

    rms_drift: Limit | None = positive("limit of the rms drift of storeys", unit="m")
    rms_acceleration: Limit | None = positive("limit of the rms absolute acceleration of floors", unit="m/s2")
    rms_displacement: Limit | None = positive(
        "limit of the rms displacement of floors relative to the ground", unit="m"
    )
    rms_force: Limit | None = positive(
        "limit of the rms force of devices, which is scaled with the others; the budget is not", unit="N"
    )

    @classmethod
    @checked
    def of(cls, given: RmsLimits | Mapping[str, Limit | str | Sequence[float | str]]) -> RmsLimits:
        """The limits from values by name, numbers in SI or texts with a unit.

        Raises
        ------
        SettingError
            If one has an unknown name, or is no number.
        """
        if isinstance(given, RmsLimits):
            return given
        if not isinstance(given, Mapping):
            raise SettingError(
                f'limits are {type(given).__name__}; give them by name, as {{"rms_drift": 2e-3}}, or RmsLimits'
            )
        units = {entry.name: entry.says.unit for entry in keys_of(cls)}
        for name in given:
            if name not in units:
                hint = (
                    f"limits are rms values, of which a peak is about three times: give rms_{name[5:]}"
                    if name.startswith("peak_") and f"rms_{name[5:]}" in units
                    else f"there are {', '.join(units)}"
                )
                raise SettingError(f"no limit is called {name!r}; {hint}")
        return cls(**{name: _in_si(name, value, units[name]) for name, value in given.items()})


def _in_si(name: str, value: object, unit: str) -> Any:
    """A number, or several, of which a text has a unit; `None` stays."""
    if isinstance(value, str):
        number = number_in(value, unit)
        if isinstance(number, str):
            raise SettingError(f"{name} {number}")
        return number
    if isinstance(value, Sequence):
        return tuple(_in_si(name, entry, unit) for entry in value)
    return value


@array_dataclass()
class LimitedOutputs:
    """The outputs with a limit: their names, units, limits in SI, shape (n_outputs,), and the setting of each."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    settings: tuple[str, ...]
    limits: Floats

    @classmethod
    def of(cls, limits: RmsLimits, plant: Plant) -> LimitedOutputs:
        """The outputs of a plant that have a limit."""
        limited: list[tuple[str, str, str, float]] = []
        for setting, (unit, noun, outputs_of) in _QUANTITIES.items():
            bound = getattr(limits, setting)
            if bound is None:
                continue
            outputs = outputs_of(plant)
            each_limit = one_for_each(setting, bound, len(outputs.names), noun).tolist()
            pairs = zip(outputs.names, each_limit, strict=True)
            limited += [(name, unit, setting, limit) for name, limit in pairs if math.isfinite(limit)]
        if all(setting == "rms_force" for _, _, setting, _ in limited):
            raise InvalidSettingError(
                "rms_drift",
                "no response is limited, so that no force would be the best; give rms_drift, rms_acceleration or "
                "rms_displacement",
            )
        names, units, settings, numbers = zip(*limited, strict=True)
        return cls(names=names, units=units, settings=settings, limits=np.array(numbers))

    def of_plant(self, plant: Plant) -> Outputs:
        """The limited outputs of a plant of the same floors, storeys and devices."""
        outputs = (outputs_of(plant) for _, _, outputs_of in _QUANTITIES.values())
        return stack_outputs(*outputs).select(self.names)


def _forces(plant: Plant) -> Outputs:
    m = plant.n_devices
    return Outputs(
        names=tuple(f"force {name}" for name in plant.device_names),
        C=np.zeros((m, len(plant.A))),
        D=np.eye(m),
        G=np.zeros(m),
    )


_QUANTITIES: Mapping[str, tuple[str, str, Callable[[Plant], Outputs]]] = {
    "rms_drift": (
        "m",
        "storey",
        lambda plant: drifts(plant).select([f"drift {name}" for name in plant.building.drift_names]),
    ),
    "rms_acceleration": ("m/s2", "floor", accelerations),
    "rms_displacement": ("m", "floor", displacements),
    "rms_force": ("N", "device", _forces),
}
"""Unit of each limit, what it belongs to, and the outputs that it limits."""


@checked
class SemiActiveCondition:
    """`E[(f - c v)^2] <= b^2 E[f^2]`: the desired force is like a damper's up to a share b.

    With c = E[f v] / E[v^2] it says that force and rate of elongation have a correlation of sqrt(1 - b^2) at least.

    Parameters
    ----------
    share
        b, between 0 and 1.
    damping
        c of each device [N s/m]; by default the damping of least ratio, which the desired force then has itself.
    """

    _made_by: ClassVar[str] = "mr.control.SemiActiveCondition(share=...)"

    share: Level
    damping: Positive | tuple[Positive, ...] | None = None


def as_forces(budget: float | str | Sequence[float | str] | Floats, plant: Plant) -> Floats:
    """The budget of each device [N], shape (n_devices,); a text has a unit, as "1.5 kN"."""
    values = one_for_each("budget", _in_si("budget", budget, "N"), plant.n_devices, "device")
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise SettingError(f"budget is {budget} N; give a positive rms force")
    return values


def sine_force(device: Device, amplitude: float, velocity: float, command: float) -> Floats:
    """Force of all dampers of a device [N] over a cycle of this amplitude [m] and peak velocity [m/s], shape (400,).

    It is the last of three cycles of a sinusoid at a constant command, from its middle on.
    """
    samples, unit = 400, device.spec.command_unit
    if device.is_actuator:
        if np.isinf(command):
            raise SettingError(
                f"{device.name} has no largest force, from which the law takes its budget; give it"
            )
        return np.full(samples, command)

    def force(sign: float) -> Floats:
        motion = sinusoid(
            sign * amplitude,
            sign * velocity,
            cycles=3,
            per_cycle=samples,
            command=None if unit is None else command,
            command_unit=unit,
        )
        return sign * device.count * simulate_force(device.spec, device.draws[0], motion)

    whole = force(1.0) + force(-1.0) if device.differential else force(1.0)
    return whole[2 * samples : 3 * samples]
