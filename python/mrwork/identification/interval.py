"""What the data say of one parameter: an interval, whose ends may be open, and a verdict with its reason.

Fits, profiles and posterior draws have both; `verdicts` has the rule of every verdict.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from statistics import NormalDist
from typing import Literal, Protocol, runtime_checkable

from mrwork.base.arguments import Level
from mrwork.base.numbers import significant

Word = Literal[
    "identifiable",
    "model-dependent",
    "weakly identifiable",
    "sign unknown",
    "negligible",
    "not identifiable",
    "fixed",
    "tied",
    "",
]
FINE: tuple[Word, ...] = ("", "identifiable", "fixed", "tied")
"""Words of the verdicts that need no caution."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the data say of a parameter, in a word, and the reason; the word is empty where nothing was judged.

    It is equal to its word.
    """

    word: Word = ""
    reason: str = ""

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Verdict):
            return (self.word, self.reason) == (other.word, other.reason)
        return self.word == other

    def __hash__(self) -> int:
        return hash(self.word)

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.word, self.reason)))


NOT_JUDGED = Verdict()

End = Literal["closed", "bound", "not simulated", "too many points", "interrupted"]
_OPEN: dict[End, str] = {
    "closed": "the fit was not at the least misfit",
    "bound": "values up to the bound of its range fit as well",
    "not simulated": "no simulation finished beyond",
    "too many points": "the largest number of points was reached",
    "interrupted": "interrupted",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Interval of a parameter at a `level`, in its unit, by profile likelihood or from posterior draws.

    An end at which the data do not bound the parameter is `None`: at "bound" the admissible range ended, beyond "not
    simulated" no run did.
    """

    kind: Literal["profile", "posterior"]
    level: Level
    lower: float | None
    upper: float | None
    lower_end: End = "closed"
    upper_end: End = "closed"

    @property
    def heading(self) -> str:
        """Heading of a column of such intervals."""
        return f"{100.0 * self.level:g} % {self.kind} interval"

    @property
    def error(self) -> float:
        """The standard deviation of a normal density of this interval, in its unit; infinite where an end is open."""
        if self.lower is None or self.upper is None:
            return inf
        return 0.5 * (self.upper - self.lower) / NormalDist().inv_cdf(0.5 * (1.0 + self.level))

    @property
    def is_open(self) -> bool:
        """Whether the data do not bound the parameter at one end or both."""
        return self.lower is None or self.upper is None

    @property
    def opened(self) -> str:
        """Which ends are open, and why."""
        ends = (("below", self.lower, self.lower_end), ("above", self.upper, self.upper_end))
        reasons = {side: _OPEN[end] for side, value, end in ends if value is None}
        if len(reasons) > 1 and len({*reasons.values()}) == 1:
            return f"open on both sides: {reasons['below']}"
        return f"open {'; '.join(f'{side}: {reason}' for side, reason in reasons.items())}"

    def in_words(self, shown: Callable[[float], str]) -> str:
        """Text such as "6317 to 7278", or "above 835.8" where one end is open; `shown` formats a number."""
        if self.lower is None:
            return "open" if self.upper is None else f"below {shown(self.upper)}"
        if self.upper is None:
            return f"above {shown(self.lower)}"
        return f"{shown(self.lower)} to {shown(self.upper)}"


def end_in_words(end: float | None) -> str:
    """An end of an interval to five digits, or "open"."""
    return "open" if end is None else significant(end, 5)


@runtime_checkable
class Judged(Protocol):
    """A parameter with its interval and the verdict by it: a profile, or the summary of its draws."""

    @property
    def name(self) -> str:
        """Name of the parameter."""

    @property
    def interval(self) -> Interval | None:
        """Its interval; `None` where it was held fixed."""

    @property
    def verdict(self) -> Verdict:
        """The verdict by the interval."""
