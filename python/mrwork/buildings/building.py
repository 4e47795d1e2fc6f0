"""A building in the plane: matrices of its coordinates, and how floors and storeys follow from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Building:
    """`M q'' + C q' + K q = -sum_d e_d' f_d - M r a_g`, with q relative to the ground.

    Parameters
    ----------
    mass, damping, stiffness
        M [kg], C [N s/m], K [N/m], shape (n, n).
    influence
        r, how the coordinates follow the ground when all moves as one, shape (n,): ones for floor displacements.
    floors
        Displacement of each floor relative to the ground = floors @ q, shape (n_floors, n), lowest first; its
        absolute acceleration = floors @ q'' + a_g.
    storeys
        Drift of each storey = storeys @ q, shape (n_storeys, n), lowest first. A device across a storey is
        elongated by its drift, and pulls the coordinates back by its row times the force.
    floor_names, storey_names
        What reports call them.
    source, status
        Where the numbers come from: "verified", "published" or "ours".
    """

    name: str
    mass: Floats
    damping: Floats
    stiffness: Floats
    influence: Floats
    floors: Floats
    storeys: Floats
    floor_names: tuple[str, ...]
    storey_names: tuple[str, ...]
    source: str = ""
    status: str = "ours"
