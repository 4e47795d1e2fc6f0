"""Lyapunov functions of a building, and the vectors by which control laws decrease them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.control.plant import Plant
from mrwork.control.riccati import lyapunov_solutions
from mrwork.errors import SettingError
from mrwork.summary import Summarised

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LyapunovFunction(Summarised):
    """`V = s'P s / 2` with `V' = -s'Q_P s / 2 + sigma f`, `sigma = vectors @ s`.

    Parameters
    ----------
    P, weight
        P and Q_P, shape (2n, 2n).
    vectors
        B'P, shape (n_devices, 2n). A device force decreases V faster if its sign is opposite to that of sigma.
    """

    P: Floats
    weight: Floats
    vectors: Floats


def lyapunov_function(plant: Plant, weight: ArrayLike | None = None) -> LyapunovFunction:
    """Solve `A'P + P A = -Q_P` (Jansen & Dyke, J. Eng. Mech. 126(8), 2000, 795-803).

    Parameters
    ----------
    weight
        Q_P, shape (2n, 2n), or its diagonal; `plant.energy` [1/s] by default, which is independent of the units of the
        coordinates. The paper leaves the choice open.

    Raises
    ------
    SettingError
        If Q_P is not symmetric and positive, or a mode of the building without control is undamped.
    """
    size = 2 * plant.n_coordinates
    Q_P = plant.energy if weight is None else np.asarray(weight, dtype=np.float64)
    if Q_P.ndim < 2:
        Q_P = np.diag(np.broadcast_to(Q_P, size))
    if Q_P.shape != (size, size):
        raise SettingError(
            f"`weight` has shape {Q_P.shape}, the state has {size} numbers; give ({size}, {size})"
        )
    if not np.isfinite(Q_P).all():
        raise SettingError("`weight` holds a value that is not a finite number")
    T = plant.scaling
    inverse = np.linalg.inv(T)
    A_z, Q_z = inverse @ plant.A @ T, T.T @ Q_P @ T
    size_z = float(np.linalg.norm(Q_z))
    asymmetry = np.abs(Q_z - Q_z.T).max()
    if asymmetry > 1e-9 * size_z or np.linalg.eigvalsh(Q_z)[0] < -1e-9 * size_z:
        raise SettingError("`weight` is not symmetric and positive semidefinite; give a Q_P that is")
    slowest = float(np.max(np.linalg.eigvals(A_z).real))
    if not slowest < -1e-9 * float(np.linalg.norm(A_z, 2)):
        raise SettingError(
            f"{plant.building.name} has a mode that decays at {-slowest:.2g} 1/s without control; "
            f"a Lyapunov function needs damping in every mode"
        )
    found = lyapunov_solutions(plant.A, Q_P, scaling=T, threads=1)
    found.check()
    P = found.P[0]
    return LyapunovFunction(P=P, weight=Q_P, vectors=plant.B.T @ P)
