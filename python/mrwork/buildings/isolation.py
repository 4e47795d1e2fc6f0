"""Base isolation: a slab on isolators under the building."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError


def with_base_isolation(building: Building, *, mass: float, stiffness: float, damping: float) -> Building:
    """Return the building on a base slab that isolators hold to the ground.

    The slab is a new first coordinate, its displacement u relative to the ground; the building stands on it, so what
    was q is now `q - r u`. The slab is the lowest floor, the isolators are the lowest storey, "isolation".

    Parameters
    ----------
    mass
        Of the slab [kg].
    stiffness, damping
        Of all isolators together [N/m], [N s/m].

    Raises
    ------
    SettingError
        Where mass or stiffness is not positive, or damping is negative.
    """
    for title, value in (("mass", mass), ("stiffness", stiffness)):
        if not (np.isfinite(value) and value > 0.0):
            raise SettingError(
                f"base isolation of {building.name}: the {title} is {value:g}; give a number above zero"
            )
    if not (np.isfinite(damping) and damping >= 0.0):
        raise SettingError(
            f"base isolation of {building.name}: the damping is {damping:g}; give a number from zero"
        )
    # Relative to the slab, q - r u.
    relative = np.hstack([-building.influence[:, None], np.eye(building.n_coordinates)])
    slab = np.concatenate([[1.0], np.zeros(building.n_coordinates)])
    held = np.outer(slab, slab)
    return replace(
        building,
        name=f"{building.name}, isolated",
        mass=block_diag(np.array([[mass]]), building.mass),
        damping=relative.T @ building.damping @ relative + damping * held,
        stiffness=relative.T @ building.stiffness @ relative + stiffness * held,
        influence=np.concatenate([[1.0], building.influence]),
        floors=np.vstack([slab, building.floors @ relative + slab]),
        storeys=np.vstack([slab, building.storeys @ relative]),
        floor_names=("base", *building.floor_names),
        storey_names=("isolation", *building.storey_names),
        source=f"{building.source}; base isolation added".removeprefix("; "),
        status="ours",
    )


def with_base_isolation_of_period(
    building: Building, *, mass: float, period: float, ratio: float
) -> Building:
    """Return the building on a base slab, the isolators given by period and damping ratio.

    With all mass m on the isolators moving as one, `stiffness = m (2 pi / period)^2` and
    `damping = 2 ratio m (2 pi / period)` (Naeim, Kelly, Design of Seismic Isolated Structures, 1999).

    Parameters
    ----------
    mass
        Of the slab [kg].
    period
        Of the rigid building on its isolators [s].
    ratio
        Damping over critical damping of that motion.

    Raises
    ------
    SettingError
        Where mass or period is not positive, or the ratio is negative.
    """
    if not (np.isfinite(period) and period > 0.0):
        raise SettingError(
            f"base isolation of {building.name}: the period is {period:g} s; give a number above zero"
        )
    omega = 2.0 * np.pi / period
    total = building.total_mass + mass
    return with_base_isolation(
        building, mass=mass, stiffness=total * omega**2, damping=2.0 * ratio * total * omega
    )
