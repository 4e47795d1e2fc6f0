"""What data say of each parameter of a fit, and what they do not see: plain facts that a fit carries along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mrwork.summary import Summarised, Summary, rounded

VerdictName = Literal["identifiable", "weakly", "not"]
_IN_SHORT: dict[VerdictName, str] = {"identifiable": "yes", "weakly": "weakly", "not": "no"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Whether the data settle one parameter, and why not.

    `standard_error` is in the parameter's unit, for as many samples as the residuals are worth; `None` where there is
    none.
    """

    name: str
    verdict: VerdictName
    standard_error: float | None
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """How far one parameter goes along a direction: percent of its value, or of its range where `of_range`."""

    name: str
    percent: float
    of_range: bool = False

    @property
    def in_words(self) -> str:
        """As in "alpha up 1 %"."""
        way = "up" if self.percent > 0 else "down"
        return f"{self.name} {way} {abs(self.percent):.2g} %{' of its range' if self.of_range else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """Changes of several parameters at once that the data hardly see, or not at all where not `seen`.

    `effect` is the root mean square of what they change of the force, per standard deviation of the force.
    """

    changes: tuple[Change, ...]
    effect: float
    seen: bool
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Identifiability(Summarised):
    """A verdict for each free parameter, and the directions that the data do not see or see weakly.

    `n_effective` is what the `n_time` samples are worth, as their residuals are correlated.
    """

    verdicts: tuple[Verdict, ...]
    directions: tuple[Direction, ...]
    n_time: int
    n_effective: float

    def _summary(self) -> Summary:
        return Summary(
            title=f"Identifiability from {self.n_time} samples, worth {self.n_effective:.0f} independent ones",
            columns=("parameter", "identifiable", "standard error [SI]", "reason"),
            rows=[
                (each.name, _IN_SHORT[each.verdict], rounded(each.standard_error, 2), each.reason)
                for each in self.verdicts
            ],
            notes=[each.sentence for each in self.directions],
        )
