"""The semidefinite program of a weight design, whose variables are the multipliers of limits and budgets.

The one module that imports cvxpy, which takes a second to load: others import it within a function.
"""

from __future__ import annotations

import warnings

import cvxpy as cp
import numpy as np

from mrwork.base.values import Floats
from mrwork.control.weights.regulator import SquaredRows, first_multipliers, regulate
from mrwork.control.weights.system import DesignSystem

_PROCESS_NOISE = 3e-4
# Tolerances of Clarabel that are tried in turn. The mean squares of the regulator are as exact as their root.
_TOLERANCES = (1e-12, 1e-8)


class WeightProgram:
    """Maximise `tr(P noise) - cost w` over P and multipliers w >= 0 with `total w = 1`.

    `[[A'P + P A, P B], [B'P, 0]] + sum_a weight_a [c_a d_a]'[c_a d_a] >= 0` holds at the Riccati matrix of the weights
    and below it (S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control
    Theory, 1994, ch. 7 and 10, in dual form). Clarabel succeeds only with forces over their budgets and states such
    that the Riccati matrix of equal weights has a unit diagonal. To the ground a small white noise is added on every
    state, of 3e-4 of its rms within one natural period, without which P is not unique. `cost`, `total` and the damping
    of semi-active conditions are parameters, so that all programs of a design are compiled once.
    """

    def __init__(self, system: DesignSystem, rows: SquaredRows) -> None:
        first = regulate(system, rows, first_multipliers(system, rows))
        units = np.diag(first.riccati) ** -0.5
        scaled = system.in_units(units)
        noise = scaled.ground + np.diag(_PROCESS_NOISE**2 * system.frequency * np.diag(scaled.uncontrolled))
        n, m = system.B.shape
        n_multipliers = len(rows.plain.T)
        self._multipliers = cp.Variable(n_multipliers, nonneg=True)
        self._cost, self._total = cp.Parameter(n_multipliers), cp.Parameter(n_multipliers)
        self._damping, self._square = cp.Parameter(m, nonneg=True), cp.Parameter(m, nonneg=True)
        conditions = self._multipliers[n_multipliers - m :]
        weights = rows.weights(
            self._multipliers, cp.multiply(self._damping, conditions), cp.multiply(self._square, conditions)
        )
        P = cp.Variable((n, n), symmetric=True)
        budgets = 1.0 / np.diag(rows.D[rows.budgets])
        forward, beside = scaled.A.T @ P, P @ (scaled.B * budgets)
        both = np.hstack([rows.C * units, rows.D * budgets])
        form = cp.bmat([[forward + forward.T, beside], [beside.T, np.zeros((m, m))]])
        form = form + both.T @ cp.diag(weights) @ both
        self._problem = cp.Problem(
            cp.Maximize(cp.trace(noise @ P) - self._cost @ self._multipliers),
            [self._total @ self._multipliers == 1.0, 0.5 * (form + form.T) >> 0],
        )

    def solve(self, cost: Floats, total: Floats, damping: Floats) -> Floats | None:
        """The multipliers; `None` where the program has no bound or Clarabel fails.

        What Clarabel says of its accuracy does not count: Riccati and Lyapunov equations judge the multipliers.
        """
        self._cost.value, self._total.value = cost, total
        self._damping.value, self._square.value = damping, damping**2
        for tolerance in _TOLERANCES:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self._problem.solve(
                        solver=cp.CLARABEL,
                        tol_gap_abs=tolerance,
                        tol_gap_rel=tolerance,
                        tol_feas=max(tolerance, 1e-10),
                        tol_ktratio=1e-8,
                    )
            except cp.SolverError:
                continue
            if self._problem.status in ("unbounded", "unbounded_inaccurate"):
                return None
            if self._problem.status in ("optimal", "optimal_inaccurate"):
                multipliers = np.maximum(np.asarray(self._multipliers.value, dtype=np.float64), 0.0)
                return np.asarray(multipliers / (total @ multipliers))
        return None
