"""Settings of the laws that are designed from a linear quadratic regulator; some are functions of measured signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np

from mrwork.arguments import checked
from mrwork.control.design_problem import (
    NO_CERTIFICATE,
    Design,
    DesignProblem,
    LawSettings,
    Magnitude,
    Span,
    attempt_each,
)
from mrwork.control.inverse_network import InverseNetwork, train_inverse_network
from mrwork.control.laws import control_law
from mrwork.control.lqr import MatrixRows, Regulator, Weights, regulator_of_weights, regulators_of_costs
from mrwork.control.plant import Plant
from mrwork.control.weights import CostWeights
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.keys import key
from mrwork.values import Floats


@checked
class RegulatorSettings(CostWeights, LawSettings):
    """A linear quadratic regulator; without weights of outputs or states it weighs the energy of the building."""

    is_regulator: ClassVar[bool] = True
    weighed_by_default: ClassVar[Mapping[str, float]] = {"drifts": 1.0}
    control_weight: Weights = key(
        "R of the forces, each the force of a device with all its dampers; with designed weights, 1 is R as designed",
        unit="1/N2",
        above=0.0,
        matrix=True,
        span=Span(lower=1e-6, upper=10.0, of=(("cost", 1.0), ("force", -2.0))),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The gain of the regulator, or that of a sampled design."""
        gain = self.sampled_gain(problem) if self.sampled else self.regulator(problem).gain
        return self.of_gain(problem, gain)

    def of_gain(self, problem: DesignProblem, gain: Floats) -> Design:
        """The design that follows from the gain of the desired forces."""
        return Design(gains={"gain": gain})

    def sampled_gain(self, problem: DesignProblem) -> Floats:
        """The gain of least cost in the sampled loop, with `control_weight` times R as designed."""
        assert self.designed is not None
        self.check_designed_alone()
        if not isinstance(self.control_weight, float | int):
            raise InvalidSettingError(
                "control_weight",
                "control_weight of a sampled design is one number, the size of R over R as designed; give one",
            )
        return self.designed.of_problem(problem).gain_with(self.control_weight)

    def regulator(self, problem: DesignProblem) -> Regulator:
        """The regulator with these weights."""
        plant = problem.plant
        return regulator_of_weights(plant, self.weigh_outputs(plant), self.control_weight_of(plant))

    def control_weight_of(self, plant: Plant) -> Weights:
        """R of the devices; one number with designed weights keeps the ratios of the design."""
        if self.designed is None or not isinstance(self.control_weight, float | int):
            return self.control_weight
        return tuple(self.control_weight * each for each in self.designed.relative_control_weight(plant))

    @classmethod
    def designs(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Design | SettingError]:
        """The designs of many settings, all their regulators by one call of the compiled solver."""
        plant = problem.plant
        sampled = iter(
            attempt_each(lambda each: each.sampled_gain(problem), [each for each in many if each.sampled])
        )
        regulators = iter(
            regulators_of_costs(
                plant,
                attempt_each(
                    lambda each: (each.weigh_outputs(plant), each.control_weight_of(plant)),
                    [each for each in many if not each.sampled],
                ),
            )
        )
        outcomes: list[Design | SettingError] = []
        for settings in many:
            known = next(sampled if settings.sampled else regulators)
            gain = known.gain if isinstance(known, Regulator) else known
            outcomes.append(gain if isinstance(gain, SettingError) else settings.of_gain(problem, gain))
        return outcomes

    def certificate(self, problem: DesignProblem) -> str:
        """Stability of the linear loop of the regulator, or of a sampled design."""
        if self.sampled:
            return self._sampled_certificate(problem)
        regulator = self.regulator(problem)
        slowest = float(-regulator.poles.real.max())
        return (
            f"with ideal forces the loop is stable, its slowest pole decays at {slowest:.3g} 1/s, and no other gain "
            f"has a lower cost of these weights (residual of the Riccati equation {regulator.residual:.1e}); the "
            "damper, which only resists motion and saturates, is not covered"
        )

    def _sampled_certificate(self, problem: DesignProblem) -> str:
        assert self.designed is not None
        system = self.designed.of_problem(problem).system
        closed = np.eye(system.n_states) + system.step * (
            system.A - system.B @ self.sampled_gain(problem) @ system.state
        )
        if not np.abs(np.linalg.eigvals(closed)).max() < 1.0:
            return NO_CERTIFICATE
        return (
            "with ideal forces behind the driver the sampled loop with its delay is stable, and no gain near this one "
            "has a lower cost of the designed weights; the damper, which only resists motion and saturates, is not "
            "covered"
        )


@checked
class ClippedSettings(RegulatorSettings):
    """A regulator with a command in proportion to the desired force."""

    full_force: float = key(
        "desired force of a device with all its dampers at which the largest command is sent",
        unit="N",
        above=0.0,
        span=Span(lower=0.03, upper=10.0, of=(("force", 1.0),)),
    )

    def of_gain(self, problem: DesignProblem, gain: Floats) -> Design:
        """The gain, and the full force of each device."""
        return Design(gains={"gain": gain, "full_force": problem.each(self.full_force)})


def _about(magnitude: Magnitude) -> Span:
    """Range of a setting that is usually held at a magnitude of the response."""
    return Span(lower=0.3, upper=3.0, start=1.0, of=((magnitude, 1.0),), free=False)


