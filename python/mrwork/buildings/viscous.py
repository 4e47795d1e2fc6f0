"""Linear viscous dampers across a storey."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

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
