"""What a batch of runs leaves behind: peaks, mean squares and energies, histories on request."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.matrices import Building
from mrwork.summary import Summarised, Summary, rounded

Floats = NDArray[np.float64]

ENERGY_TOLERANCE = 1e-6
"""Energy errors above this are said: 1e-8 is normal, a chattering law or too long a step makes more."""


# Quantities that a summary shows, and their units.
_SHOWN = (
    ("peak_drift", "m"),
    ("peak_acceleration", "m/s^2"),
    ("peak_force", "N"),
    ("peak_current", "A"),
    ("energy_error", "1"),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class History(Summarised):
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

    def _summary(self) -> Summary:
        return Summary(
            title=f"History of one run: {len(self.time)} samples, {self.time[-1]:g} s",
            columns=("quantity", "largest", "unit"),
            rows=[
                (name.replace("_", " "), rounded(float(np.abs(getattr(self, name)).max())), unit)
                for name, unit in (
                    ("drift", "m"),
                    ("acceleration", "m/s^2"),
                    ("force", "N"),
                    ("current", "A"),
                )
            ],
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Responses(Summarised):
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

    def _summary(self) -> Summary:
        candidates, motions, draws = self.shape
        return Summary(
            title=f"Responses of {len(self.outcome)} runs: {candidates} candidates x {motions} motions x {draws} draws",
            facts=(
                ("finished", f"{int(np.isfinite(self.energy_error).sum())} of {len(self.outcome)}"),
                ("histories", "none" if self.histories is None else f"{len(self.histories)} runs"),
            ),
            columns=("largest of a run", "least", "median", "largest", "unit"),
            rows=[
                (
                    name.replace("_", " "),
                    *(rounded(float(value)) for value in np.quantile(largest, [0.0, 0.5, 1.0])),
                    unit,
                )
                for name, unit in _SHOWN
                for largest in [_largest(getattr(self, name))]
            ],
        )


def _largest(values: Floats) -> Floats:
    """The largest of each run that finished."""
    each = values.reshape(len(values), -1).max(axis=1, initial=0.0)
    finite = each[np.isfinite(each)]
    return finite if finite.size else np.array([np.nan])
