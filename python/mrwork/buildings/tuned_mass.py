"""Tuned mass damper: a mass on a floor, tuned to a mode of the building."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import sqrt
from types import MappingProxyType
from typing import Final

import numpy as np

from mrwork.arguments import checked
from mrwork.buildings.additions import check_not_negative, check_positive, mode_at_floor, with_coordinate
from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError, UnknownNameError
from mrwork.keys import SMALLEST


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """Ratio of the frequency of the tuned mass to that of the mode, and damping ratio of the tuned mass."""

    frequency_ratio: float
    damping_ratio: float


def den_hartog(mass_ratio: float, _: float) -> Tuning:
    """Tuning for the least peak displacement of an undamped structure under a harmonic force.

    `1 / (1 + mu)` and `sqrt(3 mu / (8 (1 + mu)))` (Den Hartog, Mechanical Vibrations, 1956, ch. 3).
    """
    mu = mass_ratio
    return Tuning(frequency_ratio=1.0 / (1.0 + mu), damping_ratio=sqrt(3.0 * mu / (8.0 * (1.0 + mu))))


def warburton(mass_ratio: float, _: float) -> Tuning:
    """Tuning for the least rms displacement of an undamped structure under white ground acceleration.

    `sqrt(1 - mu / 2) / (1 + mu)` and `sqrt(mu (1 - mu / 4) / (4 (1 + mu) (1 - mu / 2)))` (Warburton, Earthquake Eng.
    Struct. Dyn. 10, 1982, 381-401).
    """
    mu = mass_ratio
    return Tuning(
        frequency_ratio=sqrt(1.0 - mu / 2.0) / (1.0 + mu),
        damping_ratio=sqrt(mu * (1.0 - mu / 4.0) / (4.0 * (1.0 + mu) * (1.0 - mu / 2.0))),
    )


def sadek(mass_ratio: float, damping_ratio: float) -> Tuning:
    """Tuning for equal damping in both modes of structure and tuned mass.

    `(1 - beta sqrt(mu / (1 + mu))) / (1 + mu)` and `beta / (1 + mu) + sqrt(mu / (1 + mu))`, where beta is the
    damping ratio of the mode (Sadek, Mohraz, Taylor, Chung, Earthquake Eng. Struct. Dyn. 26, 1997, 617-635).
    """
    mu, beta = mass_ratio, damping_ratio
    share = sqrt(mu / (1.0 + mu))
    return Tuning(frequency_ratio=(1.0 - beta * share) / (1.0 + mu), damping_ratio=beta / (1.0 + mu) + share)


TUNINGS: Final[Mapping[str, Callable[[float, float], Tuning]]] = MappingProxyType(
    {"den_hartog": den_hartog, "warburton": warburton, "sadek": sadek}
)


@checked
def with_tuned_mass(
    building: Building,
    *,
    floor: int | str,
    mass: float,
    frequency: float,
    ratio: float,
    name: str = "tuned mass",
) -> Building:
    """Return the building with a mass on a floor, attached by a spring and a dashpot.

    Its displacement relative to the ground is a new coordinate but not a floor; its stroke is appended to the storeys
    under the name `name`.

    Parameters
    ----------
    floor
        Number from 1, or name.
    mass
        Mass [kg].
    frequency, ratio
        Frequency [Hz] and damping ratio of the mass on its spring, with the floor fixed.

    Raises
    ------
    SettingError
        If the mass or the frequency is not positive, or the ratio is negative.
    UnknownNameError
        If there is no such floor.
    """
    row = building.floor_row(floor)
    check_positive(mass, f"{name} on {building.name}: the mass is {mass:g}")
    check_positive(frequency, f"{name} on {building.name}: the frequency is {frequency:g}")
    check_not_negative(ratio, f"{name} on {building.name}: the damping ratio is {ratio:g}")
    omega = 2.0 * np.pi * frequency
    stroke = np.append(-row, 1.0)
    tuned = with_coordinate(
        building,
        mass=mass,
        damping=2.0 * ratio * mass * omega,
        stiffness=mass * omega**2,
        across=stroke,
        follows_ground=float(row @ building.influence),
        stroke=stroke,
        stroke_name=name,
    )
    return replace(
        tuned,
        name=f"{building.name}, {name}",
        source=f"{building.source}; {name} of {mass:g} kg, {frequency:g} Hz, {ratio:g} added".removeprefix(
            "; "
        ),
    )


@checked
def with_optimal_tuned_mass(
    building: Building,
    *,
    floor: int | str,
    mass_ratio: float,
    tuning: str = "warburton",
    mode: int = 1,
    name: str = "tuned mass",
) -> Building:
    """Return the building with a mass on a floor, tuned to a mode by a published optimum.

    The optima are derived for a single mass; the effective mass of a mode at a floor where its shape has the entry p is
    `1 / p^2`, with phi' M phi = 1.

    Parameters
    ----------
    floor
        Number from 1, or name.
    mass_ratio
        Ratio of the tuned mass to the mass of the building.
    tuning
        "warburton", for ground motion, "den_hartog" or "sadek".
    mode
        Number of the mode, from 1.

    Raises
    ------
    SettingError
        If the mass ratio is not positive, there is no such mode, the mode does not move the floor, or the tuned mass
        is at least twice the effective mass of the mode.
    UnknownNameError
        If there is no such floor or tuning.
    """
    if tuning not in TUNINGS:
        raise UnknownNameError(f"there is no tuning {tuning!r}; choose one of {', '.join(TUNINGS)}")
    if not (np.isfinite(mass_ratio) and mass_ratio >= SMALLEST):
        raise SettingError(
            f"{name} on {building.name}: the mass ratio is {mass_ratio:g}; give a number such as 0.02"
        )
    tuned = mode_at_floor(building, floor, mode, name)
    mass = mass_ratio * building.total_mass
    modal_ratio = mass * tuned.entry**2
    if not modal_ratio < 2.0:
        raise SettingError(
            f"{name} on {building.name}: its mass is {modal_ratio:.3g} times that of mode {mode} at this floor; "
            "the optima hold for small ratios, give a smaller mass"
        )
    optimum = TUNINGS[tuning](modal_ratio, tuned.ratio)
    return with_tuned_mass(
        building,
        floor=floor,
        mass=mass,
        frequency=optimum.frequency_ratio * tuned.omega / (2.0 * np.pi),
        ratio=optimum.damping_ratio,
        name=name,
    )
