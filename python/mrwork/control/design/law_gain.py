"""The gain of a law, which knows the state of the building but not that of the soil, the driver or past commands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.control.design.lyapunov_equations import LyapunovEquations
from mrwork.control.design.riccati_dual import Regulated, Rows
from mrwork.control.design.system import DesignSystem
from mrwork.errors import SettingError

Floats = NDArray[np.float64]

_STEPS = 200
SENSOR_NOISE = 0.05
"""Noise of each state that a sampled law knows, over its rms without control; keeps the gain from differences of states
that the model alone tells apart."""


def riccati_law_gain(system: DesignSystem, found: Regulated) -> Floats:
    """Gain on the state s of the building of a design in continuous time, shape (n_devices, 2n).

    It is the block of s, which is the Riccati gain of the building alone, for the soil is not controlled.
    """
    n = len(system.state)
    return np.asarray(np.linalg.solve(system.state[:, :n].T, found.gain[:, :n].T).T)


def static_law_gain(system: DesignSystem, rows: Rows, multipliers: Floats, start: Floats) -> Floats:
    """Gain on s of least cost in a sampled loop with driver and delay, shape (n_devices, 2n); a local minimum.

    The gradient is that of static output feedback (W. S. Levine and M. Athans, IEEE Trans. Automatic Control 15(1),
    1970, 44-48).

    Parameters
    ----------
    start
        Gain to start from; halved until the loop is stable.
    """
    from scipy.optimize import minimize  # takes a quarter of a second to load

    weights = multipliers @ rows.forms
    spread = SENSOR_NOISE**2 * np.einsum("ij,jk,ik->i", system.state, system.uncontrolled, system.state)
    for _ in range(60):
        at_start = _cost(system, rows, weights, start, spread)[0]
        if np.isfinite(at_start):
            break
        start = 0.5 * start
    # Gains are measured by the force that the noise causes, that of the start being 1.
    unit, shape = np.sqrt(spread), start.shape
    unit = unit / np.linalg.norm(start * unit)

    def cost_of(flat: Floats) -> tuple[float, Floats]:
        cost, slope = _cost(system, rows, weights, flat.reshape(shape) / unit, spread)
        return cost / at_start, (slope / unit).ravel() / at_start

    found = minimize(
        cost_of,
        (start * unit).ravel(),
        jac=True,
        method="BFGS",
        options={"maxiter": _STEPS, "gtol": 1e-8},
    )
    return np.asarray(found.x.reshape(shape) / unit)


def _cost(
    system: DesignSystem, rows: Rows, weights: Floats, gain: Floats, spread: Floats
) -> tuple[float, Floats]:
    """Cost of `u = -gain (s + noise)` and its gradient; infinite if the loop is not stable."""
    K = gain @ system.state
    closed = system.A - system.B @ K
    try:
        equations = LyapunovEquations(closed, system.step)
    except SettingError:
        return float("inf"), np.zeros_like(gain)
    pushed = (gain * spread) @ gain.T
    X = equations.covariance(system.noise + system.step * system.B @ pushed @ system.B.T)
    own = rows.C - rows.D @ K
    P = equations.cost((own.T * weights) @ own)
    R = (rows.D.T * weights) @ rows.D + system.step * system.B.T @ P @ system.B
    forward = np.eye(len(closed)) + system.step * closed
    slope = R @ gain * spread - (system.B.T @ P @ forward + (rows.D.T * weights) @ own) @ X @ system.state.T
    return float(np.sum(system.noise * P) + np.sum(R * pushed)), 2.0 * slope
