"""What the settings of all control laws share: design in batches, a certificate, search ranges.

A `Span` stands beside each setting that a search may change. It is relative to magnitudes of the response, so that
it fits any building and damper.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, log
from typing import ClassVar, Literal, Self, TypeVar

from mrwork.arguments import checked
from mrwork.control.design_problem import Design, DesignProblem
from mrwork.errors import SettingError
from mrwork.keys import DeclaredTable, check_keys, plain_values
from mrwork.summary import Summarised

T = TypeVar("T")
U = TypeVar("U")

Magnitude = Literal[
    "drift",
    "displacement",
    "velocity",
    "acceleration",
    "energy",
    "force",
    "stroke",
    "rate",
    "ground",
    "command",
    "cost",
]
NO_CERTIFICATE = "none"
"""Certificate of a law of which nothing is proved."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Magnitudes(Summarised):
    """Typical peaks of a building with dampers, to which search ranges refer.

    Drift, floor displacement [m], floor velocity [m/s] and acceleration [m/s^2], twice the energy [J], stroke [m] and
    rate [m/s] of a device at i = 0, its force [N] at the largest command, peak of the ground motions [m/s^2], largest
    command [A or V]. `cost` is what the weights that are not free add up to.
    """

    _made_by: ClassVar[str] = "mr.tune(study)"

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
    cost: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Range in which a search looks for a setting, and its value where it is neither searched nor given.

    All three are multiples of the product of the magnitudes `of`, each with its power.

    Parameters
    ----------
    lower, upper
        Ends of the range.
    start
        Value where the setting is held; `None` for the default of the setting.
    scale
        Whether the search is uniform in the number or in its logarithm.
    free
        Whether a search changes the setting unless something else is asked for.
    entries
        For an array, of which a search changes each number: the numbers with which it begins.
    """

    lower: float
    upper: float
    of: tuple[tuple[Magnitude, float], ...] = ()
    start: float | None = None
    scale: Literal["log", "linear"] = "log"
    free: bool = True
    entries: tuple[float, ...] = ()

    @checked
    def unit(self, magnitudes: Magnitudes) -> float:
        """The product of magnitudes that the numbers of the span are multiples of.

        Raises
        ------
        SettingError
            If one of them is not positive.
        """
        for name, _ in self.of:
            if not getattr(magnitudes, name) > 0.0:
                raise SettingError(
                    f"the {name} of the response is {getattr(magnitudes, name):g}, and the range of a setting is a "
                    "multiple of it; give the range in numbers"
                )
        return exp(sum(power * log(getattr(magnitudes, name)) for name, power in self.of))


class LawSettings(metaclass=DeclaredTable):
    """Settings of a control law, declared by `key`, with the design of the law.

    `constant` says whether the law sends a constant command, which makes the damper a passive one. `weighed` are the
    weights that a search holds where none is given; only their ratios to the free ones matter.
    """

    __slots__ = ()
    constant: ClassVar[bool] = False
    weighed_by_default: ClassVar[Mapping[str, float]] = {}

    def __post_init__(self) -> None:
        plain_values(self)
        check_keys(self)

    @abstractmethod
    def design(self, problem: DesignProblem) -> Design:
        """The gains of the law for a building with its devices."""

    @classmethod
    def designs(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Design | SettingError]:
        """The gains of many settings, or the reason why one has none."""
        return attempted(lambda settings: settings.design(problem), many)

    def notes(self, problem: DesignProblem) -> tuple[str, ...]:
        """Sentences on the design that a user should read; none for most laws."""
        return ()

    def certificate(self, problem: DesignProblem) -> str:
        """What is proved of the law on this building, in words; `NO_CERTIFICATE` where nothing is."""
        return NO_CERTIFICATE


def attempted(make: Callable[[T], U], many: Iterable[T]) -> list[U | SettingError]:
    """What is made of each, or the reason why it cannot be."""
    found: list[U | SettingError] = []
    for each in many:
        try:
            found.append(make(each))
        except SettingError as reason:
            found.append(reason)
    return found


def solved_together(
    solve: Callable[[list[T]], Iterable[U | SettingError]], many: Sequence[T | SettingError]
) -> list[U | SettingError]:
    """What one call makes of all that are no error; errors keep their places."""
    sound = [each for each in many if not isinstance(each, SettingError)]
    solved = iter(solve(sound) if sound else ())
    return [each if isinstance(each, SettingError) else next(solved) for each in many]
