"""A damper behind a brace: the two share the drift of a storey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrwork.buildings.coordinate import with_coordinate
from mrwork.buildings.matrices import Building
from mrwork.errors import SettingError


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
