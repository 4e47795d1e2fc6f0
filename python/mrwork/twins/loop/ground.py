"""Acceleration of the ground where a Runge-Kutta step wants it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def half_steps(acceleration: Floats, dt: float, step: float, n_steps: int) -> Floats:
    """Acceleration of the ground every half step: straight between samples, zero after the last.

    Parameters
    ----------
    acceleration
        Record [m/s^2], shape (n_time,), every `dt` [s].
    step
        Integration step [s].

    Returns
    -------
    Floats
        Shape (2 n_steps + 1,) [m/s^2].
    """
    # In samples, so that a step that divides the sampling meets every sample exactly.
    places = np.arange(2 * n_steps + 1) * (0.5 * step / dt)
    places = np.where(np.abs(places - np.rint(places)) < 1e-9, np.rint(places), places)
    ground: Floats = np.interp(places, np.arange(acceleration.size), acceleration, right=0.0)
    return ground
