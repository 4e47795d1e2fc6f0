"""Settings of the control laws, and the design of a law from its settings.

Each class declares the settings of one or several laws; `design` returns the gains and tables of the law for a building
with its devices. `SETTINGS` names the class of each law.
"""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import checked
from mrwork.control.design_problem import Design, DesignProblem
from mrwork.control.fuzzy import fuzzy_table
from mrwork.control.lqr import regulators_of_weights
from mrwork.control.lyapunov import lyapunov_functions
from mrwork.control.plant import Plant
from mrwork.control.regulator_settings import ClippedSettings, NetworkSettings, RegulatorSettings
from mrwork.control.setting_base import LawSettings, Span, attempted, solved_together
from mrwork.control.signal_settings import SignalNetworkSettings, SignalPolynomialSettings
from mrwork.control.surface_settings import (
    AdaptiveSlidingSettings,
    SlidingSettings,
    SuperTwistingSettings,
)
from mrwork.control.weights import CostWeights, Weighed, Weights
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.keys import key

Floats = NDArray[np.float64]


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class NoSettings(LawSettings):
    """A law without settings."""

    def design(self, problem: DesignProblem) -> Design:
        """No gains."""
        return Design()


@checked
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
        largest = min((device.largest_command for device in problem.devices), default=math.inf)
        if self.command > largest:
            raise InvalidSettingError(
                "command", f"command is {self.command:g}, and the driver gives {largest:g} at most"
            )
        return Design(gains={"command": problem.each(self.command)})


@checked
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


@checked
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


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class LyapunovSettings(CostWeights, LawSettings):
    """A Lyapunov function; without weights of outputs or states its weight is the energy of the building.

    Weights of accelerations count those of the building without device forces: `V' = -s'Q_P s / 2 + sigma f` holds for
    any Q_P of the state alone.
    """

    weighed_by_default: ClassVar[Mapping[str, float]] = {"drifts": 1.0}

    def design(self, problem: DesignProblem) -> Design:
        """The gains that follow from the weight of the state."""
        (found,) = type(self).designs(problem, [self])
        if isinstance(found, SettingError):
            raise found
        return found

    @classmethod
    def designs(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Design | SettingError]:
        """The designs of many settings, all their equations by one call of the compiled solver."""
        return [
            vectors if isinstance(vectors, SettingError) else settings.of_vectors(problem, vectors)
            for settings, vectors in zip(many, cls.weight_vectors(problem.plant, many), strict=True)
        ]

    @classmethod
    def weight_vectors(cls, plant: Plant, many: Sequence[Self]) -> list[Floats | SettingError]:
        """Weight of the state of each, shape (n_devices, 2n): B'P of the Lyapunov function."""
        return _lyapunov_vectors(plant, many)

    def of_vectors(self, problem: DesignProblem, vectors: Floats) -> Design:
        """The design that follows from this weight of the state."""
        return Design(gains={"weight": vectors})

    def certificate(self, problem: DesignProblem) -> str:
        """The Lyapunov function of the building."""
        return (
            "V = s'P s / 2 is a Lyapunov function of the building without device forces, and the law sends a command "
            "where that lowers the rate of V; a damper that resists motion keeps the energy of the building bounded"
        )


@checked
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

    @classmethod
    def weight_vectors(cls, plant: Plant, many: Sequence[Self]) -> list[Floats | SettingError]:
        """Weight of the state of each: of the regulator with a control weight, of the Lyapunov function without."""
        regulated = iter(
            _regulator_vectors(plant, [each for each in many if each.control_weight is not None])
        )
        free = iter(_lyapunov_vectors(plant, [each for each in many if each.control_weight is None]))
        return [next(free if each.control_weight is None else regulated) for each in many]

    def of_vectors(self, problem: DesignProblem, vectors: Floats) -> Design:
        """Weight of the state, and the slope of each device."""
        return Design(gains={"weight": vectors, "slope": problem.each(self.slope)})


def _lyapunov_vectors(plant: Plant, many: Sequence[LyapunovSettings]) -> list[Floats | SettingError]:
    found = solved_together(
        lambda weights: lyapunov_functions(plant, weights),
        attempted(lambda each: each.weighed(plant).Q, many),
    )
    return [each if isinstance(each, SettingError) else each.vectors for each in found]


def _regulator_vectors(plant: Plant, many: Sequence[ProportionalSettings]) -> list[Floats | SettingError]:
    def cost(each: ProportionalSettings) -> tuple[Weighed, ArrayLike]:
        assert each.control_weight is not None
        return each.weighed(plant), each.control_weight

    found = solved_together(
        lambda sound: regulators_of_weights(plant, [one for one, _ in sound], [R for _, R in sound]),
        attempted(cost, many),
    )
    return [each if isinstance(each, SettingError) else each.vectors for each in found]


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
    "signal_network": SignalNetworkSettings,
    "signal_polynomial": SignalPolynomialSettings,
    "active": RegulatorSettings,
}
"""Settings by name of the law."""
