"""The settings class of every law, and the design of a law from its name and settings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Final

import numpy as np

from mrwork.base.arguments import May, Within, checked
from mrwork.base.keys import key, optional
from mrwork.base.remark import Remark
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.buildings.groups import commands_of
from mrwork.control.laws.control_law import ControlLaw, ControlLawSpec, LoopModel, control_law
from mrwork.control.laws.fuzzy import FuzzySettings
from mrwork.control.laws.gain_conventions import gain_remarks
from mrwork.control.laws.law_problem import Design, DesignProblem, LawSettings, Span, unlike_first
from mrwork.control.laws.lyapunov import LyapunovSettings, ProportionalSettings
from mrwork.control.laws.regulator_settings import (
    ClippedSettings,
    NetworkSettings,
    RegulatorSettings,
    SignalNetworkSettings,
)
from mrwork.control.laws.rollout import RolloutSettings
from mrwork.control.laws.sliding import AdaptiveSlidingSettings, SlidingSettings, SuperTwistingSettings
from mrwork.control.laws.weights import WeightWishes
from mrwork.errors import SettingError


@checked
class NoSettings(LawSettings):
    """A law without settings."""

    def design(self, problem: DesignProblem) -> Design:
        """A design without gains: the law takes nothing from the building."""
        return Design()


@checked
class PassiveSettings(LawSettings):
    """A constant command."""

    constant: ClassVar[bool] = True
    command: float | tuple[float, ...] = key(
        "the command that is held constant, up to the largest; several, one for each [[damper]] that follows one",
        unit="A or V",
        least=0.0,
        span=Span(lower=0.0, upper=1.0, of=(("command", 1.0),), scale="linear"),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The constant command of each device, at most its largest command [A or V]."""
        return Design(gains={"command": commands_of(problem.devices, self.command)})


