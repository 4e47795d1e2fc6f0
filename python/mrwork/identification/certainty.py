"""How certain the parameters of a fit are: verdicts and directions from its derivatives, and intervals with theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from mrwork.arguments import Count, Level, NotNegative, Positive
from mrwork.store.record import Related
from mrwork.summary import Summarised, Summary, of_unit, rounded

# Decided in `uncertainty/identifiability/judgement.py` alone, and read from `Fit.verdict_on`.
VerdictName = Literal["identifiable", "weakly identifiable", "sign unknown", "negligible", "not identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval(Related):
    """Interval of one parameter in its unit; an end that the data do not bound is `None`.

    `verdict` is `None` in draws of earlier versions.
    """

    name: str
    lower: float | None
    upper: float | None
    verdict: VerdictName | None
    reason: str

    def disagreement(self) -> str:
        """Whether the ends are in order."""
        if self.lower is None or self.upper is None or self.lower <= self.upper:
            return ""
        return f"the interval of {self.name} is from {self.lower:g} to {self.upper:g}"

    def in_words(self, shown: Callable[[float], str]) -> str:
        """As in "6317 to 7278", or "above 835.8" where one end is open; `shown` writes a number."""
        if self.lower is None:
            return "open" if self.upper is None else f"below {shown(self.upper)}"
        return (
            f"above {shown(self.lower)}"
            if self.upper is None
            else f"{shown(self.lower)} to {shown(self.upper)}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """Intervals of all free parameters of a fit at one `level`, by profile likelihood or from posterior draws."""

    kind: Literal["profile", "posterior"]
    level: Level
    intervals: tuple[Interval, ...]

    @property
    def heading(self) -> str:
        """Heading of their column."""
        return f"{100.0 * self.level:g} % {self.kind} interval"

    def of(self, name: str) -> Interval | None:
        """The interval of a parameter; `None` where it was not free."""
        return next((each for each in self.intervals if each.name == name), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Identifiability of one parameter, with the reason.

    `standard_error` is in the parameter's unit, for the effective number of samples; `None` where there is none.
    """

    name: str
    verdict: VerdictName
    standard_error: NotNegative | None
    reason: str

    def by_interval(self, interval: Interval | None) -> Verdict:
        """The verdict of an interval, where that has one."""
        if interval is None or interval.verdict is None:
            return self
        return replace(self, verdict=interval.verdict, reason=interval.reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterChange:
    """Component of a direction along one parameter: percent of its value, or of its range where `of_range`."""

    name: str
    percent: float
    of_range: bool = False
    amount: float | None = None
    unit: str = ""

    @property
    def in_words(self) -> str:
        """As in "alpha up 1 %", or "x0 down 0.0002 m" where the value may be zero."""
        way = "up" if self.percent > 0 else "down"
        if self.of_range and self.amount is not None:
            return f"{self.name} {way} {of_unit(abs(self.amount), self.unit, 2)}"
        return f"{self.name} {way} {abs(self.percent):.2g} %"


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """A combined change of parameters that has little effect on the residuals, or none where `seen` is false.

    `effect` is the root mean square of the resulting change of force, per standard deviation of the force.
    """

    changes: tuple[ParameterChange, ...]
    effect: NotNegative
    seen: bool
    sentence: str

    @property
    def starts_with_name(self) -> bool:
        """Whether the sentence starts with the name of a parameter, which is not capitalised.

        It does not where a single parameter has no effect: "the residuals do not depend on it".
        """
        return self.seen or len(self.changes) > 1


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Identifiability(Summarised):
    """A verdict for each free parameter, and the directions that the data determine weakly or not at all.

    `n_effective` is the effective number of samples; it is below `n_time` where residuals are correlated. In a fit with
    intervals the `verdicts` are by these, and `by_derivatives` keeps those that they replaced.
    """

    verdicts: tuple[Verdict, ...]
    directions: tuple[Direction, ...]
    n_time: Count
    n_effective: Positive
    by_derivatives: tuple[Verdict, ...] = ()

    def with_intervals(self, intervals: Intervals | None) -> Identifiability:
        """With the verdicts of the intervals where there are any, else with those by the derivatives."""
        own = self.by_derivatives or self.verdicts
        if intervals is None:
            return replace(self, verdicts=own, by_derivatives=())
        return replace(
            self,
            verdicts=tuple(each.by_interval(intervals.of(each.name)) for each in own),
            by_derivatives=own,
        )

    def verdict_on(self, name: str) -> Verdict | None:
        """The verdict on a parameter; `None` where it was not free."""
        return next((each for each in self.verdicts if each.name == name), None)

    @property
    def informative(self) -> tuple[Direction, ...]:
        """The directions without those along which a parameter moves most whose verdict asks for no caution."""
        settled = {each.name for each in self.verdicts if each.verdict in ("identifiable", "negligible")}
        return tuple(each for each in self.directions if not each.seen or each.changes[0].name not in settled)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Identifiability from {self.n_time} samples, worth {self.n_effective:.0f} independent ones",
            columns=("parameter", "standard error [SI]", "verdict", "reason"),
            rows=[
                (each.name, rounded(each.standard_error, 2), each.verdict, each.reason)
                for each in self.verdicts
            ],
            notes=[each.sentence for each in self.informative],
        )
