"""What a batch of runs leaves behind: peaks, mean squares and energies, histories on request."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.building import Building

Floats = NDArray[np.float64]

ENERGY_TOLERANCE = 1e-6
"""Energy errors above this are said: 1e-8 is normal, a chattering law or too long a step makes more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """One run over time, at the control samples; first axis n_time.

    Energies are those spent since the beginning [J]; `state` is [q; q'], shape (n_time, 2n).
    """

    time: Floats
    ground_acceleration: Floats
    state: Floats
    displacement: Floats
    acceleration: Floats
    drift: Floats
    deformation: Floats
    rate: Floats
    force: Floats
    command: Floats
    current: Floats
    device_energy: Floats
    input_energy: Floats
    damping_energy: Floats

    def kinetic_energy(self, building: Building) -> Floats:
        """Of the motion relative to the ground [J], shape (n_time,)."""
        velocity = self.state[:, len(building.mass) :]
        return np.asarray(0.5 * np.einsum("ti,ij,tj->t", velocity, building.mass, velocity))

    def strain_energy(self, building: Building) -> Floats:
        """Of the building's stiffness [J], shape (n_time,)."""
        displacement = self.state[:, : len(building.mass)]
        return np.asarray(0.5 * np.einsum("ti,ij,tj->t", displacement, building.stiffness, displacement))


@dataclass(frozen=True, slots=True, kw_only=True)
class Responses:
    """Runs in the order candidate, motion, draw, the last the fastest; infinite where a run did not end.

    Quantities of floors, storeys and devices have a second axis for these. Peaks and mean squares are taken at every
    integration step, accelerations are absolute. `energy_error` is the largest imbalance of input, kinetic, strain,
    damping and device energy during the run, over the energy turned over. `steps` counts integration steps per sample,
    `shape` the candidates, motions and draws.
    """

    shape: tuple[int, int, int]
    outcome: NDArray[np.uint8]
    steps: NDArray[np.uint32]
    peak_displacement: Floats
    rms_displacement: Floats
    peak_acceleration: Floats
    rms_acceleration: Floats
    peak_drift: Floats
    rms_drift: Floats
    peak_base_shear: Floats
    rms_base_shear: Floats
    peak_force: Floats
    rms_force: Floats
    peak_stroke: Floats
    peak_rate: Floats
    peak_current: Floats
    mean_current: Floats
    rms_current: Floats
    device_energy: Floats
    input_energy: Floats
    kinetic_energy: Floats
    strain_energy: Floats
    damping_energy: Floats
    energy_error: Floats
    histories: tuple[History, ...] | None = None
