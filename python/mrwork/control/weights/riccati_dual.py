"""The dual of the worst-ratio design by Riccati and Lyapunov equations alone.

For multipliers w = (q of the limits, r of the budgets, s of the semi-active conditions), `h(w)` is the cost of the
regulator with these weights; h is concave, and by the envelope theorem its gradient are the mean squares of the rows
under that regulator. The design maximises `h(w) - sum r` over `sum q = 1, w >= 0`, with limits and budgets scaled to 1.
Its Hessian follows from the derivatives of the gain, so a primal-dual interior-point method of few variables solves it
to rounding, however many states the building has.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.riccati import LyapunovEquations, solve_riccati
from mrwork.control.weights.system import SMALLER_BUDGET, DesignSystem
from mrwork.errors import SettingError

_STEPS = 80
_GAP = 1e-10
_TO_BOUNDARY = 0.99


@array_dataclass()
class SquaredRows:
    """Rows `c x + d u` of one system and the forms that add up their squares, `forms @ squares`.

    The first rows are the limited outputs over their limits, then the desired forces over their budgets, then
    `f - c v` of the semi-active conditions over the budgets; the forms are in the same order.
    """

    C: Floats
    D: Floats
    forms: Floats


def rows_of(
    system: DesignSystem, limits: Floats, budgets: Floats, semi_active: tuple[Floats, float] | None = None
) -> SquaredRows:
    """The rows of a system; `semi_active` are c of each device [N s/m] and the share b."""
    n, m = system.B.shape
    C = [system.C / limits[:, None], np.zeros((m, n))]
    D = [system.D / limits[:, None], np.diag(1.0 / budgets)]
    forms = np.eye(len(limits) + m)
    if semi_active is not None:
        damping, share = semi_active
        scaled = 1.0 / budgets[:, None]
        C += [scaled * (system.force - damping[:, None] * system.rates), scaled * system.force]
        D += [scaled * system.direct, scaled * system.direct]
        added = np.hstack([np.eye(m), -(share**2) * np.eye(m)])
        forms = np.block([[forms, np.zeros((len(forms), 2 * m))], [np.zeros((m, len(forms))), added]])
    return SquaredRows(C=np.vstack(C), D=np.vstack(D), forms=forms)


@array_dataclass()
class Regulated:
    """A system under the regulator of given multipliers: its gain, Riccati matrix, covariance and mean squares."""

    gain: Floats
    riccati: Floats
    covariance: Floats
    squares: Floats
    cost: float


def regulate(system: DesignSystem, rows: SquaredRows, multipliers: Floats) -> Regulated:
    """The regulator of the multipliers, by weights of the rows that may be negative, and mean squares of the forms."""
    A, B, step, weights = system.A, system.B, system.step, multipliers @ rows.forms
    Q, N = (rows.C.T * weights) @ rows.C, (rows.C.T * weights) @ rows.D
    R = (rows.D.T * weights) @ rows.D
    one = np.eye(len(A))
    if step:
        sums = (one + step * A, step * B, step * Q, step * R, step * N)
        gain, P = solve_riccati(*sums, scaling=one, time="discrete")
    else:
        gain, P = solve_riccati(A, B, Q, R, N, scaling=one)
    try:
        loop = LyapunovEquations(A - B @ gain, step)
    except SettingError as error:
        raise SettingError(
            f"the gain of the weights does not stabilise the loop; {SMALLER_BUDGET}"
        ) from error
    X = loop.covariance(system.noise)
    closed = rows.C - rows.D @ gain
    return Regulated(
        gain=gain,
        riccati=P,
        covariance=X,
        squares=rows.forms @ np.einsum("ij,jk,ik->i", closed, X, closed),
        cost=float(np.sum(system.noise * P)),
    )


def _curvature(system: DesignSystem, rows: SquaredRows, weights: Floats, at: Regulated) -> Floats:
    """Hessian of the cost by the multipliers: `-2 tr(R dK_a X dK_b')` with the derivatives dK of the gain."""
    A, B, step, gain = system.A, system.B, system.step, at.gain
    closed = LyapunovEquations(A - B @ gain, step)
    R = (rows.D.T * weights) @ rows.D + step * B.T @ at.riccati @ B
    forward = np.eye(len(A)) + step * (A - B @ gain)
    own = rows.C - rows.D @ gain
    moved = np.array(
        [
            B.T @ closed.cost(np.outer(row, row)) @ forward + np.outer(direct, row)
            for row, direct in zip(own, rows.D, strict=True)
        ]
    )
    slopes = np.linalg.solve(R, np.tensordot(rows.forms, moved, axes=1))
    weighed = R @ slopes @ at.covariance
    return np.asarray(-2.0 * np.einsum("aij,bij->ab", slopes, weighed))


@array_dataclass()
class DualPoint:
    """Multipliers with sum q = 1, the least t^2, the gap to it, and the regulated systems."""

    multipliers: Floats
    value: float
    gap: float
    steps: int
    regulated: tuple[Regulated, ...]


def maximise(
    systems: Sequence[DesignSystem],
    rows: Sequence[SquaredRows],
    n_limits: int,
    *,
    start: Floats | None = None,
) -> DualPoint:
    """Maximise the mean of `h(w)` over the systems minus `sum r`, by a primal-dual interior-point method."""
    n_forms = len(rows[0].forms)
    budgets = slice(n_limits, n_limits + systems[0].B.shape[1])
    bound = np.zeros(n_forms)
    bound[budgets] = 1.0
    in_sum = np.zeros(n_forms)
    in_sum[:n_limits] = 1.0
    w = first_multipliers(systems, rows, n_limits) if start is None else _inside(start, n_limits)
    at = [regulate(system, each, w) for system, each in zip(systems, rows, strict=True)]
    squares = np.mean([each.squares for each in at], axis=0)
    level = 1.1 * float(squares[:n_limits].max())
    slack = np.maximum(level * in_sum + bound - squares, 1e-3 * np.where(in_sum > 0.0, level, 1.0))
    steps = 0
    while True:
        complementarity = float(w @ slack)
        residual = squares - level * in_sum - bound + slack
        settled = float(np.abs(residual).max()) <= 1e-9 * max(level, 1.0)
        if settled and complementarity <= _GAP * level:
            break
        if steps == _STEPS:
            raise SettingError(
                f"the weights did not settle in {_STEPS} steps: the gap is {complementarity / level:.1e} of the ratio; "
                "give limits and a budget of less extreme ratio"
            )
        steps += 1
        # Towards the middle of the path while the slacks do not fit, along it afterwards.
        target = (0.02 if settled else 0.2) * complementarity / n_forms
        curvature = np.mean(
            [
                _curvature(system, each, w @ each.forms, one)
                for system, each, one in zip(systems, rows, at, strict=True)
            ],
            axis=0,
        )
        right = -(squares - level * in_sum - bound + target / w)
        matrix = np.block(
            [[curvature - np.diag(slack / w), -in_sum[:, None]], [in_sum[None, :], np.zeros((1, 1))]]
        )
        scale = np.append(w, 1.0)
        move = scale * np.linalg.solve(
            matrix * np.outer(scale, scale), scale * np.append(right, 1.0 - w @ in_sum)
        )
        d_w, d_level = move[:-1], float(move[-1])
        d_slack = (target - slack * d_w) / w - slack
        length = min(1.0, _TO_BOUNDARY * _longest(w, d_w), _TO_BOUNDARY * _longest(slack, d_slack))
        at, length = _move(systems, rows, w, d_w, length)
        w, slack, level = w + length * d_w, slack + length * d_slack, level + length * d_level
        squares = np.mean([each.squares for each in at], axis=0)
    value = float(np.mean([each.cost for each in at]) - w[budgets].sum())
    return DualPoint(multipliers=w, value=value, gap=complementarity, steps=steps, regulated=tuple(at))


def _longest(point: Floats, move: Floats) -> float:
    """Largest step along a move that stays positive."""
    shrinking = move < 0.0
    return float(np.min(-point[shrinking] / move[shrinking], initial=np.inf))


def _move(
    systems: Sequence[DesignSystem], rows: Sequence[SquaredRows], w: Floats, d_w: Floats, length: float
) -> tuple[list[Regulated], float]:
    """The regulators after a step, which is halved until every Riccati equation has a solution."""
    for _ in range(30):
        try:
            return [
                regulate(s, each, w + length * d_w) for s, each in zip(systems, rows, strict=True)
            ], length
        except SettingError:
            length *= 0.5
    raise SettingError(f"no step of the weights keeps the Riccati equation solvable; {SMALLER_BUDGET}")


def _inside(start: Floats, n_limits: int) -> Floats:
    """Multipliers away from zero, with sum q = 1."""
    w = np.maximum(start, 1e-4 * np.max(start))
    return np.asarray(w / w[:n_limits].sum())


def first_multipliers(systems: Sequence[DesignSystem], rows: Sequence[SquaredRows], n_limits: int) -> Floats:
    """Equal multipliers of the limits, and r such that the forces are near their budgets."""
    budgets = slice(n_limits, n_limits + systems[0].B.shape[1])
    w = np.zeros(len(rows[0].forms))
    w[:n_limits] = 1.0 / n_limits
    w[budgets] = 1.0
    for _ in range(12):
        at = [regulate(system, each, w) for system, each in zip(systems, rows, strict=True)]
        squares = np.mean([each.squares for each in at], axis=0)[budgets]
        if np.all((squares > 0.3) & (squares < 3.0)):
            break
        w[budgets] *= np.clip(squares, 1e-3, 1e3)
    w[budgets.stop :] = 1e-3 * w[budgets].min()
    return w


_GAIN_STEPS = 200
SENSOR_NOISE = 0.05
"""Noise of each state that a sampled law knows, over its rms without control; keeps the gain from differences of states
that the model alone tells apart."""


def riccati_law_gain(system: DesignSystem, regulator: Regulated) -> Floats:
    """Gain on the state s of the building of a design in continuous time, shape (n_devices, 2n).

    It is the block of s, which is the Riccati gain of the building alone, for the soil is not controlled.
    """
    n = len(system.state)
    return np.asarray(np.linalg.solve(system.state[:, :n].T, regulator.gain[:, :n].T).T)


def static_law_gain(system: DesignSystem, rows: SquaredRows, multipliers: Floats, start: Floats) -> Floats:
    """Gain on s of least cost in a sampled loop with driver and delay, shape (n_devices, 2n); a local minimum.

    The gradient is that of static output feedback (W. S. Levine and M. Athans, IEEE Trans. Automatic Control 15(1),
    1970, 44-48). The gain to start from is halved until the loop is stable.
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

    minimum = minimize(
        cost_of,
        (start * unit).ravel(),
        jac=True,
        method="BFGS",
        options={"maxiter": _GAIN_STEPS, "gtol": 1e-8},
    )
    return np.asarray(minimum.x.reshape(shape) / unit)


def _cost(
    system: DesignSystem, rows: SquaredRows, weights: Floats, gain: Floats, spread: Floats
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
