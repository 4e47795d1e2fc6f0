"""LQR weights by convex design: the worst ratio of rms responses to their limits, under a budget of force."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.values import Floats, one_for_each
from mrwork.buildings.device import Device, elongation_rows
from mrwork.buildings.plane_building import Building
from mrwork.control.linear.plant import Plant, deformation_rates, plant_of
from mrwork.control.linear.riccati import mean_squares, solve_riccati
from mrwork.control.weights.limits import Limit, LimitedOutputs, RmsLimits, SemiActiveCondition, as_forces
from mrwork.control.weights.regulator import (
    DualPoint,
    SquaredRows,
    dual_point,
    like_a_damper,
    regulate,
    squared_rows,
)
from mrwork.control.weights.system import DesignSystem, design_system, useful_force
from mrwork.control.weights.weight_certificate import DesignedWeights, binding_in_words, certificate_of
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import KanaiTajimi, SpectralDensity

if TYPE_CHECKING:
    from mrwork.control.weights.program import WeightProgram

# Number of modes up to which the program contains the whole building, and the most that it contains.
_ALL_MODES, _MOST_MODES = 20, 40
_MOST_GAP = 0.01
# Most dampings of a semi-active condition that are tried, and the logarithm of the ratio of those without a solution.
_MOST_DAMPINGS, _NO_RATIO = 60, 10.0
# Price of a semi-active condition, over the square of the budget, at which it has no weight.
_UNCONDITIONED = 1e4
_MOST_BUDGET = 100.0
# Budget over the force that limits have use for below which a design without a solution is put down to the budget.
_LEAST_BUDGET = 1e-6


@checked
def design_weights(
    building: Building,
    devices: Sequence[Device] | ArrayLike,
    *,
    limits: RmsLimits | Mapping[str, Limit | str | Sequence[float | str]],
    budget: float | str | Sequence[float | str],
    spectrum: SpectralDensity | None = None,
    semi_active: SemiActiveCondition | None = None,
) -> DesignedWeights:
    """Weights of a regulator such that rms responses keep to limits with a budget of force.

    Minimises t with `E y_i^2 <= t^2 l_i^2` for all limited outputs and `E f_j^2 <= budget_j^2`, over all linear laws,
    under white noise filtered by a spectrum. The multipliers of the limits and budgets are the weights (S. Boyd et al.,
    Linear Matrix Inequalities in System and Control Theory, 1994). Only ratios of limits matter, and only the budget
    over the intensity of the ground. The program has all modes of a building of up to 20 coordinates; beyond, its 20
    lowest modes, or twice as many where the certificate on all of them asks for more.

    Parameters
    ----------
    devices
        Devices, or their rows of elongation, shape (n_devices, n).
    limits
        Limits on rms drift [m], absolute acceleration [m/s^2], displacement [m] and force [N], or as "2 mm"; see
        `RmsLimits`.
    budget
        Largest rms desired force of each device, of all its dampers together: one for all [N], or as "1.5 kN", or one
        for each.
    spectrum
        `KanaiTajimi` or `CloughPenzien`, as given or by `mr.motions.fitted_spectrum` of a record; Kanai-Tajimi on firm
        soil by default.
    semi_active
        Condition that the desired force be mostly like a damper's.

    Raises
    ------
    SettingError
        If a limit or budget cannot be, the building has a mode without damping, or the gap of the certificate is above
        1 %.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> designed = mr.control.design_weights(
    ...     frame, frame.storeys[:1], limits={"rms_drift": 2e-3, "rms_acceleration": 1.0}, budget=500.0
    ... )
    >>> round(designed.reachable_ratio, 3)
    4.648
    """
    plant = plant_of(building, *_rows(building, devices))
    spectrum = KanaiTajimi() if spectrum is None else spectrum
    outputs, budgets = LimitedOutputs.of(RmsLimits.of(limits), plant), as_forces(budget, plant)
    with _blame_budget(plant, spectrum, budgets):
        whole = design_system(plant, outputs, spectrum)
        task = _Task(whole, outputs, budgets, semi_active)
        modes = min(plant.n_coordinates, _ALL_MODES)
        while True:
            program, point = task.solve(design_system(plant, outputs, spectrum, n_modes=modes))
            if point.gap <= _MOST_GAP or modes >= min(plant.n_coordinates, _MOST_MODES):
                break
            modes = min(2 * modes, plant.n_coordinates)
        if not point.gap <= _MOST_GAP:
            raise SettingError(
                f"the weights were not found: on {modes} modes the gap is {100.0 * point.gap:.2g} %, from "
                f"{point.ratio:.4g} of the limits to the bound {point.bound:.4g}, and 1 % is allowed; give limits and "
                "a budget of less extreme ratio, or a building of fewer coordinates"
            )
        factor = None if point.ratio <= 1.0 else task.budget_factor(program, point.damping)
        return _designed(plant, spectrum, task, point, modes, factor)


def _rows(building: Building, devices: Sequence[Device] | ArrayLike) -> tuple[Floats, tuple[str, ...]]:
    if isinstance(devices, Sequence) and devices and all(isinstance(device, Device) for device in devices):
        named = [device for device in devices if isinstance(device, Device)]
        return elongation_rows(building, named), tuple(device.name for device in named)
    return np.atleast_2d(np.asarray(devices, dtype=np.float64)), ()


@contextmanager
def _blame_budget(plant: Plant, spectrum: SpectralDensity, budgets: Floats) -> Iterator[None]:
    """Blame the budget for a design without a solution, if the building has no use for such a budget."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            yield
    except SettingError as error:
        useful = useful_force(plant, spectrum)
        shown = ", ".join(f"{force:.3g}" for force in dict.fromkeys(budgets.tolist()))
        if budgets.max() > useful:
            raise SettingError(
                f"the budget is {shown} N, and the limits have no use for more than about {useful:.2g} N rms, a fifth "
                "of the inertia of the building under this ground; with more force the weights are not determined, "
                "give less"
            ) from error
        if budgets.min() < _LEAST_BUDGET * useful:
            raise SettingError(
                f"the budget is {shown} N, which moves nothing: the limits have use for about {useful:.2g} N rms, a "
                "fifth of the inertia of the building under this ground; give more"
            ) from error
        raise