# The network of a device does not depend on the regulator, of which a search tries many.
_trained_network = lru_cache(maxsize=32)(train_inverse_network)


@checked
class NetworkSettings(RegulatorSettings):
    """A regulator with a neural network from the desired force to the command.

    The network is that of the first device, with all its dampers; all devices have it.
    """

    amplitude: float = key("expected peak damper displacement", unit="m", above=0.0, span=_about("stroke"))
    velocity: float = key("expected peak damper velocity", unit="m/s", above=0.0, span=_about("rate"))
    hidden: int = key("units of the hidden layer", default=12, least=1)
    seed: int = key("seed of the training", default=0, least=0)

    def of_gain(self, problem: DesignProblem, gain: Floats) -> Design:
        """The gain, and the trained network."""
        device = problem.devices[0]
        network = _trained_network(
            device.spec,
            tuple(device.draws[0].tolist()),
            largest_command=device.largest_command,
            amplitude=self.amplitude,
            velocity=self.velocity,
            sample_time=problem.sample_time,
            n_hidden=self.hidden,
            count=device.count,
            differential=device.differential,
            rng=self.seed,
        )
        return Design(gains={"gain": gain}, tables=_network_tables(network))


def _network_tables(network: InverseNetwork) -> dict[str, Floats]:
    """The network with its scales included, and the range of its inputs.

    Each row of the layer belongs to a hidden unit: bias, weights of its inputs, weight in the output.
    """
    layer = np.column_stack([network.b1, network.W1 / network.input_scale, network.w2 * network.output_scale])
    output = np.array([network.b2 * network.output_scale])
    return {"layer": layer.ravel(), "output": output, "reach": network.input_scale}


_SIGNALS, _MOST_POWERS = 4, 9
_NEAR_CLIPPED = (
    (-0.66, 0.0, 0.0, 1.0, 1.0, 2.0),
    (-0.66, 0.0, 0.0, -1.0, 1.0, -2.0),
    (-0.66, 0.0, 0.0, 1.0, 0.0, -4.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)
_NEAR_CLIPPED_BIAS = -4.6
"""A network that is about the clipped-optimal law: (f_c - f) f of the two forces as a sum of even functions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalSettings(RegulatorSettings):
    """A regulator, and the scales of the signals of a device: elongation, its rate, and the two forces."""

    deformation: float = key("scale of the damper displacement", unit="m", above=0.0, span=_about("stroke"))
    rate: float = key("scale of the damper velocity", unit="m/s", above=0.0, span=_about("rate"))
    force: float = key(
        "scale of the force and of the desired force of a device with all its dampers",
        unit="N",
        above=0.0,
        span=_about("force"),
    )

    def certificate(self, problem: DesignProblem) -> str:
        """The range of the command."""
        return (
            "the command is between 0 and the largest one for any numbers of the law and any signals, so the damper "
            "remains the passive device that it is at each command; nothing is proved of the response"
        )

    @property
    def scales(self) -> Floats:
        """Scale of each signal, shape (4,)."""
        return np.array([self.deformation, self.rate, self.force, self.force])


@checked
class SignalNetworkSettings(SignalSettings):
    """A regulator with a small network of measured signals, whose numbers are learned; all devices have the same."""

    network: tuple[float, ...] = key(
        "for each of four hidden units its bias, the weights of displacement, velocity, force and desired force over "
        "their scales, and its weight in the output; last the bias of the output; 25 numbers, which mrwork tune finds",
        span=Span(
            lower=-8.0,
            upper=8.0,
            scale="linear",
            entries=(*(number for unit in _NEAR_CLIPPED for number in unit), _NEAR_CLIPPED_BIAS),
        ),
    )

    def of_gain(self, problem: DesignProblem, gain: Floats) -> Design:
        """The gain, and the network for signals in SI units."""
        numbers = next(gain.numbers for gain in control_law("signal_network").gains if gain.name == "network")
        if len(self.network) != numbers:
            raise InvalidSettingError("network", f"network has {len(self.network)} numbers; give {numbers}")
        network = np.array(self.network)
        network[:-1].reshape(-1, _SIGNALS + 2)[:, 1:-1] /= self.scales
        return Design(gains={"gain": gain, "network": np.tile(network, (len(problem.devices), 1))})


@checked
class SignalPolynomialSettings(SignalSettings):
    """A regulator with a polynomial of measured signals, each over its scale and within -1 to 1."""

    terms: MatrixRows = key(
        "a row for each term: its coefficient and the powers of displacement, velocity, force and desired force; by "
        "default the product of the forces",
        default=((1.0, 0.0, 0.0, 1.0, 1.0),),
    )

    def of_gain(self, problem: DesignProblem, gain: Floats) -> Design:
        """The gain, and the terms."""
        if not self.terms or {len(row) for row in self.terms} != {_SIGNALS + 1}:
            raise InvalidSettingError(
                "terms", "terms has rows of another length than 5; give a coefficient and four powers in each"
            )
        powers = np.array(self.terms)[:, 1:]
        if not np.isin(powers, np.arange(_MOST_POWERS + 1)).all():
            raise InvalidSettingError(
                "terms",
                f"terms has a power that is no whole number from 0 to {_MOST_POWERS}; give such powers",
            )
        return Design(gains={"gain": gain}, tables={"terms": np.ravel(self.terms), "reach": self.scales})
