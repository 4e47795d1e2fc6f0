"""What is kept of one run of a study: one arrangement under one ground motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop.responses import ENERGY_TOLERANCE
from mrwork.simulate import Outcome

Floats = NDArray[np.float64]

_ENDS = {
    Outcome.FINISHED: "finished",
    Outcome.DIVERGED: "diverged",
    Outcome.UNRESOLVED: "could not be resolved",
    Outcome.ABANDONED: "was abandoned",
    Outcome.FAILED_SAFE: "failed safe",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RunResult:
    """Peaks and root mean squares of floors, storeys and devices, energies [J] at the end, and how the run ended.

    `outcome` is "finished", "failed_safe" where a broken sensor left the dampers without a command, or what kept the
    run from its end. `energy_error` is what is missing in the balance of energy, over the energy turned over. `steps`
    counts integration steps per sample.
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
    peak_stroke: Floats
    mean_current: Floats
    rms_current: Floats
    input_energy: float
    kinetic_energy: float
    strain_energy: float
    damping_energy: float
    device_energy: Floats
    energy_error: float
    steps: int

    @property
    def finished(self) -> bool:
        """Whether its numbers count."""
        return self.outcome in ("finished", "failed_safe")

    @property
    def end(self) -> str:
        """How it ended, as words that follow its name, with what to do about it."""
        outcome = Outcome[self.outcome.upper()]
        return _ENDS[outcome] if outcome is Outcome.FINISHED else f"{_ENDS[outcome]}: {outcome.remedy}"

    @property
    def balanced(self) -> bool:
        """Whether its energies add up."""
        return self.energy_error <= ENERGY_TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """A run in time: shapes (n_time,), of floors, storeys and devices (n_time, n).

    `energy` has the columns input, kinetic, strain, damping, devices [J], summed up from the start.
    """

    time: Floats
    ground_acceleration: Floats
    displacement: Floats
    acceleration: Floats
    drift: Floats
    deformation: Floats
    rate: Floats
    force: Floats
    command: Floats
    current: Floats
    energy: Floats