@checked
class FrictionSettings(LawSettings):
    """Friction in proportion to the last peak elongation."""

    slope: float = key(
        "desired friction of a device with all its dampers, per displacement of a damper",
        unit="N/m",
        above=0.0,
        span=Span(lower=0.03, upper=100.0, of=(("force", 1.0), ("stroke", -1.0))),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The slope of each device [N/m]: desired friction per peak elongation."""
        return Design(gains={"slope": problem.each(self.slope)})


@checked
class MixedSkyhookSettings(LawSettings):
    """Skyhook below a crossover frequency, acceleration-driven damping above it."""

    crossover: Annotated[float, Within(above=0.0), May.BE_INFINITE] | None = optional(
        "frequency below which the law is skyhook, inf for skyhook alone; by default the square root of two times the "
        "first natural one, where a building of one storey transmits as much with little damping as with much",
        unit="Hz",
        span=Span(lower=0.05, upper=1.0, of=(("acceleration", 1.0), ("velocity", -1.0))),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The crossover of each device [rad/s]."""
        crossover = self.crossover or math.sqrt(2.0) * float(problem.building.frequencies[0])
        return Design(gains={"crossover": problem.each(2.0 * math.pi * crossover)})


@checked
class HybridSettings(LawSettings):
    """Skyhook for the sprung mass and groundhook for the unsprung one, in shares."""

    share: float = key(
        "share of skyhook in the command: 1 is skyhook, 0 groundhook, which needs `sprung` of each [[damper]]",
        least=0.0,
        most=1.0,
        default=1.0,
        span=Span(lower=0.0, upper=1.0, scale="linear", free=False),
    )

    def design(self, problem: DesignProblem) -> Design:
        """The share of each device."""
        without = [device.name for device in problem.devices if device.sprung is None]
        if without and self.share < 1.0:
            raise SettingError(
                f"groundhook damps the unsprung mass, and {without[0]} has no `sprung`; give it the name of the body, "
                'as sprung = "body", or a share of 1'
            )
        return Design(gains={"share": problem.each(self.share)})


SETTINGS: dict[str, type[LawSettings]] = {
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
    "active": RegulatorSettings,
    "acceleration_driven": NoSettings,
    "mixed_skyhook": MixedSkyhookSettings,
    "skyhook_groundhook": HybridSettings,
    "predictive_rollout": RolloutSettings,
}
"""Settings by name of the law; `own_law` adds those of laws of the user."""


SettingValue = (
    Annotated[float, May.BE_INFINITE] | bool | str | Sequence[float] | Sequence[str] | Sequence[Sequence[float]]
    | Floats | WeightWishes | Mapping[str, Any] | None
)  # fmt: skip
"""A value of a setting of a control law: a number, a switch, a word, weights, or a table of designed ones."""

_NO_SETTINGS: Final[Mapping[str, SettingValue]] = MappingProxyType({})


@checked
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
    wishes = given.get("designed")
    if isinstance(wishes, Mapping):
        given = {**given, "designed": WeightWishes(**wishes)}
    return SETTINGS[name](**given)


@checked
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
        Settings of the law, of the class in `SETTINGS`, or their values by name, in SI; `mrwork help laws` lists
        them.

    Raises
    ------
    UnknownNameError
        If there is no such law.
    SettingError
        If the settings belong to another law, one of them is unknown, missing or out of range, or the law cannot be
        designed for this building.

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
    _check_settings(spec, settings)
    design = settings.design(problem)
    curve = problem.curve if spec.needs_curve else None
    margins = settings.margins(problem, design, () if spec.commands_force else problem.driver_rates)
    remarks: Iterable[Remark] = ()
    if isinstance(settings, RegulatorSettings):
        remarks = gain_remarks(
            problem.plant,
            design.gains["gain"],
            given=settings.gain is not None,
            margins=margins,
            sample_time=problem.sample_time,
        )
    return ControlLaw(
        name=name,
        gains=design.gains,
        tables=design.tables,
        curve=curve,
        model=settings.loop_model(problem),
        notes=(
            *settings.notes(problem, design),
            *(unlike_first(problem) if spec.needs_curve else ()),
            *(() if margins is None else (margins.in_words,)),
        ),
        weights=settings.weights(problem),
        margins=margins,
        remarks=tuple(remarks),
    )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DesignedCandidates(Summarised):
    """One law with a candidate for each of many settings that could be designed.

    `designed` are the indices of these settings, in the order of the candidates; `refusals` has the reason of each
    other index. `law` is `None` where none could be designed.
    """

    law: ControlLaw | None
    designed: tuple[int, ...]
    refusals: Mapping[int, str]


def design_candidates(
    name: str, problem: DesignProblem, settings: Sequence[LawSettings]
) -> DesignedCandidates:
    """Design one law with many settings, for a batch of simulations.

    Settings with other tables or models of the loop than the first design are refused, because candidates of
    a batch share them.
    """
    spec = control_law(name)
    curve = problem.curve if spec.needs_curve else None
    designs: dict[int, Design] = {}
    refusals: dict[int, str] = {}
    # What candidates of a batch share: tables of the first design, and the model of the loop.
    shared: tuple[Design, LoopModel | None] | None = None
    for each in settings:
        _check_settings(spec, each)
    for index, design in enumerate(SETTINGS[name].designs(problem, settings)):
        if isinstance(design, SettingError):
            refusals[index] = str(design)
            continue
        believed = Design(tables=design.tables), settings[index].loop_model(problem)
        shared = believed if shared is None else shared
        if believed == shared:
            designs[index] = design
        else:
            refusals[index] = (
                f"{name} with these settings has other tables or beliefs than the first candidate"
            )
    law = None
    if shared is not None:
        names = next(iter(designs.values())).gains
        gains = {
            gain: np.stack([np.asarray(design.gains[gain]) for design in designs.values()]) for gain in names
        }
        law = ControlLaw(name=name, gains=gains, tables=shared[0].tables, curve=curve, model=shared[1])
    return DesignedCandidates(law=law, designed=tuple(designs), refusals=refusals)


def _check_settings(spec: ControlLawSpec, settings: LawSettings) -> None:
    kind = SETTINGS[spec.name]
    if type(settings) is not kind:
        raise SettingError(f"the settings are {type(settings).__name__}; {spec.name} takes {kind.__name__}")
