"""Riccati equations of sampled loops with a driver and a chain of past commands.

The compiled solver judges a solution by the residual in units in which it is the identity, which the tiny costs of
past commands do not meet; the gain of such a loop is exact to many digits all the same, and the design checks its rms
values by Lyapunov equations. So this equation is solved here, by doubling alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError

Floats = NDArray[np.float64]

SMALLER_BUDGET = (
    "where the budget is more force than the limits have use for, force costs nothing and the gain is not determined: "
    "give a smaller one"
)
"""What to do where an equation of a design has no solution in double precision."""

_DOUBLINGS = 60
_LARGEST_NORM = 1e60


def sampled_gain(A: Floats, B: Floats, Q: Floats, R: Floats, N: Floats, step: float) -> tuple[Floats, Floats]:
    """Gain and P of `P = F'P F - (F'P E + h N) (h R + E'P E)^-1 (E'P F + h N') + h Q`, F = 1 + h A, E = h B.

    By structure-preserving doubling (Chu, Fan, Lin & Wang, Int. J. Control 77(8), 2004, 767-788).
    """
    one = np.eye(len(A))
    forward, entry = one + step * A, step * B
    of_N, of_B = np.linalg.solve(R, N.T), np.linalg.solve(R, entry.T)
    F, G = forward - entry @ of_N, _symmetric(entry @ of_B / step)
    H = _symmetric(step * (Q - N @ of_N))
    for _ in range(_DOUBLINGS):
        W = one + G @ H
        try:
            right, left = np.linalg.solve(W, F), np.linalg.solve(W.T, F.T).T
        except np.linalg.LinAlgError:
            break
        added = F.T @ H @ right
        F, G, H = F @ right, _symmetric(G + left @ G @ F.T), _symmetric(H + added)
        # A mode that is not stabilised grows quadratically.
        if not max(np.linalg.norm(F), np.linalg.norm(H)) < _LARGEST_NORM:
            break
        if np.linalg.norm(added) <= 1e-15 * np.linalg.norm(H):
            gain = np.linalg.solve(R + step * B.T @ H @ B, B.T @ H @ forward + N.T)
            return np.asarray(gain, dtype=np.float64), H
    raise SettingError(
        f"the Riccati equation of the sampled loop has no stabilising solution; {SMALLER_BUDGET}"
    )


def _symmetric(matrix: Floats) -> Floats:
    return np.asarray(0.5 * (matrix + matrix.T), dtype=np.float64)
