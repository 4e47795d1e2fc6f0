"""Dampers at one place of a building that follow one command."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.summary import Summarised, Summary, rounded

Floats = NDArray[np.float64]


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

    Raises
    ------
    SettingError
        If `theta` does not fit the model, or a number is not positive.
    """

    name: str
    spec: DamperSpec
    theta: ArrayLike
    row: ArrayLike
    largest_command: float
    count: float = 1.0
    differential: bool = False

    def __post_init__(self) -> None:
        n_params = len(self.spec.parameters)
        if self.draws.ndim != 2 or self.draws.shape[1] != n_params:
            raise SettingError(
                f"{self.name}: `theta` has shape {np.shape(self.theta)}, {self.spec.name} takes ({n_params},) or "
                f"(n_draws, {n_params})"
            )
        if not (self.largest_command > 0.0 and np.isfinite(self.largest_command)):
            raise SettingError(
                f"{self.name}: the largest command is {self.largest_command}; give a positive number"
            )
        if not self.count > 0.0:
            raise SettingError(f"{self.name}: {self.count} dampers in parallel; give a positive number")

    @property
    def draws(self) -> Floats:
        """Parameters, shape (n_draws, n_params)."""
        return np.atleast_2d(np.asarray(self.theta, dtype=np.float64))

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
            ),
            columns=("parameter", "value", "unit"),
            rows=[
                (parameter.name, rounded(float(np.median(self.draws[:, index]))), parameter.unit)
                for index, parameter in enumerate(self.spec.parameters)
            ],
        )
