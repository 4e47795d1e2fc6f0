"""The settings of every control law by name, and the design of a law from its settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Protocol

from mrwork.control.designs.feedback import FrictionSettings, FuzzySettings, NoSettings, PassiveSettings
from mrwork.control.designs.problem import Design, DesignProblem
from mrwork.control.designs.regulators import (
    ClippedSettings,
    LyapunovSettings,
    NetworkSettings,
    ProportionalSettings,
    RegulatorSettings,
)
from mrwork.control.designs.sliding import AdaptiveSlidingSettings, SlidingSettings, SuperTwistingSettings
from mrwork.control.laws import ControlLaw, control_law
from mrwork.errors import SettingError
from mrwork.keys import described, is_required


class LawSettings(Protocol):
    """Settings of a control law, with its design."""

    def design(self, problem: DesignProblem) -> Design:
        """The gains of the law for a building with its devices."""


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
    "lyapunov_direct_bang_bang": LyapunovSettings,
    "proportional_direct": ProportionalSettings,
    "inverse_direct": RegulatorSettings,
    "inverse_network": NetworkSettings,
    "active": RegulatorSettings,
}
"""Settings by name of the law."""


def settings_of(name: str, given: Mapping[str, Any]) -> LawSettings:
    """The settings of a law from values by name, in SI.

    Raises
    ------
    UnknownNameError
        If there is no such law.
    SettingError
        If a setting is unknown or missing, or a number is out of range.
    """
    control_law(name)
    kind = SETTINGS[name]
    known = {entry.name: entry for entry in fields(kind)}  # type: ignore[arg-type] # every class is a dataclass
    for each in given:
        if each not in known:
            raise SettingError(f"{name} has no setting {each!r}; it has {', '.join(known) or 'none'}")
    for each, entry in known.items():
        if each not in given and is_required(entry):
            raise SettingError(f"{name} has no {each}; give {described(entry)}")
    return kind(**{each: tuple(value) if isinstance(value, list) else value for each, value in given.items()})


def design_law(name: str, problem: DesignProblem, **settings: Any) -> ControlLaw:
    """Design a control law on a building with its devices.

    Parameters
    ----------
    name
        Name of the law, see `control_laws`.
    problem
        The building, its devices and the sample time of the loop.
    settings
        Settings of the law, in SI; `mrwork respond --laws` lists them.

    Raises
    ------
    UnknownNameError
        If there is no such law.
    SettingError
        If a setting is unknown, missing or out of range, or the law cannot be designed for this building.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> problem = mr.control.DesignProblem(building=frame, devices=[damper], sample_time=1e-3)
    >>> law = mr.control.design_law("clipped_optimal", problem, control_weight=1e-7)
    >>> law.gains["gain"].shape
    (1, 10)
    """
    return law_of(name, settings_of(name, settings), problem)


def law_of(name: str, settings: LawSettings, problem: DesignProblem) -> ControlLaw:
    """The law with the gains that follow from its settings."""
    design = settings.design(problem)
    curve = problem.curve if control_law(name).wants_curve else None
    return ControlLaw(name=name, gains=design.gains, tables=design.tables, curve=curve)
