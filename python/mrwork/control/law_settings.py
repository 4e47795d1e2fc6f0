"""Settings of the control laws, and the design of a law from its settings.

Each class declares the settings of one or several laws; `design` returns the gains and tables of the law for a building
with its devices. `SETTINGS` names the class of each law.
"""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.control.design_problem import Design, DesignProblem
from mrwork.control.fuzzy import fuzzy_table
from mrwork.control.inverse_network import InverseNetwork, train_inverse_network
from mrwork.control.lqr import Regulator, regulator_of_weights
from mrwork.control.lyapunov import LyapunovFunction, lyapunov_function
from mrwork.control.plant import Plant
from mrwork.control.setting_base import LawSettings, Span
from mrwork.control.surface_settings import (
    AdaptiveSlidingSettings,
    SlidingSettings,
    SuperTwistingSettings,
)
from mrwork.control.weights import CostWeights, Weights
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import InvalidSettingError
from mrwork.keys import key

Floats = NDArray[np.float64]


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
    command: float = key(
        "the command that is held constant, up to the largest",
        unit="A or V",
        least=0.0,
        span=Span(lower=0.0, upper=1.0, of=(("command", 1.0),), scale="linear"),
    )

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
        "wanted friction of a device with all its dampers, per elongation",
        unit="N/m",
        above=0.0,
        span=Span(lower=0.03, upper=100.0, of=(("force", 1.0), ("stroke", -1.0))),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The slope of each device."""
        return Design(gains={"slope": problem.each(self.slope)})


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzySettings(LawSettings):
    """Scales of the inputs of the fuzzy controller."""

    deformation: float = key(
        "scale of the elongation",
        unit="m",
        above=0.0,
        span=Span(lower=0.1, upper=100.0, of=(("stroke", 1.0),)),
    )
    rate: float = key(
        "scale of the rate of elongation",
        unit="m/s",
        above=0.0,
        span=Span(lower=0.01, upper=10.0, of=(("rate", 1.0),)),
    )

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

    weighed_by_default: ClassVar[Mapping[str, float]] = {"drifts": 1.0}
    control_weight: Weights = key(
        "R of the forces [1/N2], each the force of a device with all its dampers; with designed weights, 1 is R as "
        "designed",
        above=0.0,
        matrix=True,
        span=Span(lower=1e-6, upper=10.0, of=(("cost", 1.0), ("force", -2.0))),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The gain of the regulator."""
        return Design(gains={"gain": self.regulator(problem).gain})

    def regulator(self, problem: DesignProblem) -> Regulator:
        """The regulator with these weights."""
        plant = problem.plant
        return regulator_of_weights(plant, self.weighed(plant), self.control_weight_of(plant))

    def control_weight_of(self, plant: Plant) -> Weights:
        """R of the devices; one number with designed weights keeps the ratios of the design."""
        if self.designed is None or not isinstance(self.control_weight, float | int):
            return self.control_weight
        return tuple(self.control_weight * each for each in self.designed.relative_control_weight(plant))

    def certificate(self, problem: DesignProblem) -> str:
        """Stability of the linear loop of the regulator."""
        regulator = self.regulator(problem)
        slowest = float(-regulator.poles.real.max())
        return (
            f"with ideal forces the loop is stable, its slowest pole decays at {slowest:.3g} 1/s, and no other gain "
            f"has a lower cost of these weights (residual of the Riccati equation {regulator.residual:.1e}); the "
            "damper, which only resists motion and saturates, is not covered"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClippedSettings(RegulatorSettings):
    """A regulator with a command in proportion to the wanted force."""

    full_force: float = key(
        "wanted force of a device with all its dampers at which the largest command is sent",
        unit="N",
        above=0.0,
        span=Span(lower=0.03, upper=10.0, of=(("force", 1.0),)),
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

    amplitude: float = key(
        "expected peak elongation",
        unit="m",
        above=0.0,
        span=Span(lower=0.3, upper=3.0, start=1.0, of=(("stroke", 1.0),), free=False),
    )
    velocity: float = key(
        "expected peak rate of elongation",
        unit="m/s",
        above=0.0,
        span=Span(lower=0.3, upper=3.0, start=1.0, of=(("rate", 1.0),), free=False),
    )
    hidden: int = key("units of the hidden layer", default=12, least=1)
    seed: int = key("seed of the training", default=0, least=0)

    def design(self, problem: DesignProblem) -> Design:
        """The gain, and the trained network."""
        device = problem.devices[0]
        network = _trained(
            device.spec,
            tuple(device.draws[0].tolist()),
            device.largest_command,
            self.amplitude,
            self.velocity,
            problem.sample_time,
            self.hidden,
            device.count,
            device.differential,
            self.seed,
        )
        return Design(gains={"gain": self.regulator(problem).gain}, tables=_network_tables(network))


@lru_cache(maxsize=32)
def _trained(
    spec: DamperSpec,
    theta: tuple[float, ...],
    largest_command: float,
    amplitude: float,
    velocity: float,
    sample_time: float,
    hidden: int,
    count: float,
    differential: bool,
    seed: int,
) -> InverseNetwork:
    """The network of a device; it does not depend on the regulator, of which a search tries many."""
    return train_inverse_network(
        spec,
        np.array(theta),
        largest_command=largest_command,
        amplitude=amplitude,
        velocity=velocity,
        sample_time=sample_time,
        n_hidden=hidden,
        count=count,
        differential=differential,
        rng=seed,
    )


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

    weighed_by_default: ClassVar[Mapping[str, float]] = {"drifts": 1.0}

    def design(self, problem: DesignProblem) -> Design:
        """Weight of the state."""
        return Design(gains={"weight": self.function(problem.plant).vectors})

    def function(self, plant: Plant) -> LyapunovFunction:
        """The Lyapunov function with these weights."""
        return lyapunov_function(plant, self.weighed(plant).Q)

    def certificate(self, problem: DesignProblem) -> str:
        """The Lyapunov function of the building."""
        return (
            "V = s'P s / 2 is a Lyapunov function of the building without device forces, and the command minimises its "
            "rate; a damper that resists motion keeps the energy of the building bounded"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalSettings(LyapunovSettings):
    """The smooth law kappa sigma G; with a control weight sigma is that of a regulator with the same weights."""

    slope: float = key(
        "kappa [A or V, per unit of sigma G]; G is the slope of the force of a device with all its dampers",
        above=0.0,
        span=Span(
            lower=1e-3,
            upper=1e4,
            of=(("command", 2.0), ("force", -1.0), ("rate", -1.0), ("energy", 1.0), ("cost", -1.0)),
        ),
    )
    control_weight: Weights | None = key(
        "R of that regulator [1/N2]; of the forces of devices with all their dampers",
        default=None,
        above=0.0,
        matrix=True,
        span=Span(lower=1e-6, upper=10.0, of=(("cost", 1.0), ("force", -2.0)), free=False),
    )

    def design(self, problem: DesignProblem) -> Design:
        """Weight of the state, and the slope of each device."""
        plant = problem.plant
        if self.control_weight is None:
            weight = self.function(plant).vectors
        else:
            weight = regulator_of_weights(plant, self.weighed(plant), self.control_weight).vectors
        return Design(gains={"weight": weight, "slope": problem.each(self.slope)})


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
