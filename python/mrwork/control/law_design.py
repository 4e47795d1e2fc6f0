"""Design of a control law from its name and settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.control.design_problem import DesignProblem
from mrwork.control.law_settings import SETTINGS, LawSettings
from mrwork.control.laws import ControlLaw, control_law
from mrwork.errors import SettingError

SettingValue = float | Sequence[float] | Sequence[Sequence[float]] | NDArray[np.float64] | None
"""A value of a setting of a control law; a weight may be an array or a matrix."""

_NO_SETTINGS: Final[Mapping[str, SettingValue]] = MappingProxyType({})


def settings_of(name: str, given: Mapping[str, SettingValue]) -> LawSettings:
    """The settings of a law from values by name, in SI.

    Raises
    ------
    UnknownNameError
        If there is no such law.
    SettingError
        If a setting is unknown or missing, or a number is out of range.
    """
    control_law(name)
    return SETTINGS[name](**given)


def design_law(
    name: str, problem: DesignProblem, settings: LawSettings | Mapping[str, SettingValue] = _NO_SETTINGS
) -> ControlLaw:
    """Design a control law on a building with its devices.

    Parameters
    ----------
    name
        Name of the law, see `control_laws`.
    problem
        The building, its devices and the sample time of the loop.
    settings
        Settings of the law, of the class in `SETTINGS`, or their values by name, in SI; `mrwork respond --laws` lists
        them.

    Raises
    ------
    UnknownNameError
        If there is no such law.
    SettingError
        If the settings are those of another law, one of them is unknown, missing or out of range, or the law cannot
        be designed for this building.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> problem = mr.control.DesignProblem(building=frame, devices=[damper], sample_time=1e-3)
    >>> law = mr.control.design_law(
    ...     "clipped_optimal", problem, mr.control.RegulatorSettings(control_weight=1e-7)
    ... )
    >>> law.gains["gain"].shape
    (1, 10)
    """
    spec = control_law(name)
    if isinstance(settings, Mapping):
        settings = settings_of(name, settings)
    elif type(settings) is not SETTINGS[name]:
        raise SettingError(
            f"the settings are {type(settings).__name__}; {name} takes {SETTINGS[name].__name__}"
        )
    design = settings.design(problem)
    curve = problem.curve if spec.needs_curve else None
    return ControlLaw(name=name, gains=design.gains, tables=design.tables, curve=curve)
