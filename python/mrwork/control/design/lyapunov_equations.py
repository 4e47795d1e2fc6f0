"""Lyapunov equations of one closed loop, factorised once and solved for many right-hand sides.

A loop is `x' = A x` if `step` is zero, and `x_{k+1} = (1 + step A) x_k` otherwise (A is then the difference quotient of
the transition), so that formulas of continuous and sampled systems agree as the step goes to zero.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from mrwork.errors import SettingError

Floats = NDArray[np.float64]


class LyapunovEquations:
    """`A X + X A' + step A X A' + Q = 0` and its adjoint, by the real Schur form of A.

    A sampled loop is first transformed to a continuous one (Cayley): Bartels and Stewart, Comm. ACM 15(9), 1972.
    """

    def __init__(self, A: Floats, step: float = 0.0) -> None:
        size = len(A)
        # (2 + step A)^-1, by which a sampled equation becomes that of A (1 + step A / 2)^-1.
        self._half = np.linalg.inv(np.eye(size) + 0.5 * step * A)
        self._schur, self._basis = scipy.linalg.schur(A @ self._half)
        self.slowest = float(np.linalg.eigvals(self._schur).real.max())
        if not self.slowest < 0.0:
            raise SettingError(
                f"a loop with a pole at {self.slowest:.3g} 1/s is not stable, so its rms values do not exist"
            )

    def covariance(self, Q: Floats) -> Floats:
        """X of `A X + X A' + step A X A' + Q = 0`."""
        return self._solved(self._half @ Q @ self._half.T, adjoint=False)

    def cost(self, Q: Floats) -> Floats:
        """P of `A'P + P A + step A'P A + Q = 0`."""
        return self._solved(self._half.T @ Q @ self._half, adjoint=True)

    def _solved(self, Q: Floats, *, adjoint: bool) -> Floats:
        right = -self._basis.T @ Q @ self._basis
        forms = ("T", "N") if adjoint else ("N", "T")
        found, scale, _ = scipy.linalg.lapack.dtrsyl(self._schur, self._schur, right, *forms)
        X = self._basis @ found @ self._basis.T / scale
        return np.asarray(0.5 * (X + X.T), dtype=np.float64)
