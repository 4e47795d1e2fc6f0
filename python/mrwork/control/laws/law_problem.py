"""Inputs and results of every law design: the problem, the settings of the law, and its gains.

A `Span` stands beside each setting that a search may change. It is relative to magnitudes of the response, so that
it fits any building and damper.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import exp, log
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from mrwork.base.arguments import May, NotNegative, Positive, checked
from mrwork.base.keys import refuse_repeated
from mrwork.base.summary import Summarised, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings import Building
from mrwork.buildings.device import Device, elongation_rows
from mrwork.buildings.groups import largest_command, sends_shares
from mrwork.control.laws.control_law import LoopModel
from mrwork.control.laws.counterpart import is_curve, static_counterpart
from mrwork.control.linear.margins import LoopMargins
from mrwork.control.linear.plant import Plant, plant_of
from mrwork.control.linear.riccati import attempt_each, only
from mrwork.control.weights.weight_certificate import DesignedWeights
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferencePeaks:
    """The best constant command of each device on some motions [A or V], one share of its largest.

    And the mean peaks of drift [m] and acceleration [m/s^2] under it.
    """

    commands: tuple[float, ...]
    drift: float
    acceleration: float


# It takes a second, and a study asks for it once for each law and candidate.
_counterpart = lru_cache(maxsize=32)(static_counterpart)


@checked
@dataclass(frozen=True, kw_only=True, repr=False)
class DesignProblem(Summarised):
    """The building with its devices for which a law is designed.

    `sample_time` and `delay` [s] belong to the loop. `amplitude` [m] and `velocity` [m/s] are the smallest and the
    largest values expected of the dampers, if given. `motions` are the ground motions whose strength and spectrum a
    design from limits takes, the training motions of a study; `judged` says that laws are judged on them, too. `beside`
    are the devices that no law commands, which only a law that predicts the motion knows. `reference_peaks` finds the
    largest motions under a constant command, to which a law may refer, of the frame that stays elastic or of the
    building itself. A problem that `limited_to` made is `limited_from` the one with the largest commands of the dampers
    themselves.
    """

    _made_by: ClassVar[str] = "mr.control.DesignProblem(building=..., devices=..., sample_time=...)"
    _units: ClassVar[Mapping[str, str]] = {"sample_time": "s", "delay": "s"}

    building: Building
    devices: Sequence[Device]
    sample_time: Positive
    amplitude: tuple[Positive, Positive] | None = None
    velocity: tuple[Positive, Positive] | None = None
    delay: NotNegative = 0.0
    motions: Sequence[GroundMotion] = ()
    judged: bool = False
    beside: Sequence[Device] = ()
    reference_peaks: Callable[[bool], ReferencePeaks] | None = field(default=None, repr=False, compare=False)
    limited_from: DesignProblem | None = field(default=None, repr=False, compare=False)
    _kept: dict[object, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def all_devices(self) -> tuple[Device, ...]:
        """Every device, those that a law commands first."""
        return (*self.devices, *self.beside)

    @property
    def curve(self) -> tuple[DamperSpec, Floats]:
        """The static model of the first damper: its force as a function of the command.

        Raises
        ------
        SettingError
            If the damper needs a static counterpart, and the expected motions are not given.
        """
        if not self.devices:
            raise SettingError(
                "this law needs the force of a damper, and the problem has no device; give one"
            )
        device = self.devices[0]
        theta = device.draws[0]
        if is_curve(device.spec):
            return device.spec, theta
        if self.amplitude is None or self.velocity is None:
            raise SettingError(
                f"this law needs the force as a function of the command, for which {device.spec.name} is replaced by a "
                "static model; give the [[damper]] its amplitude and velocity, as amplitude = [1e-4, 1e-2]"
            )
        counterpart = _counterpart(
            device.spec,
            tuple(theta.tolist()),
            largest_command=device.largest_command,
            amplitude=self.amplitude,
            velocity=self.velocity,
        )
        return counterpart.spec, np.array(counterpart.theta)

    @cached_property
    def plant(self) -> Plant:
        """The linear system of the building with its devices."""
        if self.limited_from is not None:
            return self.limited_from.plant
        rows = elongation_rows(self.building, self.devices)
        return plant_of(self.building, rows, [device.name for device in self.devices])

    @property
    def whole(self) -> DesignProblem:
        """The problem with the largest commands of the dampers themselves, which a law may not send."""
        return self if self.limited_from is None else self.limited_from

    def _keep(self, key: object, make: Callable[[], T]) -> T:
        """What a design needs of plant and motions: made when it is first asked for, since many designs ask for it."""
        kept = self.whole._kept
        if key not in kept:
            kept[key] = make()
        made: T = kept[key]
        return made

    @checked
    def limited_to(self, command: float) -> DesignProblem:
        """The problem with devices that get at most this command [A or V]; its plant is the same.

        Where devices follow commands in A and in V it is a share of the largest of each.
        """
        shares = sends_shares(self.devices)
        devices = tuple(
            replace(
                device,
                largest_command=command * original.largest_command
                if shares
                else min(command, device.largest_command),
            )
            for device, original in zip(self.devices, self.whole.devices, strict=True)
        )
        return replace(self, devices=devices, limited_from=self.whole)

    @property
    def largest_command(self) -> float:
        """The largest command that a law sends to any of the devices, as `limited_to` takes it."""
        if sends_shares(self.devices):
            return self.devices[0].largest_command / self.whole.devices[0].largest_command
        return largest_command(self.devices)

    @property
    def driver_rates(self) -> tuple[float | None, ...]:
        """Rate of the lag of the driver of each device [1/s], of two the slower; `None` without one."""
        # They are the last parameters of a model that has them.
        lags = (device.draws[0, device.draws.shape[1] - device.spec.n_rates :] for device in self.devices)
        return tuple(float(rates.min()) if rates.size else None for rates in lags)

    @checked
    def each(self, number: Annotated[float, May.BE_INFINITE]) -> Floats:
        """An array with the same number for every device."""
        return np.full(len(self.devices), number)


def unlike_first(problem: DesignProblem) -> tuple[str, ...]:
    """A sentence where dampers differ from the first, whose force a law knows."""
    first = problem.devices[0]
    others = [
        device.name
        for device in problem.devices
        if device.spec != first.spec or not np.array_equal(device.draws[0], first.draws[0])
    ]
    if not others:
        return ()
    return (
        f"It knows the force of {first.name} alone, and takes it for the force of {list_names(others)} too.",
    )


@array_dataclass(repr=False)
class Design(Summarised):
    """Gains of a law by name, one number or one row over the state for each device, and its tables."""

    gains: Mapping[str, Floats] = field(default_factory=dict)
    tables: Mapping[str, Floats] = field(default_factory=dict)


Magnitude = Literal[
    "drift", "displacement", "velocity", "acceleration", "energy", "force", "stroke", "rate", "ground", "command",
    "constant_drift", "constant_acceleration", "cost",
]  # fmt: skip
NO_CERTIFICATE = "none"
"""Certificate of a law of which nothing is proved."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Magnitudes(Summarised):
    """Typical peaks of a building with dampers, to which search ranges refer.

    Drift, floor displacement [m], floor velocity [m/s] and acceleration [m/s^2], twice the energy [J], stroke [m] and
    rate [m/s] of a device at i = 0, its force [N] at the largest command, peak of the ground motions [m/s^2], largest
    command [A or V], 1 where dampers follow commands in both units, which are then `shares`. `constant_drift` [m] and
    `constant_acceleration` [m/s^2] are mean peaks under the best constant command, where a law refers to them. `cost`
    is the sum of the costs of the held weights.
    """

    drift: float
    displacement: float
    velocity: float
    acceleration: float
    energy: float
    force: float
    stroke: float
    rate: float
    ground: float
    command: float
    constant_drift: float = 0.0
    constant_acceleration: float = 0.0
    cost: float = 1.0
    shares: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Range in which a search looks for a setting, and its value where it is neither searched nor given.

    `lower`, `upper` and `start` are multiples of the product of the magnitudes `of`, each with its power; a `start` of
    `None` is the default of the setting. The search is uniform in the number or in its logarithm, by `scale`. It
    changes the setting only if `free`, or where it is asked to, and never where `held` says why; of an array each
    number, beginning with `entries`.
    """

    lower: float
    upper: float
    of: tuple[tuple[Magnitude, float], ...] = ()
    start: float | None = None
    scale: Literal["log", "linear"] = "log"
    free: bool = True
    held: str = ""
    entries: tuple[float, ...] = ()

    def unit(self, magnitudes: Magnitudes) -> float:
        """The product of magnitudes that the numbers of the span are multiples of."""
        for name, _ in self.of:
            if not getattr(magnitudes, name) > 0.0:
                raise SettingError(
                    f"the {name} of the response is {getattr(magnitudes, name):g}, and the range of a setting is a "
                    "multiple of it; give the range in numbers"
                )
        return exp(sum(power * log(getattr(magnitudes, name)) for name, power in self.of))


class LawSettings(ABC):
    """Settings of a control law, declared by `key`, with the design of the law.

    `constant` says whether the law sends a constant command, which makes the damper a passive one, `chooses_levels`
    whether it chooses among commands up to a largest command that is its setting, so that a search keeps the largest
    command of the dampers, `is_regulator` whether its weights belong to a regulator, so that published and convex
    weights apply. `weighed_by_default` are the weights that a search holds where the user gives none; only their ratios
    to the free weights matter.
    """

    __slots__ = ()
    constant: ClassVar[bool] = False
    chooses_levels: ClassVar[bool] = False
    is_regulator: ClassVar[bool] = False
    weighed_by_default: ClassVar[Mapping[str, float]] = {}

    def __post_init__(self) -> None:
        refuse_repeated(self)

    @abstractmethod
    def design(self, problem: DesignProblem) -> Design:
        """The gains of the law for a building with its devices."""

    @classmethod
    def designs(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Design | SettingError]:
        """The gains of many settings, or the reason why one has none."""
        return attempt_each(lambda settings: settings.design(problem), many)

    @classmethod
    def weight_names(cls) -> frozenset[str]:
        """Names of the settings that are weights of outputs or states."""
        return frozenset()

    @classmethod
    def weights_among(cls, settings: Mapping[str, Any]) -> dict[str, Any]:
        """The weights of outputs or states among settings by name."""
        names = cls.weight_names()
        return {name: value for name, value in settings.items() if name in names}

    @classmethod
    def cost(cls, held: Mapping[str, Any], magnitudes: Magnitudes) -> float:
        """Cost of the weights among held settings at these magnitudes; 1 for a law without weights."""
        return 1.0

    def loop_model(self, problem: DesignProblem) -> LoopModel | None:
        """Building and devices as the law believes them to be; `None` for a law that predicts nothing."""
        return None

    def weights(self, problem: DesignProblem) -> DesignedWeights | None:
        """The designed weights; `None` for a law with others or without."""
        return None

    def margins(
        self, problem: DesignProblem, design: Design, rates: Sequence[float | None]
    ) -> LoopMargins | None:
        """Stability margins of the linear loop with drivers of these rates; `None` for a law that has none."""
        return None

    def notes(self, problem: DesignProblem, design: Design) -> tuple[str, ...]:
        """Sentences on the design that a user should read; none for most laws."""
        return ()

    def certificate(self, problem: DesignProblem) -> str:
        """Stability certificate of the law on this building, in words; `NO_CERTIFICATE` without one."""
        return NO_CERTIFICATE


class SolvedSettings(LawSettings):
    """Settings of a law whose design follows from the solution of equations: those of many settings by one call."""

    __slots__ = ()

    @classmethod
    @abstractmethod
    def solved(cls, problem: DesignProblem, many: Sequence[Self]) -> Sequence[Any]:
        """The solution for each, or the error that says why there is none."""

    @abstractmethod
    def design_of(self, problem: DesignProblem, solution: Any) -> Design:
        """The gains of the law that follow from a solution."""

    def design(self, problem: DesignProblem) -> Design:
        """The gains of the law for a building with its devices."""
        return only(type(self).designs(problem, [self]))

    @classmethod
    def designs(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Design | SettingError]:
        """The gains of many settings, or the reason why one has none."""
        solved = zip(many, cls.solved(problem, many), strict=True)
        return attempt_each(lambda pair: pair[0].design_of(problem, only([pair[1]])), solved)
