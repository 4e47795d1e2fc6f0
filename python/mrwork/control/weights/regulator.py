"""The regulator of given multipliers by one Riccati equation: its gain, mean squares, and a bound on all linear laws.

For multipliers w = (q of the limits, r of the budgets, s of the semi-active conditions), `h(w)` is the least mean of
the squared rows with these weights. Every law that keeps t times the limits, and the budgets, has
`h(w) <= t^2 sum q + sum r`, limits and budgets being 1. So `h(w) - sum r` with `sum q = 1` bounds the least t^2 from
below, and the design maximises it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.riccati import LyapunovEquations, mean_squares, solve_riccati
from mrwork.control.weights.system import DesignSystem
from mrwork.errors import SettingError


@array_dataclass()
class SquaredRows:
    """Rows `c x + d u` of one system whose mean squares a design weighs.

    They are the limited outputs over their limits, `n_limits`, then the desired forces over their budgets, then the
    rows of the semi-active conditions, if there are any. `plain`, shape (n_rows, n_multipliers), `by_damping` and
    `by_square`, shapes (n_rows, n_devices), are the weights of the rows by unit multipliers.
    """

    C: Floats
    D: Floats
    n_limits: int
    plain: Floats
    by_damping: Floats
    by_square: Floats

    @property
    def n_devices(self) -> int:
        """Number of forces, each with a budget."""
        return len(self.D.T)

    @property
    def budgets(self) -> slice:
        """Multipliers of the budgets, and rows of the forces."""
        return slice(self.n_limits, self.n_limits + self.n_devices)

    @property
    def semi_active(self) -> bool:
        """Whether there is a multiplier of the semi-active condition of each device."""
        return len(self.plain.T) > self.n_limits + self.n_devices

    def weights(self, multipliers: Any, by_damping: Any, by_square: Any) -> Any:
        """Weights of the rows: arrays, or expressions of a program.

        `by_damping` and `by_square` are the multipliers of the semi-active conditions times the dampings and their
        squares.
        """
        plain = self.plain @ multipliers
        if not self.semi_active:
            return plain
        return plain + self.by_damping @ by_damping + self.by_square @ by_square


def squared_rows(
    system: DesignSystem, limits: Floats, budgets: Floats, unit: Floats | None = None, share: float = 0.0
) -> SquaredRows:
    """The rows of a system; with semi-active conditions of this `share`, whose dampings are in `unit` [N s/m].

    `(f - c v)^2 - b^2 f^2` is `(1 - b^2 + c) f^2 + (c^2 + c) v^2 - c (f + v)^2`, so that rows do not depend on c.
    """
    n, m = system.B.shape
    n_limits = len(limits)
    C = [system.C / limits[:, None], np.zeros((m, n))]
    D = [system.D / limits[:, None], np.diag(1.0 / budgets)]
    if unit is None:
        return SquaredRows(
            C=np.vstack(C),
            D=np.vstack(D),
            n_limits=n_limits,
            plain=np.eye(n_limits + m),
            by_damping=np.zeros((n_limits + m, m)),
            by_square=np.zeros((n_limits + m, m)),
        )
    rates, one, none = (unit / budgets)[:, None] * system.rates, np.eye(m), np.zeros((m, m))
    above = np.zeros((n_limits, m))
    plain = np.eye(n_limits + 3 * m, n_limits + 2 * m)
    plain[n_limits:, n_limits + m :] = np.vstack([(1.0 - share**2) * one, none, none])
    return SquaredRows(
        C=np.vstack([*C, rates, rates]),
        D=np.vstack([*D, none, D[1]]),
        n_limits=n_limits,
        plain=plain,
        by_damping=np.vstack([above, one, one, -one]),
        by_square=np.vstack([above, none, one, none]),
    )


@array_dataclass()
class Regulated:
    """A system under the regulator of given multipliers: its gain on x, Riccati matrix and covariance of x.

    `squares` are the mean squares of the rows under the ground, by a Lyapunov equation of the gain, and `cost` is h.
    """

    gain: Floats
    riccati: Floats
    covariance: Floats
    squares: Floats
    cost: float


def regulate(
    system: DesignSystem, rows: SquaredRows, multipliers: Floats, damping: Floats | None = None
) -> Regulated:
    """The regulator of the multipliers, by weights of the rows that may be negative."""
    c = np.zeros(rows.n_devices) if damping is None else damping
    s = multipliers[rows.budgets.stop :] if rows.semi_active else c
    weights = rows.weights(multipliers, c * s, c**2 * s)
    Q, N, R = ((a.T * weights) @ b for a, b in ((rows.C, rows.C), (rows.C, rows.D), (rows.D, rows.D)))
    gain, P = solve_riccati(system.A, system.B, Q, R, N, scaling=np.eye(len(system.A)))
    try:
        loop = LyapunovEquations(system.A - system.B @ gain)
    except SettingError as error:
        raise SettingError(
            "the gain of the weights does not stabilise the loop, as where the budget is more force than the limits "
            "have use for; give a smaller one"
        ) from error
    X = loop.covariance(system.ground)
    return Regulated(
        gain=gain,
        riccati=P,
        covariance=X,
        squares=mean_squares(rows.C - rows.D @ gain, X),
        cost=float(np.sum(system.ground * P)),
    )


@array_dataclass()
class DualPoint:
    """Multipliers with `sum q = 1`, the damping of semi-active conditions, and what their regulator shows.

    `ratio` is the largest rms over its limit under the regulator, `bound` the lower bound on it of any linear law
    within the budgets, `gap` the larger of ratio / bound - 1 and of the excess of a force over its budget.
    """

    multipliers: Floats
    damping: Floats
    regulated: Regulated
    ratio: float
    bound: float
    gap: float


def dual_point(
    system: DesignSystem, rows: SquaredRows, multipliers: Floats, damping: Floats, level: float
) -> DualPoint:
    """A point of the dual, of rows that have `level` times the limits."""
    at = regulate(system, rows, multipliers, damping)
    ratio = level * float(np.sqrt(at.squares[: rows.n_limits].max()))
    bound = level * float(np.sqrt(max(at.cost - multipliers[rows.budgets].sum(), 0.0)))
    excess = float(np.sqrt(at.squares[rows.budgets].max())) - 1.0
    return DualPoint(
        multipliers=multipliers,
        damping=damping,
        regulated=at,
        ratio=ratio,
        bound=bound,
        gap=max(ratio / bound - 1.0 if bound else np.inf, excess, 0.0),
    )


def first_multipliers(system: DesignSystem, rows: SquaredRows) -> Floats:
    """Equal multipliers of the limits, and r such that the forces are near their budgets."""
    budgets = rows.budgets
    w = np.zeros(len(rows.plain.T))
    w[: rows.n_limits] = 1.0 / rows.n_limits
    w[budgets] = 1.0
    for _ in range(12):
        squares = regulate(system, rows, w).squares[budgets]
        if np.all((squares > 0.3) & (squares < 3.0)):
            break
        w[budgets] *= np.clip(squares, 1e-3, 1e3)
    return w


def like_a_damper(system: DesignSystem, at: Regulated) -> Floats:
    """c = E[f v] / E[v^2] of each device [N s/m]."""
    both = -np.einsum("ij,jk,ik->i", at.gain, at.covariance, system.rates)
    rates = mean_squares(system.rates, at.covariance)
    return np.asarray(np.maximum(both, 1e-6 * np.abs(both).max()) / rates)
