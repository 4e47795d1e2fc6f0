"""Semidefinite programs of weights: the dual of the worst-ratio design, and the weights of a given gain (inverse LQR).

The one module that imports cvxpy, which takes a second to load: others import it within a function.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, ClassVar

import cvxpy as cp
import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.plant import Plant, symmetric
from mrwork.control.linear.riccati import LyapunovEquations, solve_riccati
from mrwork.control.weights.limits import LimitedOutputs, RmsLimits, as_forces
from mrwork.control.weights.riccati_dual import SquaredRows, first_multipliers, regulate
from mrwork.control.weights.system import DesignSystem, design_system
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import KanaiTajimi, SpectralDensity

MOST_STATES = 26
"""States up to which Clarabel solves the program to four digits, that is about twelve storeys."""

OPTIMAL = 1e-3
"""Distance up to which a gain counts as optimal for the weights found: about the accuracy of the program."""

_ROUNDS = 15


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

    def solve(self, limits: Floats, budgets: Floats) -> tuple[Floats, float] | None:
        """Multipliers with sum q = 1, limits and budgets scaled to 1, and the least t^2; `None` where it fails."""
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
        return multipliers, level**2 * float(self._problem.value)


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


@array_dataclass(repr=False)
class InverseWeights(Summarised):
    """Weights `s'Q s + f'R f` of a given gain K, or of the optimal gain that is nearest to it.

    `state_weight` is Q, shape (2n, 2n), `control_weight` R as it was given, shape (n_devices,), and `gain` their
    Riccati gain, shape (n_devices, 2n); the common factor of Q and R is free. `distance` is `|(gain - K) X^1/2| / |K
    X^1/2|` with the covariance X of the state under K: the rms difference of the desired forces over the rms wanted
    force.
    """

    _units: ClassVar[Mapping[str, str]] = {"control_weight": "1/N^2"}

    state_weight: Floats
    control_weight: Floats
    gain: Floats
    distance: float

    @property
    def optimal(self) -> bool:
        """Whether the given gain is that of these weights."""
        return self.distance <= OPTIMAL

    def _summary(self) -> Summary:
        says = (
            "The gain is optimal for these weights."
            if self.optimal
            else "The gain is not that of any Q without cross term: the weights are those of a gain nearby."
        )
        return Summary(
            title="Weights of a gain",
            facts=(
                ("distance", f"{self.distance:.2e} of the rms desired force"),
                (
                    "control weight",
                    f"{', '.join(format_rounded(float(each)) for each in self.control_weight)} 1/N2",
                ),
                ("largest weight", format_rounded(float(np.abs(self.state_weight).max()))),
            ),
            notes=(says,),
        )


@checked
def inverse_weights(
    plant: Plant,
    gain: ArrayLike,
    *,
    control_weight: Annotated[float | Sequence[float], Within(above=0.0)] = 1.0,
    spectrum: SpectralDensity | None = None,
) -> InverseWeights:
    """Weights of a regulator that has a given gain, or the nearest gain that some weights have.

    A gain K' = R^-1 B'P is optimal if `Q = P B R^-1 B'P - A'P - P A >= 0` with P >= 0 (R. E. Kalman, J. Basic Eng. 86,
    1964, 51-60). The distance to K is convex in P and the condition is not; each round replaces the product by its
    tangent at the last gain, which is a semidefinite program whose solution satisfies the condition, so that the
    distance falls from round to round to a local minimum. Compare M. C. Priess et al., IEEE Trans. Control Systems
    Technology 23(2), 2015, 770-777.

    Parameters
    ----------
    gain
        K of the desired force f = -K s, shape (n_devices, 2n), as of a tuned law.
    control_weight
        R [1/N^2]: one number for all devices, or one for each.
    spectrum
        Of the ground under which gains are compared; Kanai-Tajimi on firm soil by default.

    Raises
    ------
    SettingError
        If the gain has another shape, or the loop closed with it is not stable.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> plant = mr.control.plant_of(frame, frame.storeys[:1])
    >>> regulator = mr.control.regulator_of_outputs(plant, mr.control.drifts(plant), 1.0, 1e-10)
    >>> mr.control.inverse_weights(plant, regulator.gain).optimal
    True
    """
    K = np.atleast_2d(np.asarray(gain, dtype=np.float64))
    shape = (plant.n_devices, 2 * plant.n_coordinates)
    if K.shape != shape or not np.any(np.abs(K) > np.finfo(float).tiny):
        raise SettingError(f"`gain` has shape {K.shape}; give finite numbers of shape {shape}, not all zero")
    R = np.asarray(control_weight, dtype=np.float64)
    if R.shape not in ((), (plant.n_devices,)):
        raise SettingError(
            f"`control_weight` has {R.size} numbers, and the number of devices is {plant.n_devices}; give one for "
            "each, or one for all"
        )
    R = np.broadcast_to(R, plant.n_devices)
    spectrum = KanaiTajimi() if spectrum is None else spectrum
    outputs = LimitedOutputs.of(RmsLimits(rms_drift=1.0), plant)
    system = design_system(plant, outputs, spectrum, budgets=as_forces(1.0, plant))
    try:
        loop = LyapunovEquations(system.A - system.B @ K @ system.state)
    except SettingError as error:
        raise SettingError(
            "the loop closed with this gain is not stable, so that it is no gain of any weights; give a stabilising one"
        ) from error
    X = system.state @ loop.covariance(system.noise) @ system.state.T
    rms = np.sqrt(np.diag(X))
    best: InverseWeights | None = None
    # Which coordinates the solver finds easy depends on the gain: states over their rms, or those of the energy.
    for T in (np.diag(rms), plant.scaling):
        weights = _in_coordinates(plant, K, R, X, T)
        if weights is not None and (best is None or weights.distance < best.distance):
            best = weights
        if best is not None and best.optimal:
            break
    if best is None:
        raise SettingError(
            "the weights of this gain were not found: the semidefinite program failed; give a gain of less extreme "
            "entries"
        )
    return best


def _in_coordinates(plant: Plant, K: Floats, R: Floats, X: Floats, T: Floats) -> InverseWeights | None:
    """The weights from a program in coordinates z of s = T z; `None` where it fails."""
    back, scale = np.linalg.inv(T), np.sqrt(R)[:, None]
    root: Floats = np.linalg.cholesky(symmetric(back @ X @ back.T)).astype(np.float64)
    # Forces such that they cost one in all.
    size = np.linalg.norm(scale * K @ T @ root)
    force = size / np.sqrt(R)
    A, B, K_z = back @ plant.A @ T, back @ plant.B * force, K @ T / force[:, None]
    rate = float(np.linalg.norm(A, 2))
    P = _nearest(A / rate, B / rate, K_z, root)
    if P is None:
        return None
    gain_z = B.T @ P / rate
    values, vectors = np.linalg.eigh(symmetric(gain_z.T @ gain_z - (A.T @ P + P @ A) / rate))
    Q_z = (vectors * np.maximum(values, 1e-12 * values[-1])) @ vectors.T
    # The cost of u'u in scaled forces is f'R f over size^2.
    Q = symmetric(size**2 * back.T @ Q_z @ back)
    zero = np.zeros((len(Q), len(R)))
    try:
        gain, _ = solve_riccati(plant.A, plant.B, Q, np.diag(R), zero, scaling=plant.scaling)
    except SettingError:
        return None
    distance = float(np.linalg.norm(scale * (gain - K) @ T @ root) / size)
    return InverseWeights(state_weight=Q, control_weight=R.copy(), gain=gain, distance=distance)


def _nearest(A: Floats, B: Floats, gain: Floats, root: Floats) -> Floats | None:
    """P with `B'P` nearest to the gain, of a cost u'u; tangents until the distance stops falling."""
    best, smallest, at = None, np.inf, gain
    for _ in range(_ROUNDS):
        P = _solve_tangent(A, B, gain, root, at)
        if P is None:
            break
        at = B.T @ P
        distance = float(np.linalg.norm((at - gain) @ root))
        if distance < smallest:
            best = P
        if distance <= 0.1 * OPTIMAL or distance > 0.99 * smallest:
            break
        smallest = distance
    return best


def _solve_tangent(A: Floats, B: Floats, gain: Floats, root: Floats, at: Floats) -> Floats | None:
    """P >= 0 with the least `|(B'P - gain) root|` and `at'B'P + P B at - at'at - A'P - P A >= 0`; `None` if it fails.

    The condition is the tangent at the gain `at` of `P B B'P - A'P - P A >= 0`, and implies it.
    """
    P = cp.Variable(A.shape, PSD=True)
    cross = P @ (B @ at - A)
    problem = cp.Problem(
        cp.Minimize(cp.norm((B.T @ P - gain) @ root, "fro")), [cross + cross.T - at.T @ at >> 0]
    )
    return _solution(problem, P)
