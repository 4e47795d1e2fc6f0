"""Designs without a model of the building: constant command, local feedback, friction, fuzzy rules."""

from __future__ import annotations

from dataclasses import dataclass

from mrwork.control.designs.problem import Design, DesignProblem
from mrwork.control.fuzzy import fuzzy_table
from mrwork.errors import InvalidSettingError
from mrwork.keys import check_keys, key


@dataclass(frozen=True, slots=True, kw_only=True)
class NoSettings:
    """A law without settings."""

    def design(self, problem: DesignProblem) -> Design:
        """No gains."""
        return Design()


@dataclass(frozen=True, slots=True, kw_only=True)
class PassiveSettings:
    """A constant command."""

    command: float = key("the command that is held constant, up to the largest", unit="A or V", least=0.0)

    def __post_init__(self) -> None:
        check_keys(self)

    def design(self, problem: DesignProblem) -> Design:
        """The command of each device."""
        largest = min(device.largest_command for device in problem.devices)
        if self.command > largest:
            raise InvalidSettingError(
                "command", f"command is {self.command:g}, and the driver gives {largest:g} at most"
            )
        return Design(gains={"command": problem.each(self.command)})


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionSettings:
    """Friction in proportion to the last peak elongation."""

    slope: float = key("wanted friction per elongation", unit="N/m", above=0.0)

    def __post_init__(self) -> None:
        check_keys(self)

    def design(self, problem: DesignProblem) -> Design:
        """The slope of each device."""
        return Design(gains={"slope": problem.each(self.slope)})


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzySettings:
    """Scales of the inputs of the fuzzy controller."""

    deformation: float = key("scale of the elongation", unit="m", above=0.0)
    rate: float = key("scale of the rate of elongation", unit="m/s", above=0.0)

    def __post_init__(self) -> None:
        check_keys(self)

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
