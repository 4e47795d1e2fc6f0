"""A building with its devices as a linear system in the state s = [q; q']: what controllers are designed on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """`s' = A s + B f + E a_g` with s = [q; q'] and f the force with which each device resists.

    From `M q'' + C q' + K q = -e' f - M r a_g` follows `B = [0; -M^-1 e']`, `E = [0; -r]`: a force f pulls the
    coordinates back, and takes energy out of the building where `f e q' > 0`.

    Parameters
    ----------
    A, B, E
        Shapes (2n, 2n), (2n, n_devices), (2n,).
    attachment
        e, elongation of each device = e @ q, shape (n_devices, n).
    scaling
        T of s = T z, shape (2n, 2n), where z has one unit: z'z is twice the energy of the building [J], or what
        balances A where the stiffness is not positive definite. Riccati and Lyapunov equations are solved in z.
    energy
        s' energy s = twice the energy of the building [J], shape (2n, 2n): M and K, each its symmetric part.
    """

    building: Building
    A: Floats
    B: Floats
    E: Floats
    attachment: Floats
    device_names: tuple[str, ...]
    scaling: Floats
    energy: Floats

    @property
    def n_coordinates(self) -> int:
        """Coordinates q of the building; the state has twice as many."""
        return int(self.attachment.shape[1])

    @property
    def n_devices(self) -> int:
        """Devices, each with one force."""
        return int(self.attachment.shape[0])


def plant_of(building: Building, attachment: ArrayLike, device_names: Sequence[str] = ()) -> Plant:
    """The linear system of a building with devices.

    Parameters
    ----------
    attachment
        e, elongation of each device = e @ q, shape (n_devices, n); a row of `building.storeys` for a device across
        a storey.
    device_names
        What reports call the devices; "device 1", "device 2" where none are given.

    Raises
    ------
    SettingError
        Where the attachment does not fit the building, or the names do not fit the devices.

    Examples
    --------
    >>> from mrwork.control.plant import plant_of
    >>> plant = plant_of(building, building.storeys[:1])  # doctest: +SKIP
    """
    mass, damping, stiffness = building.mass, building.damping, building.stiffness
    n = mass.shape[0]
    rows = np.atleast_2d(np.asarray(attachment, dtype=np.float64))
    if rows.ndim != 2 or rows.shape[0] == 0 or rows.shape[1] != n:
        raise SettingError(
            f"`attachment` has shape {rows.shape}, {building.name} takes (n_devices, {n}): "
            f"one row for each device, its elongation per unit of each coordinate"
        )
    if not np.isfinite(rows).all() or not np.any(rows, axis=1).all():
        raise SettingError(
            "a row of `attachment` is zero or not finite; each device must feel some coordinate"
        )
    names = tuple(device_names) or tuple(f"device {number + 1}" for number in range(len(rows)))
    if len(names) != len(rows):
        raise SettingError(f"{len(names)} names were given for {len(rows)} devices; give one for each")
    A = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
        ]
    )
    B = np.vstack([np.zeros((n, len(rows))), -np.linalg.solve(mass, rows.T)])
    E = np.concatenate([np.zeros(n), -building.influence])
    zeros = np.zeros((n, n))
    energy = np.block([[_symmetric(stiffness), zeros], [zeros, _symmetric(mass)]])
    return Plant(
        building=building,
        A=A,
        B=B,
        E=E,
        attachment=rows,
        device_names=names,
        scaling=_scaling(A, energy),
        energy=energy,
    )


def natural_frequencies(plant: Plant) -> Floats:
    """Natural frequencies of the building without damping [rad/s], lowest first, shape (n,)."""
    n = plant.n_coordinates
    squares = np.linalg.eigvals(-plant.A[n:, :n])
    return np.asarray(np.sqrt(np.sort(np.abs(squares))), dtype=np.float64)


def _symmetric(matrix: Floats) -> Floats:
    return 0.5 * (matrix + matrix.T)


def _scaling(A: Floats, energy: Floats) -> Floats:
    """T of s = T z, with T' energy T = 1 where that exists."""
    try:
        lower = np.linalg.cholesky(energy)
    except np.linalg.LinAlgError:
        # A building that something may move without a restoring force: balance what there is.
        from scipy.linalg import matrix_balance

        _, (diagonal, _) = matrix_balance(A, permute=False, separate=True)
        return np.diag(np.asarray(diagonal, dtype=np.float64))
    return np.asarray(np.linalg.inv(lower.T), dtype=np.float64)
