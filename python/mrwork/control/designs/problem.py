"""What a control law is designed on, the building with its devices, and what a design consists of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings import Building
from mrwork.buildings.devices import Device
from mrwork.control.counterpart import static_counterpart
from mrwork.control.plant import Plant, plant_of
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError

Floats = NDArray[np.float64]

# A static model stands for itself, over whatever motions.
_ANY = (1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignProblem:
    """What a law is designed on.

    `sample_time` [s] is that of the loop, `amplitude` [m] and `velocity` [m/s] the least and the largest that the
    dampers are expected to see, if they are stated.
    """

    building: Building
    devices: Sequence[Device]
    sample_time: float
    amplitude: tuple[float, float] | None = None
    velocity: tuple[float, float] | None = None

    @property
    def curve(self) -> tuple[DamperSpec, Floats]:
        """The static model in place of the first damper: its force over the command.

        Raises
        ------
        SettingError
            Where the damper is another model, and the motions for which it is replaced are not stated.
        """
        device = self.devices[0]
        if device.spec.name != "static_hysteretic" and (self.amplitude is None or self.velocity is None):
            raise SettingError(
                f"this law wants the force over the command, for which {device.spec.name} is replaced by a static "
                "model; give the [[damper]] its amplitude and velocity, as amplitude = [1e-4, 1e-2]"
            )
        theta = device.draws[0]
        found = static_counterpart(
            device.spec,
            theta,
            largest_command=device.largest_command,
            amplitude=self.amplitude or _ANY,
            velocity=self.velocity or _ANY,
        )
        return found.spec, np.array(found.theta)

    @property
    def plant(self) -> Plant:
        """The linear system of the building with its devices."""
        rows = np.array([device.row for device in self.devices])
        return plant_of(self.building, rows, [device.name for device in self.devices])

    def each(self, number: float) -> Floats:
        """The same number for every device."""
        return np.full(len(self.devices), number)


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Gains of a law by name: one number for each device, or a row over the state; and arrays that it looks up."""

    gains: Mapping[str, Floats] = field(default_factory=dict)
    tables: Mapping[str, Floats] = field(default_factory=dict)
