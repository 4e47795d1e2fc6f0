"""Linear quadratic regulators: the gain by which wanted forces follow from the state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.control.outputs import Outputs
from mrwork.control.plant import Plant
from mrwork.control.riccati import solve_riccati
from mrwork.errors import SettingError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Regulator:
    """The regulator that minimises `int s'Q s + 2 s'N f + f'R f dt` over the forces f of the devices.

    Parameters
    ----------
    gain
        K of the wanted resisting force `f_c = -K s`, shape (n_devices, 2n). It has the sign of the force of a damper:
        a device that can give f_c resists its elongation where f_c is positive.
    riccati
        P of the cost to go s'P s, shape (2n, 2n).
    vectors
        B'P, shape (n_devices, 2n): one row for each device, `sigma = vectors @ s`.
    control_weight
        R with what the weighed outputs add to it, shape (n_devices, n_devices) [1/N^2].
    poles
        Of the closed loop A - B K [1/s], shape (2n,).
    residual
        Of the Riccati equation, relative to its terms.
    """

    gain: Floats
    riccati: Floats
    vectors: Floats
    control_weight: Floats
    poles: NDArray[np.complex128]
    residual: float


def regulator_of_outputs(
    plant: Plant, outputs: Outputs, weights: ArrayLike, control_weight: ArrayLike
) -> Regulator:
    """The regulator that weighs outputs y = C s + D f: `int y'W y + f'R f dt`.

    So `Q = C'W C`, `N = C'W D`, and D'W D joins R. The cross term counts: an acceleration is moved by the force at
    once.

    Parameters
    ----------
    weights
        W, one number for each output, shape (n_outputs,), in the inverse squares of their units; or a matrix.
    control_weight
        R [1/N^2]: one number for all devices, one for each, or a matrix.

    Raises
    ------
    SettingError
        Where a weight has the wrong shape or sign, or the Riccati equation has no stabilising solution.

    Examples
    --------
    >>> # The acceleration of the third floor, as in Dyke et al. 1996
    >>> regulator = regulator_of_outputs(plant, accelerations(plant), [0, 0, 1], 1e-17)  # doctest: +SKIP
    """
    W = _weight("weights", weights, len(outputs.names))
    R = _weight("control_weight", control_weight, plant.n_devices)
    C, D = outputs.C, outputs.D
    return _regulator(plant, C.T @ W @ C, R + D.T @ W @ D, C.T @ W @ D)


def regulator_of_state(plant: Plant, state_weight: ArrayLike, control_weight: ArrayLike) -> Regulator:
    """The regulator that weighs the state itself: `int s'Q s + f'R f dt`.

    Parameters
    ----------
    state_weight
        Q over s = [q; q'], shape (2n, 2n), or its diagonal. `plant.energy` weighs twice the energy of the building.
    control_weight
        R [1/N^2]: one number for all devices, one for each, or a matrix.

    Raises
    ------
    SettingError
        Where a weight has the wrong shape or sign, or the Riccati equation has no stabilising solution.
    """
    Q = _weight("state_weight", state_weight, 2 * plant.n_coordinates)
    R = _weight("control_weight", control_weight, plant.n_devices)
    return _regulator(plant, Q, R, np.zeros((len(Q), len(R))))


def _regulator(plant: Plant, Q: Floats, R: Floats, N: Floats) -> Regulator:
    if not np.linalg.eigvalsh(R)[0] > 0.0:
        raise SettingError(
            "the weight of the forces, with what the outputs add to it, is not positive definite; "
            "give a positive `control_weight`"
        )
    solution = solve_riccati(plant.A, plant.B, Q, R, N, scaling=plant.scaling)
    return Regulator(
        gain=solution.gain,
        riccati=solution.P,
        vectors=plant.B.T @ solution.P,
        control_weight=R,
        poles=solution.poles,
        residual=solution.residual,
    )


def _weight(name: str, given: ArrayLike, size: int) -> Floats:
    """A weight as a symmetric matrix without a negative direction."""
    value = np.asarray(given, dtype=np.float64)
    if value.ndim == 0:
        value = np.full(size, float(value))
    matrix = np.diag(value) if value.ndim == 1 else value
    if matrix.shape != (size, size):
        raise SettingError(f"`{name}` has shape {np.shape(given)}; give ({size},) or ({size}, {size})")
    if not np.isfinite(matrix).all():
        raise SettingError(f"`{name}` holds a value that is not a finite number")
    scale = np.sqrt(np.abs(np.diag(matrix)))
    # Judged in units in which the diagonal is 1, for rows of a weight may be metres beside metres per second.
    judged = matrix / np.outer(np.where(scale > 0.0, scale, 1.0), np.where(scale > 0.0, scale, 1.0))
    if not np.allclose(judged, judged.T, atol=1e-9) or np.linalg.eigvalsh(judged)[0] < -1e-9:
        raise SettingError(f"`{name}` is not symmetric and positive semidefinite; weights cannot be negative")
    return 0.5 * (matrix + matrix.T)
