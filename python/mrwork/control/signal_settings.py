"""Settings of the laws that are functions of measured signals: a learned network, a polynomial."""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.control.design_problem import Design, DesignProblem
from mrwork.control.laws import control_law
from mrwork.control.regulator_settings import RegulatorSettings
from mrwork.control.setting_base import Span
from mrwork.errors import InvalidSettingError
from mrwork.keys import key

Floats = NDArray[np.float64]
Rows = tuple[tuple[float, ...], ...]

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

    deformation: float = key(
        "scale of the elongation",
        unit="m",
        above=0.0,
        span=Span(lower=0.3, upper=3.0, start=1.0, of=(("stroke", 1.0),), free=False),
    )
    rate: float = key(
        "scale of the rate of elongation",
        unit="m/s",
        above=0.0,
        span=Span(lower=0.3, upper=3.0, start=1.0, of=(("rate", 1.0),), free=False),
    )
    force: float = key(
        "scale of the force and of the wanted force of a device with all its dampers",
        unit="N",
        above=0.0,
        span=Span(lower=0.3, upper=3.0, start=1.0, of=(("force", 1.0),), free=False),
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
@dataclass(frozen=True, slots=True, kw_only=True)
class SignalNetworkSettings(SignalSettings):
    """A regulator with a small network of measured signals, whose numbers are learned; all devices have the same."""

    network: tuple[float, ...] = key(
        "for each of four hidden units its bias, the weights of elongation, rate, force and wanted force over their "
        "scales, and its weight in the output; last the bias of the output; 25 numbers, which mrwork tune finds",
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
@dataclass(frozen=True, slots=True, kw_only=True)
class SignalPolynomialSettings(SignalSettings):
    """A regulator with a polynomial of measured signals, each over its scale and within -1 to 1."""

    terms: Rows = key(
        "a row for each term: its coefficient and the powers of elongation, rate, force and wanted force; by default "
        "the product of the forces",
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
