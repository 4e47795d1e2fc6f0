"""Settings of the control laws, and the design of a law from its settings.

Each class declares the settings of one or several laws; `design` returns the gains and tables of the law for a building
with its devices. `SETTINGS` names the class of each law.
"""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.control.design_problem import Design, DesignProblem
from mrwork.control.fuzzy import fuzzy_table
from mrwork.control.inverse_network import InverseNetwork, train_inverse_network
from mrwork.control.lqr import Regulator, regulator_of_weights
from mrwork.control.lyapunov import LyapunovFunction, lyapunov_function
from mrwork.control.plant import Plant
from mrwork.control.sliding import SlidingGains, SlidingSurface, optimal_surface, sliding_gains
from mrwork.control.weights import CostWeights, Weights
from mrwork.errors import InvalidSettingError
from mrwork.keys import DeclaredTable, check_keys, key, plain_values

Floats = NDArray[np.float64]


class LawSettings(metaclass=DeclaredTable):
    """Settings of a control law, declared by `key`, with the design of the law.

    `constant` says whether the law sends a constant command, which makes the damper a passive one.
    """

    __slots__ = ()
    constant: ClassVar[bool] = False

    def __post_init__(self) -> None:
        plain_values(self)
        check_keys(self)

    @abstractmethod
    def design(self, problem: DesignProblem) -> Design:
        """The gains of the law for a building with its devices."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoSettings(LawSettings):
    """A law without settings."""

    def design(self, problem: DesignProblem) -> Design:
        """No gains."""
        return Design()


@dataclass(frozen=True, slots=True, kw_only=True)
class PassiveSettings(LawSettings):
    """A constant command."""

    constant: ClassVar[bool] = True
    command: float = key("the command that is held constant, up to the largest", unit="A or V", least=0.0)

    def design(self, problem: DesignProblem) -> Design:
        """The command of each device."""
        largest = min(device.largest_command for device in problem.devices)
        if self.command > largest:
            raise InvalidSettingError(
                "command", f"command is {self.command:g}, and the driver gives {largest:g} at most"
            )
        return Design(gains={"command": problem.each(self.command)})


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionSettings(LawSettings):
    """Friction in proportion to the last peak elongation."""

    slope: float = key(
        "wanted friction of a device with all its dampers, per elongation", unit="N/m", above=0.0
    )

    def design(self, problem: DesignProblem) -> Design:
        """The slope of each device."""
        return Design(gains={"slope": problem.each(self.slope)})


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzySettings(LawSettings):
    """Scales of the inputs of the fuzzy controller."""

    deformation: float = key("scale of the elongation", unit="m", above=0.0)
    rate: float = key("scale of the rate of elongation", unit="m/s", above=0.0)

    def design(self, problem: DesignProblem) -> Design:
        """Scales of the inputs and the table of commands."""
        table = fuzzy_table(deformation_scale=self.deformation, rate_scale=self.rate)
        return Design(
            gains={
                "deformation_scale": problem.each(self.deformation),
                "rate_scale": problem.each(self.rate),
            },
            tables={"shares": table.share.ravel()},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RegulatorSettings(CostWeights, LawSettings):
    """A linear quadratic regulator; without weights of outputs or states it weighs the energy of the building."""

    control_weight: Weights = key(
        "R of the forces [1/N2], each the force of a device with all its dampers", above=0.0, matrix=True
    )

    def design(self, problem: DesignProblem) -> Design:
        """The gain of the regulator."""
        return Design(gains={"gain": self.regulator(problem).gain})

    def regulator(self, problem: DesignProblem) -> Regulator:
        """The regulator with these weights."""
        plant = problem.plant
        return regulator_of_weights(plant, self.weighed(plant), self.control_weight)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClippedSettings(RegulatorSettings):
    """A regulator with a command in proportion to the wanted force."""

    full_force: float = key(
        "wanted force of a device with all its dampers at which the largest command is sent",
        unit="N",
        above=0.0,
    )

    def design(self, problem: DesignProblem) -> Design:
        """The gain, and the full force of each device."""
        gain = self.regulator(problem).gain
        return Design(gains={"gain": gain, "full_force": problem.each(self.full_force)})


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkSettings(RegulatorSettings):
    """A regulator with a neural network from the wanted force to the command.

    The network is that of the first device, with all its dampers; all devices have it.
    """

    amplitude: float = key("expected peak elongation", unit="m", above=0.0)
    velocity: float = key("expected peak rate of elongation", unit="m/s", above=0.0)
    hidden: int = key("units of the hidden layer", default=12, least=1)
    seed: int = key("seed of the training", default=0, least=0)

    def design(self, problem: DesignProblem) -> Design:
        """The gain, and the trained network."""
        device = problem.devices[0]
        network = train_inverse_network(
            device.spec,
            device.draws[0],
            largest_command=device.largest_command,
            amplitude=self.amplitude,
            velocity=self.velocity,
            sample_time=problem.sample_time,
            n_hidden=self.hidden,
            count=device.count,
            differential=device.differential,
            rng=self.seed,
        )
        return Design(gains={"gain": self.regulator(problem).gain}, tables=_network_tables(network))


def _network_tables(network: InverseNetwork) -> dict[str, Floats]:
    """The network with its scales included, and the range of its inputs.

    Each row of the layer belongs to a hidden unit: bias, weights of its inputs, weight in the output.
    """
    layer = np.column_stack([network.b1, network.W1 / network.input_scale, network.w2 * network.output_scale])
    output = np.array([network.b2 * network.output_scale])
    return {"layer": layer.ravel(), "output": output, "reach": network.input_scale}


@dataclass(frozen=True, slots=True, kw_only=True)
class LyapunovSettings(CostWeights, LawSettings):
    """A Lyapunov function; without weights of outputs or states its weight is the energy of the building.

    Weights of accelerations count those of the building without device forces: `V' = -s'Q_P s / 2 + sigma f` holds for
    any Q_P of the state alone.
    """

    def design(self, problem: DesignProblem) -> Design:
        """Weight of the state."""
        return Design(gains={"weight": self.function(problem.plant).vectors})

    def function(self, plant: Plant) -> LyapunovFunction:
        """The Lyapunov function with these weights."""
        return lyapunov_function(plant, self.weighed(plant).Q)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalSettings(LyapunovSettings):
    """The smooth law kappa sigma G; with a control weight sigma is that of a regulator with the same weights."""

    slope: float = key(
        "kappa [A or V, per unit of sigma G]; G is the slope of the force of a device with all its dampers",
        above=0.0,
    )
    control_weight: Weights | None = key(
        "R of that regulator [1/N2]; of the forces of devices with all their dampers",
        default=None,
        above=0.0,
        matrix=True,
    )

    def design(self, problem: DesignProblem) -> Design:
        """Weight of the state, and the slope of each device."""
        plant = problem.plant
        if self.control_weight is None:
            weight = self.function(plant).vectors
        else:
            weight = regulator_of_weights(plant, self.weighed(plant), self.control_weight).vectors
        return Design(gains={"weight": weight, "slope": problem.each(self.slope)})


@dataclass(frozen=True, slots=True, kw_only=True)
class _SurfaceSettings(LawSettings):
    """A sliding surface of least energy of the building, with gains for ground motions of a given peak."""

    peak_acceleration: float = key("peak acceleration of the ground motions", unit="m/s2", above=0.0)
    largest_force: float = key("largest force of each device with all its dampers", unit="N", above=0.0)
    frequency: float = key(
        "highest frequency at which the ground reaches its peak acceleration",
        unit="Hz",
        default=5.0,
        above=0.0,
    )
    margin: float = key("switching force over the disturbance", default=1.2, above=1.0)
    bandwidth: float = key(
        "bandwidth inside the boundary layer; below that of the driver", unit="1/s", default=100.0, above=0.0
    )

    def _surface(self, problem: DesignProblem) -> tuple[SlidingSurface, SlidingGains]:
        surface = optimal_surface(problem.plant)
        gains = sliding_gains(
            surface,
            peak_acceleration=self.peak_acceleration,
            largest_force=self.largest_force,
            frequency=self.frequency,
            margin=self.margin,
            bandwidth=self.bandwidth,
        )
        return surface, gains


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingSettings(_SurfaceSettings):
    """A sliding mode with a boundary layer."""

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        surface, gains = self._surface(problem)
        return Design(gains={**_pushed_down(surface, gains), "switching": gains.switching})


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveSlidingSettings(_SurfaceSettings):
    """A sliding mode whose gain adapts."""

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        surface, gains = self._surface(problem)
        adapted = {"adaptation": gains.adaptation, "floor": gains.floor, "ceiling": gains.ceiling}
        return Design(gains={**_pushed_down(surface, gains), **adapted})


@dataclass(frozen=True, slots=True, kw_only=True)
class SuperTwistingSettings(_SurfaceSettings):
    """A second-order sliding mode."""

    def design(self, problem: DesignProblem) -> Design:
        """Surface and gains."""
        surface, gains = self._surface(problem)
        return Design(
            gains={
                "surface": surface.S,
                "drift": surface.drift,
                "push": problem.each(1.0),
                "root_gain": gains.proportional,
                "integral_gain": gains.integral,
            }
        )


def _pushed_down(surface: SlidingSurface, gains: SlidingGains) -> dict[str, Floats]:
    # In the loop the force decreases sigma, hence the sign.
    return {"gain": surface.drift, "surface": -surface.S, "boundary": gains.boundary}


SETTINGS: Mapping[str, type[LawSettings]] = {
    "passive": PassiveSettings,
    "clipped_optimal": RegulatorSettings,
    "modified_clipped_optimal": ClippedSettings,
    "proportional_clipped_optimal": ClippedSettings,
    "lyapunov": LyapunovSettings,
    "decentralised_bang_bang": NoSettings,
    "maximum_energy_dissipation": NoSettings,
    "modulated_homogeneous_friction": FrictionSettings,
    "sliding_mode": SlidingSettings,
    "adaptive_sliding_mode": AdaptiveSlidingSettings,
    "super_twisting": SuperTwistingSettings,
    "fuzzy": FuzzySettings,
    "lyapunov_direct": LyapunovSettings,
    "lyapunov_parabola": LyapunovSettings,
    "lyapunov_direct_bang_bang": LyapunovSettings,
    "proportional_direct": ProportionalSettings,
    "inverse_direct": RegulatorSettings,
    "inverse_parabola": RegulatorSettings,
    "inverse_network": NetworkSettings,
    "active": RegulatorSettings,
}
"""Settings by name of the law."""
