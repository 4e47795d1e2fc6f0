"""The model of a loop that a predicting law has: a building and devices, which may differ from the true ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from mrwork.arguments import checked
from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.errors import SettingError
from mrwork.summary import Summarised


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopModel(Summarised):
    """A building with its devices as a law believes them to be; of draws of a damper it has the first.

    Passive elements count with the spring and the dashpot that they have in the matrices.

    Raises
    ------
    SettingError
        If there is no device, or their models or current laws differ.
    """

    _made_by: ClassVar[str] = "mr.control.design_law('predictive_rollout', problem)"

    building: Building
    devices: Sequence[Device]

    def __post_init__(self) -> None:
        if not self.devices:
            raise SettingError("the model of a loop has no device; give one")
        first = self.devices[0].spec
        for device in self.devices[1:]:
            if (device.spec.name, device.spec.current) != (first.name, first.current):
                raise SettingError(
                    f"{device.name} of the model is a {device.spec.name} and {self.devices[0].name} a {first.name}, or "
                    "their current laws differ; give devices of one model with the same laws"
                )
