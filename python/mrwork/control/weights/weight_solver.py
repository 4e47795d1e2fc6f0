"""LQR weights by convex design: the worst ratio of rms responses to their limits, under a budget of force.

A `WeightDesigner` is set up once and solved for any limits and budgets: program, Riccati equations, certificate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import Count, checked
from mrwork.base.values import Floats
from mrwork.buildings.matrices import Building, Device, elongation_rows
from mrwork.control.linear.lqr import Weighed
from mrwork.control.linear.plant import Plant, deformation_rates, plant_of
from mrwork.control.linear.riccati import solve_riccati
from mrwork.control.weights.limits import (
    DesignCase,
    Limit,
    LimitedOutputs,
    LoopTiming,
    RmsLimits,
    SemiActiveCondition,
    as_forces,
)
from mrwork.control.weights.riccati_dual import (
    DualPoint,
    SquaredRows,
    maximise,
    regulate,
    riccati_law_gain,
    rows_of,
    static_law_gain,
)
from mrwork.control.weights.system import DesignSystem, design_system, useful_force
from mrwork.control.weights.weight_certificate import DesignedWeights, binding_in_words, certificate_of
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import KanaiTajimi, SpectralDensity

if TYPE_CHECKING:
    from mrwork.control.weights.program import DualProgram


# Modes of the first program of a tall building.
_MODES = 8
_ALTERNATIONS = 12
_MOST_BUDGET = 100.0
# Budget over the force that limits have use for below which a design without a solution is put down to the budget.
_LEAST_BUDGET = 1e-6


class WeightDesigner:
    """A weight design that is solved again for other limits and budgets without being set up again.

    Takes the arguments of `design_weights`; its limits and budget are the defaults of `design`. `program_modes` are the
    modes of the building in the semidefinite program, of which the Riccati equations take the start: by default all up
    to about twelve storeys, 8 beyond.
    """

    def __init__(
        self,
        building: Building,
        devices: Sequence[Device] | ArrayLike,
        *,
        limits: RmsLimits | Mapping[str, Limit | str | Sequence[float | str]],
        budget: float | str | Sequence[float | str],
        spectrum: SpectralDensity | None = None,
        cases: Sequence[DesignCase] = (),
        timing: LoopTiming | None = None,
        semi_active: SemiActiveCondition | None = None,
        program_modes: Count | None = None,
    ) -> None:
        rows, names = _rows(building, devices)
        self.plant = plant_of(building, rows, names)
        self._outputs = LimitedOutputs.of(RmsLimits.of(limits), self.plant)
        self._budgets = as_forces(budget, self.plant)
        nominal = KanaiTajimi() if spectrum is None else spectrum
        if cases and spectrum is not None:
            raise SettingError(
                "every case has a spectrum of its own, beside which `spectrum` has no effect; leave it out"
            )
        self._cases = tuple(cases) or (DesignCase(name=building.name, building=building, spectrum=nominal),)
        self._timing, self._semi_active = timing, semi_active
        self._plants = [_plant_of_case(case, building, rows, names) for case in self._cases]
        with self._blame_budget(self._budgets):
            self._systems = self._systems_of(None)
            self._nominal = self._system(self.plant, self._cases[0].spectrum, None)
            self._damping = self._condition_damping()
        self._program: DualProgram | None = None
        self._modes = program_modes

    def design(
        self,
        limits: RmsLimits | Mapping[str, Limit | str] | None = None,
        budget: float | str | Sequence[float | str] | None = None,
    ) -> DesignedWeights:
        """The weights for these limits and this budget, those of the designer by default."""
        outputs = self._outputs if limits is None else LimitedOutputs.of(RmsLimits.of(limits), self.plant)
        if outputs.names != self._outputs.names:
            raise SettingError(
                "these limits are on other outputs than those of the designer; make another designer for them"
            )
        budgets = self._budgets if budget is None else as_forces(budget, self.plant)
        with self._blame_budget(budgets):
            return self._design(outputs, budgets)

    @contextmanager
    def _blame_budget(self, budgets: Floats) -> Iterator[None]:
        """Say of a design without a solution that the budget is none that the building has use for, if so."""
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                yield
        except SettingError as error:
            useful = self._useful_force()
            shown = ", ".join(f"{each:.3g}" for each in dict.fromkeys(budgets.tolist()))
            if budgets.max() > useful:
                raise SettingError(
                    f"the budget is {shown} N, and the limits have no use for more than about {useful:.2g} N rms, a "
                    "fifth of the inertia of the building under this ground; with more force the weights are not "
                    "determined, give less"
                ) from error
            if budgets.min() < _LEAST_BUDGET * useful:
                raise SettingError(
                    f"the budget is {shown} N, which moves nothing: the limits have use for about {useful:.2g} N rms, "
                    "a fifth of the inertia of the building under this ground; give more"
                ) from error
            raise

    def _useful_force(self) -> float:
        return max(
            useful_force(plant, case.spectrum) for plant, case in zip(self._plants, self._cases, strict=True)
        )

    def _design(self, outputs: LimitedOutputs, budgets: Floats) -> DesignedWeights:
        start, program_value, engine = self._by_program(outputs.limits, budgets)
        point, damping = self._refine(outputs.limits, budgets, start)
        ratio = float(np.sqrt(point.value))
        of_nominal = self._rows_of(self._nominal, outputs.limits, budgets, damping)
        # Only ratios of weights matter; these are near 1 whatever the size of the limits.
        w = point.multipliers / ratio**2
        cost = self._cost(outputs, budgets, w, damping)
        if self._timing is None:
            gain = riccati_law_gain(self._nominal, regulate(self._nominal, of_nominal, w))
        else:
            plant = self.plant
            at_once, _ = solve_riccati(plant.A, plant.B, cost.Q, cost.S, cost.N, scaling=plant.scaling)
            gain = static_law_gain(self._nominal, of_nominal, w, at_once)
        weights = point.multipliers
        return DesignedWeights(
            plant=self.plant,
            spectra=tuple(case.spectrum for case in self._cases),
            output_weights=weights[: len(outputs.limits)] / outputs.limits**2,
            control_weight=weights[len(outputs.limits) :][: len(budgets)] / budgets**2,
            Q=ratio**2 * cost.Q,
            N=ratio**2 * cost.N,
            R=ratio**2 * cost.S,
            gain=gain,
            reachable_ratio=ratio,
            certificate=certificate_of(
                [case.name for case in self._cases],
                self._systems,
                outputs,
                budgets,
                point,
                gain,
                None if program_value is None else float(np.sqrt(max(program_value, 0.0))),
            ),
            binding=binding_in_words(outputs, weights, ratio, budgets, self.plant, point.value),
            engine=f"{engine}, {point.steps} steps by Riccati equations",
            budget_factor=None
            if ratio <= 1.0
            else self._budget_factor(outputs.limits, budgets, damping, point),
            outputs=outputs,
            multipliers=weights,
            system=self._nominal,
            rows=of_nominal,
            semi_active=self._semi_active is not None,
        )

    def _system(self, plant: Plant, spectrum: SpectralDensity, n_modes: int | None) -> DesignSystem:
        # Noise is added to forces in the driver as well, in the unit of the forces that the limits have use for.
        forces = self._budgets if self._timing is None else np.minimum(self._budgets, self._useful_force())
        return design_system(
            plant, self._outputs, spectrum, budgets=forces, timing=self._timing, n_modes=n_modes
        )

    def _systems_of(self, n_modes: int | None) -> list[DesignSystem]:
        return [
            self._system(plant, case.spectrum, n_modes)
            for plant, case in zip(self._plants, self._cases, strict=True)
        ]

    def _rows_of(
        self, system: DesignSystem, limits: Floats, budgets: Floats, damping: Floats | None = None
    ) -> SquaredRows:
        if self._semi_active is None:
            return rows_of(system, limits, budgets)
        c = self._damping if damping is None else damping
        return rows_of(system, limits, budgets, (c, self._semi_active.share))

    def _condition_damping(self) -> Floats:
        """c of the semi-active condition: as given, or that of the desired force without the condition."""
        m = self.plant.n_devices
        if self._semi_active is None:
            return np.zeros(m)
        if self._semi_active.damping is not None:
            given = np.asarray(self._semi_active.damping, dtype=np.float64)
            if given.shape not in ((), (m,)):
                raise SettingError(
                    f"the semi-active condition has {given.size} dampings, and the number of devices is {m}; give one "
                    "for each, or one for all"
                )
            return np.broadcast_to(given, m).copy()
        scale = np.max([system.rms_without_control() for system in self._systems], axis=0)
        level = float(np.max(scale / self._outputs.limits))
        # With more force than the limits have use for, the force itself is not determined.
        budgets = np.minimum(self._budgets, self._useful_force())
        rows = [rows_of(system, level * self._outputs.limits, budgets) for system in self._systems]
        return self._like_a_damper(maximise(self._systems, rows, len(scale)))

    def _like_a_damper(self, point: DualPoint) -> Floats:
        """c = E[f v] / E[v^2] of each device, means over the cases."""
        both = rate = np.zeros(self.plant.n_devices)
        for system, own in zip(self._systems, point.regulated, strict=True):
            force = system.force - system.direct @ own.gain
            both = both + np.einsum("ij,jk,ik->i", force, own.covariance, system.rates)
            rate = rate + np.einsum("ij,jk,ik->i", system.rates, own.covariance, system.rates)
        return np.asarray(np.maximum(both, 1e-6 * np.abs(both).max()) / rate)

    def _by_program(self, limits: Floats, budgets: Floats) -> tuple[Floats | None, float | None, str]:
        """Multipliers of the semidefinite program, its value, and what was solved; on modes for a tall building."""
        # cvxpy takes a second to load, which scripts that do not design should not pay.
        from mrwork.control.weights.program import MOST_STATES, DualProgram

        n = self.plant.n_coordinates
        modes = min(n, self._modes or (n if self._systems[0].n_states <= MOST_STATES else _MODES))
        whole = modes == n
        if self._program is None:
            systems = self._systems if whole else self._systems_of(modes)
            self._program = DualProgram(systems, self._rows_of, self._budgets)
        solution = self._program.solve(limits, budgets)
        if solution is None:
            return None, None, "Riccati equations alone, for the program was not solved"
        multipliers, value = solution
        engine = "semidefinite program" if whole else f"semidefinite program on {modes} modes"
        # The damping of a semi-active condition that is not given is found afterwards.
        comparable = whole and (self._semi_active is None or self._semi_active.damping is not None)
        return multipliers, value if comparable else None, engine

    def _refine(self, limits: Floats, budgets: Floats, start: Floats | None) -> tuple[DualPoint, Floats]:
        """The weights to rounding; with a semi-active condition of free damping, alternated with its c."""
        damping = self._damping
        free = self._semi_active is not None and self._semi_active.damping is None
        for _ in range(_ALTERNATIONS):
            point = self._solve(limits, budgets, damping, start)
            if not free or np.allclose(moved := self._like_a_damper(point), damping, rtol=1e-4):
                break
            damping, start = moved, point.multipliers
        return point, damping

    def _solve(self, limits: Floats, budgets: Floats, damping: Floats, start: Floats | None) -> DualPoint:
        """The dual by Riccati equations, with the limits scaled to those that are just met without control."""
        level = float(np.max([system.rms_without_control() / limits for system in self._systems]))
        scale = np.ones(0 if start is None else len(start))
        scale[len(limits) :] = level**-2
        rows = [self._rows_of(system, level * limits, budgets, damping) for system in self._systems]
        point = maximise(self._systems, rows, len(limits), start=None if start is None else scale * start)
        multipliers = point.multipliers.copy()
        multipliers[len(limits) :] *= level**2
        return replace(point, multipliers=multipliers, value=level**2 * point.value, gap=level**2 * point.gap)

    def _budget_factor(self, limits: Floats, budgets: Floats, damping: Floats, point: DualPoint) -> float:
        """Factor of all budgets with which the limits can be met, to 1 %; infinite if 100 does not suffice.

        By the slope of log t over log budget, minus the multipliers of the budgets over t^2, until the limits are met;
        then by linear interpolation in these logarithms.
        """
        forces = slice(len(limits), len(limits) + len(budgets))
        low, log_low = 0.0, float(np.log(point.value))
        step = 0.5 * log_low * point.value / max(float(point.multipliers[forces].sum()), 1e-9)
        high = min(max(step, 0.01), np.log(4.0))
        while True:
            if high > np.log(_MOST_BUDGET):
                return float("inf")
            try:
                point = self._solve(limits, float(np.exp(high)) * budgets, damping, point.multipliers)
            except SettingError:
                return float("inf")
            log_high = float(np.log(point.value))
            if log_high <= 0.0:
                break
            low, log_low = high, log_high
            slope = float(point.multipliers[forces].sum()) / point.value
            high += min(max(0.5 * log_high / max(slope, 1e-9), 0.01), np.log(4.0))
        while high - low > 0.01:
            share = np.clip(log_low / (log_low - log_high), 0.1, 0.9)
            middle = low + float(share) * (high - low)
            point = self._solve(limits, float(np.exp(middle)) * budgets, damping, point.multipliers)
            log_value = float(np.log(point.value))
            low, log_low, high, log_high = (
                (middle, log_value, high, log_high) if log_value > 0.0 else (low, log_low, middle, log_value)
            )
        return float(np.exp(high))

    def _cost(self, outputs: LimitedOutputs, budgets: Floats, w: Floats, damping: Floats) -> Weighed:
        """Q, N and the whole R over the state of the building and the forces."""
        named, m, n_limits = outputs.of_plant(self.plant), self.plant.n_devices, len(outputs.limits)
        W = w[:n_limits] / outputs.limits**2
        Q, N, R = (named.C.T * W) @ named.C, (named.C.T * W) @ named.D, (named.D.T * W) @ named.D
        R = R + np.diag(w[n_limits : n_limits + m] / budgets**2)
        if self._semi_active is not None:
            s = w[n_limits + m :] / budgets**2
            v = deformation_rates(self.plant).C
            Q = Q + (v.T * (s * damping**2)) @ v
            N = N - v.T * (s * damping)
            R = R + np.diag(s * (1.0 - self._semi_active.share**2))
        return Weighed(Q=Q, N=N, S=R)


def _rows(building: Building, devices: Sequence[Device] | ArrayLike) -> tuple[Floats, tuple[str, ...]]:
    """Rows of elongation and names of devices."""
    if isinstance(devices, Sequence) and devices and all(isinstance(each, Device) for each in devices):
        named = [each for each in devices if isinstance(each, Device)]
        return elongation_rows(building, named), tuple(each.name for each in named)
    return np.atleast_2d(np.asarray(devices, dtype=np.float64)), ()


def _plant_of_case(case: DesignCase, building: Building, rows: Floats, names: tuple[str, ...]) -> Plant:
    other = case.building
    if (other.n_coordinates, other.floor_names, other.storey_names) != (
        building.n_coordinates,
        building.floor_names,
        building.storey_names,
    ):
        raise SettingError(
            f"{case.name}: {other.name} has other coordinates, floors or storeys than {building.name}; the cases of a "
            "design differ in mass, damping, stiffness and spectrum"
        )
    return plant_of(other, rows, names)


@checked
def design_weights(
    building: Building,
    devices: Sequence[Device] | ArrayLike,
    *,
    limits: RmsLimits | Mapping[str, Limit | str | Sequence[float | str]],
    budget: float | str | Sequence[float | str],
    spectrum: SpectralDensity | None = None,
    cases: Sequence[DesignCase] = (),
    timing: LoopTiming | None = None,
    semi_active: SemiActiveCondition | None = None,
) -> DesignedWeights:
    """Weights of a regulator such that rms responses keep to limits with a budget of force.

    Minimises t with `E y_i^2 <= t^2 l_i^2` for all limited outputs and `E f_j^2 <= budget_j^2`, over all linear laws,
    under white noise filtered by a spectrum. The multipliers of the limits and budgets are the weights (S. Boyd et al.,
    Linear Matrix Inequalities in System and Control Theory, 1994). Only ratios of limits matter, and only the budget
    over the intensity of the ground.

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
    cases
        Plants that share the weights, each with a spectrum of its own instead of `spectrum`: mean squares are averaged
        over them; the gain is that of `building` under the spectrum of the first. Without any, `building` under
        `spectrum`.
    timing
        Sample time, delay and driver for a design in discrete time.
    semi_active
        Condition that the desired force be mostly that of a damper.

    Raises
    ------
    SettingError
        If a limit, budget or case cannot be, or the building has a mode without damping.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> designed = mr.control.design_weights(
    ...     frame, frame.storeys[:1], limits={"rms_drift": 2e-3, "rms_acceleration": 1.0}, budget=500.0
    ... )
    >>> round(designed.reachable_ratio, 3)
    4.659
    """
    return WeightDesigner(
        building,
        devices,
        limits=limits,
        budget=budget,
        spectrum=spectrum,
        cases=cases,
        timing=timing,
        semi_active=semi_active,
    ).design()
