"""Fewer coordinates: a building of its lowest modes, a linear system of its largest Hankel singular values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov, svd

from mrwork.buildings.matrices import Building, modes_of
from mrwork.buildings.state_space import LinearSystem
from mrwork.errors import SettingError

Floats = NDArray[np.float64]

# The Gramians are exact to rounding, their square roots to its root: smaller singular values are noise.
_NOISE: Final = 1e-8


def modal_truncation(building: Building, *, n_modes: int) -> Building:
    """Return the building in the coordinates of its lowest modes.

    With `q = modes y` over those kept and modes' M modes = I, the mass is I, the stiffness omega^2, the damping
    modes' C modes, coupling among the modes included, and the influence `modes' M r`. Floors and storeys are what they
    were; what the modes that are left out add to them is lost, statically too.

    Raises
    ------
    SettingError
        Where there are not that many modes.
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
        source=f"{building.source}; reduced to {n_modes} modes".removeprefix("; "),
        status="ours",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BalancedReduction:
    """A reduced system, all Hankel singular values of the full one, shape (n,), and what the difference can be.

    `error_bound` holds for the largest singular value of the difference of frequency responses, at any frequency.
    """

    system: LinearSystem
    hankel: Floats
    error_bound: float


def balanced_truncation(system: LinearSystem, *, order: int) -> BalancedReduction:
    """Reduce a stable system to the states that are reached and seen best.

    Square-root method (Tombs, Postlethwaite, Int. J. Control 46, 1987, 1319-1330); the error is at most twice the sum
    of the Hankel singular values left out (Glover, Int. J. Control 39, 1984, 1115-1193).

    Raises
    ------
    SettingError
        Where the system is not stable, or has fewer states of that kind than are asked for.
    """
    slowest = float(system.poles.real.max())
    if slowest >= 0.0:
        raise SettingError(
            f"balanced truncation: a pole of the system has the real part {slowest:g} 1/s; it must be stable, so give "
            "each mode some damping"
        )
    reached = _root(solve_continuous_lyapunov(system.A, -system.B @ system.B.T))
    seen = _root(solve_continuous_lyapunov(system.A.T, -system.C.T @ system.C))
    left, hankel, right = svd(seen.T @ reached)
    n_clear = int((hankel > _NOISE * hankel[0]).sum())
    if not 1 <= order <= n_clear:
        raise SettingError(
            f"balanced truncation: order {order} was asked for; {n_clear} of {system.n_states} states are clear of "
            f"rounding, give a number from 1 to {n_clear}"
        )
    scale = 1.0 / np.sqrt(hankel[:order])
    into = scale[:, None] * (left[:, :order].T @ seen.T)
    out = (reached @ right[:order].T) * scale
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
    """Return L with L L' = gramian, which rounding may have left a little indefinite."""
    values, vectors = np.linalg.eigh((gramian + gramian.T) / 2.0)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
