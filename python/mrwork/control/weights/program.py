"""The dual of the worst-ratio design as a semidefinite program; the one module that imports cvxpy."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import cvxpy as cp
import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.control.weights.riccati_dual import SquaredRows, first_multipliers, regulate
from mrwork.control.weights.system import DesignSystem

MOST_STATES = 26
"""States up to which Clarabel solves the program to four digits, that is about twelve storeys."""


@array_dataclass()
class ProgramSolution:
    """Multipliers with sum q = 1, with limits and budgets scaled to 1, and the least t^2."""

    multipliers: Floats
    value: float


class DualProgram:
    """Maximise the mean of tr(P noise) minus `budgets^2 r` over P of each system and shared multipliers.

    `[[A'P + P A + h A'P A, P B + h A'P B], [B'P + h B'P A, h B'P B]] + sum_a w_a [c_a d_a]'[c_a d_a] >= 0` holds at the
    Riccati matrix of the weights w and below it, h being the step of a sampled system (S. Boyd, L. El Ghaoui, E. Feron,
    V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory, 1994, ch. 7 and 10, in dual form). Limits
    and budgets are parameters, so that another solution needs no compilation. Clarabel succeeds only with a scaled
    problem: limits are scaled to those that are just met without control, and states such that the Riccati matrix of
    equal weights has a unit diagonal. `rows_of` makes the rows for limits and budgets whose parameters are 1.
    """

    def __init__(
        self,
        systems: Sequence[DesignSystem],
        rows_of: Callable[[DesignSystem, Floats, Floats], SquaredRows],
        budgets: Floats,
    ) -> None:
        self._without_control = np.max([system.rms_without_control() for system in systems], axis=0)
        # Forces among the outputs are zero without control.
        self._limits = np.where(self._without_control > 0.0, self._without_control, budgets.max())
        self._budgets = budgets
        n_limits, n_devices = len(self._limits), len(budgets)
        rows = [rows_of(system, self._limits, budgets) for system in systems]
        first = first_multipliers(systems, rows, n_limits)
        systems = [
            system.in_units(np.diag(regulate(system, each, first).riccati) ** -0.5)
            for system, each in zip(systems, rows, strict=True)
        ]
        rows = [rows_of(system, self._limits, budgets) for system in systems]
        n_forms = len(rows[0].forms)
        self._of_limits = cp.Parameter(n_limits, pos=True, value=np.ones(n_limits))
        self._of_budgets = cp.Parameter(n_devices, pos=True, value=np.ones(n_devices))
        self._multipliers = cp.Variable(n_forms, nonneg=True)
        weighted = cp.hstack(
            [cp.multiply(self._of_limits, self._multipliers[:n_limits]), self._multipliers[n_limits:]]
        )
        cost = -self._of_budgets @ self._multipliers[n_limits : n_limits + n_devices]
        constraints = [cp.sum(self._multipliers[:n_limits]) == 1.0]
        for system, each in zip(systems, rows, strict=True):
            A, B, h = system.A, system.B, system.step
            P = cp.Variable(A.shape, symmetric=True)
            forward = A.T @ P
            form = cp.bmat(
                [
                    [forward + forward.T + h * forward @ A, P @ B + h * forward @ B],
                    [(P @ B + h * forward @ B).T, h * B.T @ P @ B],
                ]
            )
            own = np.hstack([each.C, each.D])
            form = form + own.T @ cp.diag(each.forms.T @ weighted) @ own
            constraints.append(0.5 * (form + form.T) >> 0)
            cost = cost + cp.trace(system.noise @ P) / len(systems)
        self._problem = cp.Problem(cp.Maximize(cost), constraints)

    def solve(self, limits: Floats, budgets: Floats) -> ProgramSolution | None:
        """The solution for these limits and budgets; `None` where the solver fails."""
        level = float(np.max(self._without_control / limits))
        self._of_limits.value = (level * limits / self._limits) ** -2
        self._of_budgets.value = (budgets / self._budgets) ** 2
        solution = _solution(self._problem, self._multipliers)
        if solution is None:
            return None
        multipliers = np.maximum(solution, 0.0)
        # Those of the budgets, and of the semi-active conditions, in the scale of limits and budgets of 1.
        rest = multipliers[len(limits) :].reshape(-1, len(budgets))
        multipliers[len(limits) :] = (rest * (level * budgets / self._budgets) ** 2).ravel()
        return ProgramSolution(multipliers=multipliers, value=level**2 * float(self._problem.value))


def nearest_riccati(A: Floats, B: Floats, gain: Floats, root: Floats, at: Floats) -> Floats | None:
    """P >= 0 with the least `|(B'P - gain) root|` and `at'B'P + P B at - at'at - A'P - P A >= 0`; `None` if it fails.

    The condition is the tangent at the gain `at` of `P B B'P - A'P - P A >= 0`, and implies it.
    """
    P = cp.Variable(A.shape, PSD=True)
    cross = P @ (B @ at - A)
    problem = cp.Problem(
        cp.Minimize(cp.norm((B.T @ P - gain) @ root, "fro")), [cross + cross.T - at.T @ at >> 0]
    )
    return _solution(problem, P)


def _solution(problem: cp.Problem, variable: cp.Variable) -> Floats | None:
    """The value of a variable where the problem is solved by Clarabel; `None` where the solver fails."""
    try:
        with warnings.catch_warnings():
            # The accuracy is judged by Riccati and Lyapunov equations, whatever the solver says of itself.
            warnings.simplefilter("ignore")
            problem.solve(solver=cp.CLARABEL)
    except cp.SolverError:
        return None
    if problem.status not in ("optimal", "optimal_inaccurate") or variable.value is None:
        return None
    return np.asarray(variable.value, dtype=np.float64)
