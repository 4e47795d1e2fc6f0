"""Undamped modes of a building, and the damping that each of them has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Floats = NDArray[np.float64]


def modes_of(mass: Floats, stiffness: Floats) -> tuple[Floats, Floats]:
    """Circular frequencies [rad/s], shape (n,), lowest first, and mode shapes as columns with modes' M modes = I.

    The sign of a shape is that which makes its largest entry positive.
    """
    squares, modes = eigh(stiffness, mass)
    largest = np.take_along_axis(modes, np.abs(modes).argmax(axis=0)[None, :], axis=0)
    # A coordinate that nothing holds has frequency zero, and rounding may leave its square below.
    return np.sqrt(np.maximum(squares, 0.0)), modes * np.where(largest < 0.0, -1.0, 1.0)


def damping_ratios_of(mass: Floats, damping: Floats, stiffness: Floats) -> Floats:
    """Diagonal of modes' C modes over 2 omega, shape (n,); infinite or NaN where a mode has no stiffness."""
    omega, modes = modes_of(mass, stiffness)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.einsum("im,ij,jm->m", modes, damping, modes) / (2.0 * omega))
