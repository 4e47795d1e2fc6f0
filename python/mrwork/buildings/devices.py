"""Dampers at one place of a building that follow one command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mrwork.arguments import NotNegative, Positive, checked
from mrwork.buildings.matrices import Building
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.summary import Summarised, Summary, rounded
from mrwork.tested_range import OperatingRange, Outside, outside_of
from mrwork.values import Floats, holds_arrays, keep_arrays

# A command with a mean above this share of its peak is constant but for the lag of the driver.
_CONSTANT = 0.9


@checked
@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Device(Summarised):
    """Dampers at one place that follow one command between 0 and `largest_command`.

    `theta` belongs to one damper. The force of the device in responses and laws, and the weights and slopes of a law,
    are those of all its dampers together.

    Parameters
    ----------
    spec, theta
        Damper model and its parameters, shape (n_params,), or one row per draw.
    row
        Elongation = row @ q, shape (n,): a row of `building.storeys`.
    count
        Number of dampers in parallel.
    differential
        Whether as many dampers act in the opposite direction, so that constant forces cancel.
    tested
        Ranges in which one of the dampers was tested, as `Fit.tested`; `None` if unknown.

    Raises
    ------
    SettingError
        If `theta` does not fit the model, or a number is not positive.
    """

    _made_by: ClassVar[str] = "mr.Device(name=..., spec=..., theta=..., row=..., largest_command=...)"

    name: str
    spec: DamperSpec
    theta: ArrayLike
    row: ArrayLike
    largest_command: float
    count: float = 1.0
    differential: bool = False
    tested: OperatingRange | None = None

    def __post_init__(self) -> None:
        keep_arrays(self, "theta", "row")
        n_params = len(self.spec.parameters)
        if self.draws.ndim != 2 or self.draws.shape[1] != n_params:
            raise SettingError(
                f"{self.name}: `theta` has shape {np.shape(self.theta)}, {self.spec.name} takes ({n_params},) or "
                f"(n_draws, {n_params})"
            )
        if np.ndim(self.row) != 1 or not np.size(self.row):
            raise SettingError(
                f"{self.name}: `row` has shape {np.shape(self.row)}; give (n,), a row of `building.storeys`"
            )
        if not self.largest_command > 0.0:
            raise SettingError(
                f"{self.name}: the largest command is {self.largest_command}; give a positive number"
            )
        if not self.count > 0.0:
            raise SettingError(f"{self.name}: {self.count} dampers in parallel; give a positive number")

    @property
    def draws(self) -> Floats:
        """Parameters, shape (n_draws, n_params)."""
        return np.atleast_2d(np.asarray(self.theta, dtype=np.float64))

    @checked
    def demand(
        self,
        *,
        stroke: NotNegative,
        velocity: NotNegative,
        force: NotNegative,
        energy: float,
        seconds: Positive,
        peak_command: NotNegative,
        mean_command: NotNegative,
        least_stroke: NotNegative | None = None,
    ) -> OperatingRange:
        """Demand of a run on one of the dampers, from peaks and the dissipated energy of all of them.

        The frequency is that of a sinusoid with the peak velocity and the peak stroke. A command whose mean is within
        10 % of its peak is taken for constant, any other to start from zero, as every run does. `least_stroke` is that
        of `OperatingRange`, `None` where the run has no history.
        """
        n_dampers = self.count * (2.0 if self.differential else 1.0)
        frequency = velocity / (2.0 * np.pi * stroke) if stroke > 0.0 else None
        command = None
        if self.spec.current is not None and self.spec.follows_command:
            constant = mean_command > _CONSTANT * peak_command
            command = (peak_command if constant else 0.0, peak_command)
        return OperatingRange(
            stroke=stroke,
            velocity=velocity,
            frequency=None if frequency is None else (frequency, frequency),
            command=command,
            command_unit=None if command is None or self.spec.current is None else self.spec.current.unit,
            force=force / n_dampers,
            power=max(0.0, energy / n_dampers / seconds),
            least_stroke=least_stroke,
        )

    @property
    def knows_least_stroke(self) -> bool:
        """Whether demand can be below the tested strokes, which only the history of a run shows."""
        return self.tested is not None and self.tested.least_stroke is not None

    @checked
    def outside(self, demand: OperatingRange) -> Outside:
        """What of a demand lies outside the tested ranges; laws are evaluated at the median of the draws."""
        return outside_of(self.spec, np.median(self.draws, axis=0), self.tested, demand)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Device {self.name}: {self.spec.name}",
            facts=(
                (
                    "dampers",
                    f"{self.count:g}{', and as many in opposition' if self.differential else ''}",
                ),
                ("command", f"0 to {self.largest_command:g}"),
                ("draws", str(len(self.draws))),
                ("tested", self.tested.in_words if self.tested else "not known"),
            ),
            columns=("parameter", "value", "unit"),
            rows=[
                (parameter.name, rounded(float(np.median(self.draws[:, index]))), parameter.unit)
                for index, parameter in enumerate(self.spec.parameters)
            ],
        )


def elongation_rows(building: Building, devices: Sequence[Device]) -> Floats:
    """Rows of elongation of devices in a building, shape (n_devices, n)."""
    n = building.n_coordinates
    if not devices:
        raise SettingError(f"no device was given for {building.name}; give one or more")
    for device in devices:
        if np.shape(device.row) != (n,) or not np.any(device.row):
            raise SettingError(
                f"{device.name}: `row` has shape {np.shape(device.row)}; {building.name} takes ({n},), not all zero: "
                "a row of `building.storeys`"
            )
    return np.array([device.row for device in devices], dtype=np.float64)