class _Task:
    """Limits, budgets and semi-active condition on the whole building.

    Limits are scaled by `level` to those that are just met without control, and dampings by the budget over the rate
    without control.
    """

    def __init__(
        self,
        whole: DesignSystem,
        outputs: LimitedOutputs,
        budgets: Floats,
        semi_active: SemiActiveCondition | None,
    ) -> None:
        self.whole, self.outputs, self.budgets, self.semi_active = whole, outputs, budgets, semi_active
        self.level = float(np.max(whole.rms_without_control() / outputs.limits))
        self.unit, self.damping = np.ones(len(budgets)), np.zeros(len(budgets))
        if semi_active is not None:
            self.unit = budgets / np.sqrt(mean_squares(whole.rates, whole.uncontrolled))
        if semi_active is not None and semi_active.damping is not None:
            damping = one_for_each("damping", np.squeeze(semi_active.damping), len(budgets), "device")
            self.damping = damping / self.unit
        self.rows = self.rows_of(whole)
        # What adds up the multipliers of the limits, of the budgets, and of the conditions.
        self.of_limits, self.of_budgets, self.of_conditions = np.zeros((3, len(self.rows.plain.T)))
        self.of_limits[: self.rows.n_limits] = self.of_budgets[self.rows.budgets] = 1.0
        self.of_conditions[self.rows.budgets.stop :] = 1.0

    def rows_of(self, system: DesignSystem) -> SquaredRows:
        """Rows of the limits and budgets of a system, and of its semi-active condition where there is one."""
        limits = self.level * self.outputs.limits
        if self.semi_active is None:
            return squared_rows(system, limits, self.budgets)
        return squared_rows(system, limits, self.budgets, self.unit, self.semi_active.share)

    def solve(self, system: DesignSystem) -> tuple[WeightProgram, DualPoint]:
        """The multipliers by a program on a system, judged on the whole building.

        A semi-active condition without dampings takes those of the least ratio, which the desired forces then have.
        """
        # cvxpy takes a second to load, which scripts that do not design should not pay.
        from mrwork.control.weights.program import WeightProgram

        program = WeightProgram(system, self.rows_of(system))
        if self.semi_active is None or self.semi_active.damping is not None:
            point = self._point(program, self.of_budgets, self.damping)
        else:
            unconditioned = self.of_budgets + _UNCONDITIONED * self.of_conditions
            start = self._point(program, unconditioned, self.damping)
            point = None if start is None else self._least(program, start)
        if point is None:
            raise SettingError(
                "the semidefinite program of the weights has no solution; give limits and a budget of less extreme "
                "ratio"
            )
        return program, point

    def _point(self, program: WeightProgram, cost: Floats, damping: Floats) -> DualPoint | None:
        """The multipliers with dampings of the condition; `None` without a solution."""
        multipliers = program.solve(cost, self.of_limits, damping)
        if multipliers is None:
            return None
        return dual_point(self.whole, self.rows, multipliers, damping, self.level)

    def _least(self, program: WeightProgram, start: DualPoint) -> DualPoint | None:
        """The multipliers with the dampings of least ratio, from the dampings of forces without the condition.

        Taking the dampings of the desired forces for the next ones lowers the ratio too, but creeps: the forces follow
        the condition but for some per cent. By the envelope theorem that difference gives the slope of the ratio.
        """
        points, most_gap = list[DualPoint](), max(_MOST_GAP, 2.0 * start.gap)
        rates = slice(self.rows.budgets.stop, self.rows.budgets.stop + len(self.unit))

        def log_ratio(log: Floats) -> tuple[float, Floats]:
            damping, point = np.exp(log), None
            with suppress(SettingError):
                point = self._point(program, self.of_budgets, damping)
            if point is None or point.gap > most_gap:
                # The budget does not suffice for so much damping.
                return _NO_RATIO, np.zeros(len(log))
            points.append(point)
            excess = like_a_damper(self.whole, point.regulated) / self.unit - damping
            conditions = point.multipliers[self.rows.budgets.stop :]
            slope = -conditions * damping * excess * point.regulated.squares[rates]
            return float(np.log(point.ratio)), slope * (self.level / point.ratio) ** 2

        first = like_a_damper(self.whole, start.regulated) / self.unit
        # A device whose force without the condition is no damper's has a damping, too.
        log = np.log(np.maximum(first, 0.1 * first.max()))
        while log_ratio(log)[0] == _NO_RATIO and log.max() > -_NO_RATIO:
            log = log - 1.0
        scipy.optimize.minimize(
            log_ratio,
            log,
            jac=True,
            method="L-BFGS-B",
            options={"maxfun": _MOST_DAMPINGS, "ftol": 1e-5, "gtol": 3e-4},
        )
        return min(points, key=lambda point: point.ratio, default=None)

    def budget_factor(self, program: WeightProgram, damping: Floats) -> float:
        """Least factor of all budgets with which the limits can be met.

        It is the program with the roles of limits and budgets exchanged. Infinite where even 100 times the budgets do
        not suffice; NaN where the certificate of the factor is off by more than 1 %.
        """
        with suppress(SettingError):
            if (
                multipliers := program.solve(self.of_limits / self.level**2, self.of_budgets, damping)
            ) is not None:
                at = regulate(self.whole, self.rows, multipliers, damping)
                ratio = self.level * float(np.sqrt(at.squares[: self.rows.n_limits].max()))
                factor = float(np.sqrt(at.squares[self.rows.budgets].max()))
                least = np.sqrt(max(at.cost - float(multipliers @ self.of_limits) / self.level**2, 0.0))
                if max(ratio, factor / max(least, 1e-300)) <= 1.0 + _MOST_GAP:
                    return factor if factor <= _MOST_BUDGET else np.inf
        with suppress(SettingError):
            most = _MOST_BUDGET**2 * self.of_budgets
            if (multipliers := program.solve(most, self.of_limits, damping)) is not None:
                cost = regulate(self.whole, self.rows, multipliers, damping).cost
                if cost - float(multipliers @ most) > self.level**-2:
                    return np.inf
        return np.nan


