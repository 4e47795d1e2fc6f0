"""Further signals of a law of measured signals: accelerations, and running root mean squares of readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from mrwork.arguments import Positive, checked
from mrwork.hints import Within

SignalSource = Literal[
    "deformation", "rate", "force", "acceleration", "floor_acceleration", "ground_acceleration"
]
"""What is measured: of a device, of a floor, or of the ground."""

SignalName = Literal[
    "acceleration",
    "ground_acceleration",
    "rms_deformation",
    "rms_rate",
    "rms_force",
    "rms_acceleration",
    "rms_ground_acceleration",
]
"""Further signals in a study; those of floors are chosen by the numbers of the floors."""


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class FurtherSignal:
    """A reading that a law of measured signals takes besides those of its device, or its running root mean square.

    The mean of the squares fades: `s = a s + (1 - a) y^2` at each control sample, `a = exp(-Ts / time_constant)`, from
    zero on; the signal is its root. A reading that is not finite leaves it as it is, and sends no command.

    Parameters
    ----------
    source
        Elongation [m], rate [m/s] or force [N] of the device; its absolute acceleration [m/s^2], that of its upper end
        less that of its lower end; that of a floor, or of the ground [m/s^2].
    floor
        Number of the floor, from 0, of a floor's acceleration.
    time_constant
        That of the running root mean square [s]; `None` for the reading itself.
    """

    source: SignalSource
    floor: Annotated[int, Within(least=0)] = 0
    time_constant: Positive | None = None

    @property
    def reads_acceleration(self) -> bool:
        """Whether it is the absolute acceleration of floors."""
        return self.source in {"acceleration", "floor_acceleration"}


SOURCES: Mapping[SignalName, tuple[SignalSource, bool]] = {
    "acceleration": ("acceleration", False),
    "ground_acceleration": ("ground_acceleration", False),
    "rms_deformation": ("deformation", True),
    "rms_rate": ("rate", True),
    "rms_force": ("force", True),
    "rms_acceleration": ("acceleration", True),
    "rms_ground_acceleration": ("ground_acceleration", True),
}
"""Source of each signal of a study, and whether it is a running root mean square."""
