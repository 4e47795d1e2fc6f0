"""What is measured on a building, weighed or judged, as rows over its state and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.control.plant import Plant
from mrwork.errors import UnknownNameError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """`y = C s + D f + G a_g`: names and rows, shapes (n_outputs, 2n), (n_outputs, n_devices), (n_outputs,).

    G is zero but for accelerations of a reduced building, whose floors do not quite follow the ground as one.
    """

    names: tuple[str, ...]
    C: Floats
    D: Floats
    G: Floats

    def select(self, names: Sequence[str]) -> Outputs:
        """Those of the outputs that are named, in the order of the names.

        Raises
        ------
        UnknownNameError
            Where there is no such output; the message lists those there are.
        """
        for name in names:
            if name not in self.names:
                raise UnknownNameError(f"no output is called {name!r}; choose from {', '.join(self.names)}")
        rows = [self.names.index(name) for name in names]
        return Outputs(names=tuple(names), C=self.C[rows], D=self.D[rows], G=self.G[rows])


def stacked(*parts: Outputs) -> Outputs:
    """Several groups of outputs as one."""
    return Outputs(
        names=tuple(name for part in parts for name in part.names),
        C=np.vstack([part.C for part in parts]),
        D=np.vstack([part.D for part in parts]),
        G=np.concatenate([part.G for part in parts]),
    )


def drifts(plant: Plant) -> Outputs:
    """Drift of each storey [m]: "drift NAME"."""
    return _positions(plant, plant.building.storeys, "drift", plant.building.storey_names)


def displacements(plant: Plant) -> Outputs:
    """Displacement of each floor relative to the ground [m]: "displacement NAME"."""
    return _positions(plant, plant.building.floors, "displacement", plant.building.floor_names)


def velocities(plant: Plant) -> Outputs:
    """Velocity of each floor relative to the ground [m/s]: "velocity NAME"."""
    return _rates(plant, plant.building.floors, "velocity", plant.building.floor_names)


def accelerations(plant: Plant) -> Outputs:
    """Absolute acceleration of each floor [m/s^2]: "acceleration NAME".

    `floors q'' + a_g`, so `C = floors [-M^-1 K, -M^-1 C]`; a device acts on the floor at once: `D = -floors M^-1 e'`.
    """
    n = plant.n_coordinates
    floors = plant.building.floors
    return Outputs(
        names=_named("acceleration", plant.building.floor_names),
        C=floors @ plant.A[n:],
        D=floors @ plant.B[n:],
        G=_cleaned(1.0 + floors @ plant.E[n:]),
    )


def deformations(plant: Plant) -> Outputs:
    """Elongation of each device [m]: "deformation NAME"."""
    return _positions(plant, plant.attachment, "deformation", plant.device_names)


def deformation_rates(plant: Plant) -> Outputs:
    """Rate of elongation of each device [m/s]: "rate NAME"."""
    return _rates(plant, plant.attachment, "rate", plant.device_names)


def _named(quantity: str, places: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"{quantity} {place}" for place in places)


def _positions(plant: Plant, rows: Floats, quantity: str, places: Sequence[str]) -> Outputs:
    return _of_state(plant, np.hstack([rows, np.zeros_like(rows)]), _named(quantity, places))


def _rates(plant: Plant, rows: Floats, quantity: str, places: Sequence[str]) -> Outputs:
    return _of_state(plant, np.hstack([np.zeros_like(rows), rows]), _named(quantity, places))


def _of_state(plant: Plant, C: Floats, names: tuple[str, ...]) -> Outputs:
    return Outputs(names=names, C=C, D=np.zeros((len(C), plant.n_devices)), G=np.zeros(len(C)))


def _cleaned(direct: Floats) -> Floats:
    """The direct term of the ground, without what rounding leaves of a floor that follows it exactly."""
    return np.where(np.abs(direct) < 1e-12, 0.0, direct)
