"""The problem of a design, a building with devices, and its result, the gains of a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Positive, checked
from mrwork.buildings import Building
from mrwork.buildings.devices import Device, elongation_rows
from mrwork.control.counterpart import is_curve, static_counterpart
from mrwork.control.design.limits import LoopTiming
from mrwork.control.plant import Plant, plant_of
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.summary import Summarised
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DesignProblem(Summarised):
    """The building with its devices for which a law is designed.

    `sample_time` and `delay` [s] are those of the loop. `amplitude` [m] and `velocity` [m/s] are the smallest and the
    largest ones expected of the dampers, if given.
    """

    _made_by: ClassVar[str] = "mr.control.DesignProblem(building=..., devices=..., sample_time=...)"
    _units: ClassVar[Mapping[str, str]] = {"sample_time": "s", "delay": "s"}

    building: Building
    devices: Sequence[Device]
    sample_time: Positive
    amplitude: tuple[Positive, Positive] | None = None
    velocity: tuple[Positive, Positive] | None = None
    delay: NotNegative = 0.0

    @property
    def curve(self) -> tuple[DamperSpec, Floats]:
        """The static model of the first damper: its force as a function of the command.

        Raises
        ------
        SettingError
            If the damper needs a static counterpart, and the expected motions are not given.
        """
        if not self.devices:
            raise SettingError(
                "this law needs the force of a damper, and the problem has no device; give one"
            )
        device = self.devices[0]
        theta = device.draws[0]
        if is_curve(device.spec):
            return device.spec, theta
        if self.amplitude is None or self.velocity is None:
            raise SettingError(
                f"this law needs the force as a function of the command, for which {device.spec.name} is replaced by a "
                "static model; give the [[damper]] its amplitude and velocity, as amplitude = [1e-4, 1e-2]"
            )
        found = static_counterpart(
            device.spec,
            theta,
            largest_command=device.largest_command,
            amplitude=self.amplitude,
            velocity=self.velocity,
        )
        return found.spec, np.array(found.theta)

    @property
    def plant(self) -> Plant:
        """The linear system of the building with its devices."""
        rows = elongation_rows(self.building, self.devices)
        return plant_of(self.building, rows, [device.name for device in self.devices])

    @property
    def timing(self) -> LoopTiming:
        """Sample time and delay of the loop, and the lag of the driver of the devices; without one, no lag.

        Raises
        ------
        SettingError
            If the drivers of the devices differ, or the delay is not a whole number of samples or has too many.
        """
        # The rate of the driver is the last parameter of a model that has one.
        rates = dict.fromkeys(
            float(device.draws[0, -1])
            if device.spec.current is not None and device.spec.current.lagged
            else None
            for device in self.devices
        )
        if len(rates) > 1:
            shown = ", ".join("none" if rate is None else f"{rate:g} 1/s" for rate in rates)
            raise SettingError(
                f"the drivers of the devices have lags of different rates ({shown}), and a design in discrete time "
                "takes one; give all devices the same lag"
            )
        (rate,) = rates or (None,)
        return LoopTiming(sample_time=self.sample_time, delay=self.delay, driver_rate=rate)

    @checked
    def each(self, number: float) -> Floats:
        """An array with the same number for every device."""
        return np.full(len(self.devices), number)


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Design(Summarised):
    """Gains of a law by name, one number or one row over the state for each device; and its tables."""

    gains: Mapping[str, Floats] = field(default_factory=dict)
    tables: Mapping[str, Floats] = field(default_factory=dict)
