"""Additions to a building: viscous dampers, braces, base isolation, or any further mass on a spring and a dashpot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError


def with_viscous_damper(building: Building, *, storey: int | str, damping: float) -> Building:
    """Return the building with a damper `f = damping * drift rate` across a storey: C grows by `damping e'e`.

    Parameters
    ----------
    storey
        By number from 1 or by name.
    damping
        Of all dampers there together [N s/m].

    Raises
    ------
    SettingError
        Where damping is negative.
    UnknownNameError
        Where there is no such storey.
    """
    row = building.storey_row(storey)
    name = building.storey_name(storey)
    if not (np.isfinite(damping) and damping >= 0.0):
        raise SettingError(
            f"viscous damper in {name}: the damping is {damping:g} N s/m; give a number from zero"
        )
    return replace(
        building,
        name=f"{building.name}, viscous damper in {name}",
        damping=building.damping + damping * np.outer(row, row),
        source=f"{building.source}; viscous damper of {damping:g} N s/m in {name} added".removeprefix("; "),
        status="ours",
    )


Floats = NDArray[np.float64]


def with_coordinate(
    building: Building,
    *,
    mass: float,
    damping: float,
    stiffness: float,
    across: Floats,
    follows_ground: float,
    stroke: Floats,
    stroke_name: str,
) -> Building:
    """Return the building with a coordinate that is no floor, appended as the last.

    Parameters
    ----------
    mass
        Of the coordinate itself [kg].
    damping, stiffness
        Between what `across` says [N s/m], [N/m].
    across
        Elongation of that spring = across @ q, shape (n + 1,).
    follows_ground
        Entry of the influence: 1 for a displacement relative to the ground, 0 for a deformation.
    stroke, stroke_name
        Row that is appended to the storeys, shape (n + 1,), and its name.
    """
    n = building.n_coordinates
    spring = np.outer(across, across)
    wider = np.zeros((n + 1, n + 1))
    bare_mass, bare_damping, bare_stiffness = wider.copy(), wider.copy(), wider.copy()
    bare_mass[:n, :n] = building.mass
    bare_mass[n, n] = mass
    bare_damping[:n, :n] = building.damping
    bare_stiffness[:n, :n] = building.stiffness
    return replace(
        building,
        mass=bare_mass,
        damping=bare_damping + damping * spring,
        stiffness=bare_stiffness + stiffness * spring,
        influence=np.append(building.influence, follows_ground),
        floors=np.pad(building.floors, ((0, 0), (0, 1))),
        storeys=np.vstack([np.pad(building.storeys, ((0, 0), (0, 1))), stroke]),
        storey_names=(*building.storey_names, stroke_name),
        status="ours",
        n_strokes=building.n_strokes + 1,
    )


def with_brace(
    building: Building,
    *,
    storey: int | str,
    stiffness: float,
    mass: float,
    damping: float = 0.0,
    name: str = "",
) -> Building:
    """Return the building with a brace to which a damper can be attached.

    The brace's deformation d is a new coordinate, `m d'' + c d' + k d = f`, and the damper takes what is left of the
    drift, `e q - d`. That row is the last of the storeys, "damper in storey 1" for one in storey 1, and a stroke.

    A brace without mass would leave d to an algebraic equation, `c d' + k d = f`, which is the limit of small `mass`.
    It moves with the deformation alone, so the building weighs the same. Where the damper is viscous with c0, d settles
    at the rate `(c + c0) / m`, and rings at `sqrt(k / m)`; a mass of which both are quick beside the building and slow
    beside the simulation's step does no harm. One part in a thousand of a floor mostly serves.

    Parameters
    ----------
    storey
        By number from 1 or by name.
    stiffness, damping
        Of the brace along the drift [N/m], [N s/m].
    mass
        That moves with its deformation [kg].
    name
        Of the new row; by default "damper in" and the storey.

    Raises
    ------
    SettingError
        Where stiffness or mass is not positive, or damping is negative.
    UnknownNameError
        Where there is no such storey.
    """
    row = building.storey_row(storey)
    where = building.storey_name(storey)
    if not (np.isfinite(stiffness) and stiffness > 0.0):
        raise SettingError(f"brace in {where}: the stiffness is {stiffness:g} N/m; give a number above zero")
    if not (np.isfinite(mass) and mass > 0.0):
        raise SettingError(
            f"brace in {where}: the mass is {mass:g} kg; give a number above zero, such as a thousandth of a floor"
        )
    if not (np.isfinite(damping) and damping >= 0.0):
        raise SettingError(f"brace in {where}: the damping is {damping:g} N s/m; give a number from zero")
    end = np.append(np.zeros(building.n_coordinates), 1.0)
    braced = with_coordinate(
        building,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        across=end,
        follows_ground=0.0,
        stroke=np.append(row, -1.0),
        stroke_name=name or f"damper in {where}",
    )
    return replace(
        braced,
        name=f"{building.name}, brace in {where}",
        source=f"{building.source}; brace of {stiffness:g} N/m in {where} added".removeprefix("; "),
    )


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
