"""Damping from ratios: Rayleigh damping, C = a0 M + a1 K, and modal damping. Each replaces C."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrwork.buildings.matrices import Building, modes_of
from mrwork.errors import SettingError


def with_rayleigh_coefficients(building: Building, *, a0: float, a1: float) -> Building:
    """Return the building with Rayleigh damping, C = a0 M + a1 K, with a0 [1/s] and a1 [s].

    Raises
    ------
    SettingError
        If a mode would have negative damping.
    """
    omega, _ = modes_of(building.mass, building.stiffness)
    driven = np.flatnonzero(a0 + a1 * omega**2 < 0.0)
    if driven.size:
        raise SettingError(
            f"building {building.name}: Rayleigh damping with a0 = {a0:g} 1/s and a1 = {a1:g} s drives mode "
            f"{driven[0] + 1} instead of damping it; choose other ratios or modes"
        )
    return replace(building, damping=a0 * building.mass + a1 * building.stiffness)


def with_rayleigh_damping(
    building: Building, *, ratios: tuple[float, float], modes: tuple[int, int] = (1, 2)
) -> Building:
    """Return the building with Rayleigh damping that has given ratios in two modes, numbered from 1.

    a0 and a1 solve `ratio = (a0 / omega + a1 omega) / 2` for both (Chopra, Dynamics of Structures, 11.4.1).

    Raises
    ------
    SettingError
        If the modes are equal, do not exist or have zero frequency, or a mode would have negative damping.
    """
    check_ratios(ratios, building.name)
    omega, _ = modes_of(building.mass, building.stiffness)
    if len(set(modes)) != 2 or not all(1 <= mode <= omega.size for mode in modes):
        raise SettingError(
            f"building {building.name}: Rayleigh damping in modes {modes[0]} and {modes[1]}; "
            f"name two different modes from 1 to {omega.size}"
        )
    low, high = (float(omega[mode - 1]) for mode in modes)
    if min(low, high) <= 0.0 or np.isclose(low, high, rtol=1e-9):
        raise SettingError(
            f"building {building.name}: modes {modes[0]} and {modes[1]} have {low / (2 * np.pi):g} and "
            f"{high / (2 * np.pi):g} Hz; Rayleigh damping wants two different frequencies above zero"
        )
    a0, a1 = np.linalg.solve([[0.5 / low, 0.5 * low], [0.5 / high, 0.5 * high]], ratios)
    return with_rayleigh_coefficients(building, a0=float(a0), a1=float(a1))


def with_modal_damping(building: Building, *, ratios: Sequence[float]) -> Building:
    """Return the building with given modal damping ratios, one for each mode or a single one for all.

    `C = M (sum of 2 ratio omega phi phi') M` over the modes phi, normalised so that phi' M phi = 1.

    Raises
    ------
    SettingError
        If the number of ratios is neither 1 nor n, or a ratio is negative.
    """
    check_ratios(ratios, building.name)
    omega, modes = modes_of(building.mass, building.stiffness)
    if len(ratios) not in (1, omega.size):
        raise SettingError(
            f"building {building.name}: {len(ratios)} damping ratios for {omega.size} modes; give one, or one for each"
        )
    spread = 2.0 * np.broadcast_to(np.asarray(ratios, dtype=np.float64), omega.shape) * omega
    moved = building.mass @ modes
    return replace(building, damping=(moved * spread) @ moved.T)


def check_ratios(ratios: Sequence[float], name: str) -> None:
    """Check that damping ratios are finite and not negative."""
    for ratio in ratios:
        if not (np.isfinite(ratio) and ratio >= 0.0):
            raise SettingError(
                f"building {name}: a damping ratio is {ratio:g}; give a number from zero, such as 0.02"
            )
