"""The linear system of a weight design in scaled coordinates, and the Lyapunov and Riccati equations of its loops.

`x' = A x + B u + noise`, with u the desired force of each device, of building, spectrum filter, driver and delay. Of a
sampled system A and B are difference quotients: `x_{k+1} = (1 + step A) x_k + step B u_k`, so that its formulas become
those of continuous time as the step goes to zero; `step` is then zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.plant import Plant, deformation_rates, hold_input, symmetric
from mrwork.control.linear.riccati import LyapunovEquations
from mrwork.control.weights.limits import LimitedOutputs, LoopTiming, RmsLimits
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import SpectralDensity

SMALLER_BUDGET = (
    "where the budget is more force than the limits have use for, force costs nothing and the gain is not determined: "
    "give a smaller one"
)
"""What to do where an equation of a design has no solution in double precision."""

PROCESS_NOISE = 0.02
"""White noise on every state: what it would add within one natural period, over the rms of the state.

It makes the covariance regular, without which the Riccati matrix of a design is not unique.
"""


@array_dataclass()
class DesignSystem:
    """A plant under its spectrum as the design sees it, in scaled coordinates x, shape (n,).

    A and B are difference quotients if `step` [s] is not zero. `noise` is the intensity of the white noise and
    `uncontrolled` the covariance of x without control, shapes (n, n); `ground` is the part of the noise that the ground
    causes, without the small noise of every state. The limited outputs are `y = C x + D u` in SI,
    the rates of elongation `rates @ x` [m/s], the actual forces of the devices `force x + direct u` [N]. The state of
    the building is `s = state @ x`; of a design on some modes only, their part.
    """

    A: Floats
    B: Floats
    noise: Floats
    ground: Floats
    step: float
    C: Floats
    D: Floats
    rates: Floats
    force: Floats
    direct: Floats
    state: Floats
    uncontrolled: Floats

    @property
    def n_states(self) -> int:
        """States of building, filter, driver and delay."""
        return len(self.A)

    def rms_without_control(self) -> Floats:
        """Rms of each limited output without device forces, shape (n_outputs,)."""
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", self.C, self.uncontrolled, self.C)))

    def in_units(self, units: Floats) -> DesignSystem:
        """The system with states in other units: x = units * (new x), shape (n,)."""
        return replace(
            self,
            A=self.A / units[:, None] * units,
            B=self.B / units[:, None],
            noise=self.noise / np.outer(units, units),
            ground=self.ground / np.outer(units, units),
            C=self.C * units,
            rates=self.rates * units,
            force=self.force * units,
            state=self.state * units,
            uncontrolled=self.uncontrolled / np.outer(units, units),
        )


def design_system(
    plant: Plant,
    outputs: LimitedOutputs,
    spectrum: SpectralDensity,
    *,
    budgets: Floats,
    timing: LoopTiming | None = None,
    n_modes: int | None = None,
) -> DesignSystem:
    """The system of a design.

    The `n_modes` lowest modes of the building, or all, scaled by their uncontrolled rms, are the coordinates; forces
    inside the driver are scaled by the budget.
    """
    building, n = plant.building, plant.n_coordinates
    shapes = building.modes[:, :n_modes]
    modes = scipy.linalg.block_diag(shapes, shapes)
    into = scipy.linalg.block_diag(shapes.T @ building.mass, shapes.T @ building.mass)
    soil = spectrum.filter_matrices()
    n_soil = len(soil.state)
    ground = np.zeros((len(modes.T) + n_soil, 1))
    ground[-n_soil:, 0] = soil.noise
    A = np.block(
        [
            [into @ plant.A @ modes, np.outer(into @ plant.E, soil.output)],
            [np.zeros((n_soil, len(modes.T))), soil.state],
        ]
    )
    B = np.vstack([into @ plant.B, np.zeros((n_soil, plant.n_devices))])
    intensity = 2.0 * np.pi * spectrum.intensity * ground @ ground.T
    try:
        covariance = LyapunovEquations(A).covariance(intensity)
    except SettingError as error:
        raise SettingError(
            f"{building.name} has a mode without damping, so that its rms values do not exist; give every mode damping"
        ) from error
    # A variance of zero may be rounded below it; a mode that the ground does not excite still needs a scale.
    rms = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    rms = np.maximum(rms, 1e-9 * rms.max())
    frequency = float(building.frequencies[0])
    A, B = A / rms[:, None] * rms, B / rms[:, None]
    shaking = intensity / np.outer(rms, rms)
    noise = shaking + PROCESS_NOISE**2 * frequency * np.eye(len(A))
    names = outputs.of_plant(plant)
    C = np.hstack([names.C @ modes, np.outer(names.G, soil.output)]) * rms
    rates = deformation_rates(plant).C @ modes
    continuous = DesignSystem(
        A=A,
        B=B,
        noise=noise,
        ground=shaking,
        step=0.0,
        C=C,
        D=names.D,
        rates=np.hstack([rates, np.zeros((plant.n_devices, n_soil))]) * rms,
        force=np.zeros((plant.n_devices, len(A))),
        direct=np.eye(plant.n_devices),
        state=np.hstack([modes, np.zeros((2 * n, n_soil))]) * rms,
        uncontrolled=LyapunovEquations(A).covariance(noise),
    )
    return continuous if timing is None else _sample(continuous, timing, budgets, frequency)


USEFUL_SHARE = 0.2
"""Rms force over the inertia of the building beyond which more force hardly lowers any rms response."""


def useful_force(plant: Plant, spectrum: SpectralDensity) -> float:
    """Rms force [N] beyond which limits have no use for more: a fifth of the rms inertia without control.

    The inertia is the mass of the building times the largest rms acceleration of a floor. With this force in its first
    storey the least ratio of the rms drifts of the five-storey frame is within 4 % of that with any force.
    """
    limits = LimitedOutputs.of(RmsLimits(rms_acceleration=1.0), plant)
    system = design_system(plant, limits, spectrum, budgets=np.ones(plant.n_devices))
    return USEFUL_SHARE * plant.building.total_mass * float(system.rms_without_control().max())


def _sample(continuous: DesignSystem, timing: LoopTiming, budgets: Floats, frequency: float) -> DesignSystem:
    """Building, soil and driver between samples with the command held, and a chain of past commands for the delay.

    Commands and forces in the chain are in budgets.
    """
    n, m = continuous.B.shape
    A, B, noise, ground = continuous.A, continuous.B, continuous.noise, continuous.ground
    own = PROCESS_NOISE**2 * frequency
    force_states = 0
    if timing.driver_rate is not None:
        force_states = m
        A = np.block([[A, B * budgets], [np.zeros((m, n)), -timing.driver_rate * np.eye(m)]])
        B = np.vstack([np.zeros((n, m)), timing.driver_rate * np.diag(1.0 / budgets)])
        noise = scipy.linalg.block_diag(noise, own * np.eye(m))
        ground = scipy.linalg.block_diag(ground, np.zeros((m, m)))
    transition, held, added = _hold_input(A, B, noise, timing.sample_time)
    size, delay = len(A), timing.delay_samples
    whole = size + delay * m
    forward = np.zeros((whole, whole))
    entry = np.zeros((whole, m))
    covariance = timing.sample_time * own * np.eye(whole)
    forward[:size, :size], covariance[:size, :size] = transition, added
    if delay:
        # The oldest command acts; the newest enters at the end of the chain.
        forward[:size, size : size + m] = held * budgets
        forward[size : whole - m, size + m :] = np.eye(whole - m - size)
        entry[whole - m :] = np.diag(1.0 / budgets)
    else:
        entry[:size] = held
    force, direct = np.zeros((m, whole)), np.zeros((m, m))
    if force_states:
        force[:, n:size] = np.diag(budgets)
    elif delay:
        force[:, size : size + m] = np.diag(budgets)
    else:
        direct = np.eye(m)
    step = timing.sample_time
    wide = (0, whole - n)
    shaken = np.zeros((whole, whole))
    shaken[:size, :size] = _hold_input(A, B, ground, step)[2]
    A_step, noise_step = (forward - np.eye(whole)) / step, covariance / step
    return DesignSystem(
        A=A_step,
        B=entry / step,
        noise=noise_step,
        ground=shaken / step,
        step=step,
        C=np.pad(continuous.C, ((0, 0), wide)) + continuous.D @ force,
        D=continuous.D @ direct,
        rates=np.pad(continuous.rates, ((0, 0), wide)),
        force=force,
        direct=direct,
        state=np.pad(continuous.state, ((0, 0), wide)),
        uncontrolled=LyapunovEquations(A_step, step).covariance(noise_step),
    )


def _hold_input(A: Floats, B: Floats, noise: Floats, step: float) -> tuple[Floats, Floats, Floats]:
    """Transition, effect of a held input, and covariance of the noise of a step (Van Loan, IEEE TAC 23(3), 1978)."""
    n = len(A)
    pair = scipy.linalg.expm(step * np.block([[-A, noise], [np.zeros((n, n)), A.T]]))
    transition = pair[n:, n:].T
    return transition, hold_input(A, B, step)[1], symmetric(transition @ pair[:n, n:])
