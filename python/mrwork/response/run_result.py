"""What is kept of one run of a study: one arrangement under one ground motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LARGEST_ENERGY_ERROR = 1e-6
"""Above it a run says so: the steps are too long for what happens in them, as where a law chatters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """Peaks and root mean squares of floors, storeys and devices, energies [J] at the end, and how the run ended.

    `outcome` is "finished", or what kept it from that. `energy_error` is what is missing in the balance of energy,
    over the energy put in.
    """

    outcome: str
    peak_displacement: Floats
    rms_displacement: Floats
    peak_drift: Floats
    rms_drift: Floats
    peak_acceleration: Floats
    rms_acceleration: Floats
    peak_base_shear: Floats
    rms_base_shear: Floats
    peak_force: Floats
    rms_force: Floats
    peak_stroke: Floats
    mean_command: Floats
    rms_command: Floats
    input_energy: float
    kinetic_energy: float
    strain_energy: float
    damping_energy: float
    devices_energy: Floats
    energy_error: float
    substeps: int

    @property
    def finished(self) -> bool:
        """Whether its numbers count."""
        return self.outcome == "finished"

    @property
    def balanced(self) -> bool:
        """Whether its energies add up."""
        return self.energy_error <= LARGEST_ENERGY_ERROR


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """A run in time: shapes (n_time,), of floors, storeys and devices (n_time, n).

    `energy` has the columns input, kinetic, strain, damping, devices [J], summed up from the start.
    """

    time: Floats
    ground: Floats
    displacement: Floats
    acceleration: Floats
    drift: Floats
    deformation: Floats
    velocity: Floats
    force: Floats
    command: Floats
    current: Floats
    energy: Floats
