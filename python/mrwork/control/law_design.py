"""Design of a control law from its name and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from mrwork.control.design_problem import DesignProblem
from mrwork.control.law_settings import SETTINGS, LawSettings
from mrwork.control.laws import ControlLaw, control_law
from mrwork.errors import SettingError
from mrwork.keys import described, is_required


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
