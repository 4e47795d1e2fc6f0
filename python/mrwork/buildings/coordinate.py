"""One coordinate more: a mass on a spring and a dashpot, put into a building."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.matrices import Building

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
