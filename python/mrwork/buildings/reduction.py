"""Model reduction: modal truncation of a building, balanced truncation of a linear system."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov, svd

from mrwork.arguments import checked
from mrwork.buildings.elements import carried
from mrwork.buildings.matrices import Building
from mrwork.buildings.modes import modes_of
from mrwork.buildings.state_space import LinearSystem
from mrwork.errors import SettingError
from mrwork.summary import Summarised
from mrwork.values import holds_arrays

Floats = NDArray[np.float64]

# Square roots of the Gramians are exact to the square root of rounding; smaller singular values are noise.
_NOISE: Final = 1e-8


@checked
def modal_truncation(building: Building, *, n_modes: int) -> Building:
    """Return the building in the coordinates of its lowest modes.

    With `q = modes y` over the modes kept and modes' M modes = I, the mass is I, the stiffness omega^2, the damping
    modes' C modes including the coupling between modes, and the influence `modes' M r`. Floors and storeys remain the
    same; the contribution of the truncated modes is lost, including its static part.

    Raises
    ------
    SettingError
        If there are fewer modes.
    """
    if not 1 <= n_modes <= building.n_coordinates:
        raise SettingError(
            f"building {building.name}: {n_modes} modes are to be kept; give a number from 1 "
            f"to {building.n_coordinates}"
        )
    omega, modes = modes_of(building.mass, building.stiffness)
    kept = modes[:, :n_modes]
    return replace(
        building,
        name=f"{building.name}, {n_modes} modes",
        mass=np.eye(n_modes),
        damping=kept.T @ building.damping @ kept,
        stiffness=np.diag(omega[:n_modes] ** 2),
        influence=kept.T @ building.mass @ building.influence,
        floors=building.floors @ kept,
        storeys=building.storeys @ kept,
        elements=carried(building.elements, kept),
        source=f"{building.source}; reduced to {n_modes} modes".removeprefix("; "),
        status="ours",
    )


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BalancedReduction(Summarised):
    """A reduced system, the Hankel singular values of the full system, shape (n,), and an error bound.

    `error_bound` limits the largest singular value of the difference of the frequency responses at any frequency.
    """

    system: LinearSystem
    hankel: Floats
    error_bound: float


@checked
def balanced_truncation(system: LinearSystem, *, order: int) -> BalancedReduction:
    """Reduce a stable system to its most controllable and observable states.

    Square-root method (Tombs, Postlethwaite, Int. J. Control 46, 1987, 1319-1330); the error is at most twice the sum
    of the truncated Hankel singular values (Glover, Int. J. Control 39, 1984, 1115-1193).

    Raises
    ------
    SettingError
        If the system is not stable, or has fewer significant states than `order`.
    """
    if not system.n_states:
        raise SettingError("balanced truncation: the system has no states; give one that has")
    slowest = float(system.poles.real.max())
    if slowest >= 0.0:
        raise SettingError(
            f"balanced truncation: a pole of the system has the real part {slowest:g} 1/s; it must be stable, so give "
            "each mode some damping"
        )
    controllability = _root(solve_continuous_lyapunov(system.A, -system.B @ system.B.T))
    observability = _root(solve_continuous_lyapunov(system.A.T, -system.C.T @ system.C))
    left, hankel, right = svd(observability.T @ controllability)
    n_clear = int((hankel > _NOISE * hankel[0]).sum())
    if not 1 <= order <= n_clear:
        raise SettingError(
            f"balanced truncation: order {order} was requested; {n_clear} of {system.n_states} states are clear of "
            f"rounding, give a number from 1 to {n_clear}"
        )
    scale = 1.0 / np.sqrt(hankel[:order])
    into = scale[:, None] * (left[:, :order].T @ observability.T)
    out = (controllability @ right[:order].T) * scale
    reduced = LinearSystem(
        A=into @ system.A @ out,
        B=into @ system.B,
        C=system.C @ out,
        D=system.D,
        input_names=system.input_names,
        output_names=system.output_names,
    )
    return BalancedReduction(system=reduced, hankel=hankel, error_bound=2.0 * float(hankel[order:].sum()))


def _root(gramian: NDArray[np.floating]) -> Floats:
    """Return L with L L' = gramian; eigenvalues made negative by rounding are set to zero."""
    values, vectors = np.linalg.eigh((gramian + gramian.T) / 2.0)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