def _designed(
    plant: Plant, spectrum: SpectralDensity, task: _Task, point: DualPoint, modes: int, factor: float | None
) -> DesignedWeights:
    """The weights of a dual point, with the gain of the law, the certificate and what binds."""
    outputs, budgets, forces = task.outputs, task.budgets, task.rows.budgets
    multipliers = point.multipliers.copy()
    multipliers[forces.start :] *= task.level**2
    output_weights = multipliers[: forces.start] / outputs.limits**2
    control_weight = multipliers[forces] / budgets**2
    named = outputs.of_plant(plant)
    Q, N, R = (
        (a.T * output_weights) @ b for a, b in ((named.C, named.C), (named.C, named.D), (named.D, named.D))
    )
    R = R + np.diag(control_weight)
    if task.semi_active is not None:
        s, c = multipliers[forces.stop :] / budgets**2, task.unit * point.damping
        v = deformation_rates(plant).C
        Q, N = Q + (v.T * (s * c**2)) @ v, N - v.T * (s * c)
        R = R + np.diag(s * (1.0 - task.semi_active.share**2))
    # The multiplier of a budget that does not bind is zero, to which no size of R has a ratio.
    control_weight = np.maximum(control_weight, 1e-9 * np.diag(R))
    gain, _ = solve_riccati(plant.A, plant.B, Q, R, N, scaling=plant.scaling)
    return DesignedWeights(
        plant=plant,
        spectrum=spectrum,
        output_weights=output_weights,
        control_weight=control_weight,
        Q=Q,
        N=N,
        R=R,
        gain=gain,
        reachable_ratio=point.ratio,
        certificate=certificate_of(task.whole, outputs, budgets, point, gain),
        binding=binding_in_words(outputs, multipliers, point.ratio, budgets, plant),
        engine=f"semidefinite program on {modes} of {plant.n_coordinates} modes",
        budget_factor=factor,
        outputs=outputs,
        system=task.whole,
        semi_active=task.semi_active is not None,
    )
