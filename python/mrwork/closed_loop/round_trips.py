"""Time that a controller outside Python took for its answers, and the samples that have none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from mrwork.base.numbers import counted, in_plain, percent, significant
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table
from mrwork.base.values import Floats, array_dataclass

_LOST: Final = RemarkKind(
    "controller_lost",
    "the controller {0} {ended} at {time:g} s of run {run} of {of}; its command was zero from there on, in {lost} "
    "of {of} runs",
    "{look}, and run it alone with the messages of mr.closed_loop.ProcessLaw.protocol",
)
_WITHOUT: Final = RemarkKind(
    "controller_without_answer",
    "the controller {0} gave no command in {samples} of {messages} samples, where it was zero: {why}",
    "a rig would hold or drop its command there; mend the controller, or give it a longer timeout",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LostController:
    """A run whose controller ended or hung: its number from 0, the time [s], how it `ended`, and where to `look`."""

    _made_by: ClassVar[str] = "law.round_trips.lost"

    run: int
    time: float
    ended: str
    look: str


@array_dataclass(repr=False)
class RoundTrips(Summarised):
    """Round trips of a controller outside Python, from the message until its answer is read.

    Attributes
    ----------
    name
        Of the law.
    sample_time
        Of the loop [s]; the simulation waits, so a round trip that takes longer changes nothing.
    seconds
        Each round trip with an answer, without the first of each run, in which a program starts, shape (n,) [s].
    runs, messages
        Number of runs, with those that the loop repeats with a shorter step, and of messages.
    unanswered, misshapen, not_finite
        Messages without an answer in time, with one of another length, and with one that is not finite, whose commands
        were zero; without those by which a controller was lost.
    lost
        The runs whose controller ended or hung.
    """

    _made_by: ClassVar[str] = "law.round_trips"

    name: str
    sample_time: float
    seconds: Floats
    runs: int
    messages: int
    unanswered: int
    misshapen: int
    not_finite: int
    lost: tuple[LostController, ...]

    @property
    def median(self) -> float:
        """Median [s]; NaN without an answer, as the others."""
        return self._quantile(0.5)

    @property
    def slow(self) -> float:
        """The 99th percentile [s]."""
        return self._quantile(0.99)

    @property
    def largest(self) -> float:
        """The longest one [s]."""
        return self._quantile(1.0)

    @property
    def late_share(self) -> float:
        """Share of the round trips that took longer than a sample."""
        return float(np.mean(self.seconds > self.sample_time)) if self.seconds.size else np.nan

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On a controller that ended or hung, and on samples without a command."""
        return tuple(self._remarks())

    def _remarks(self) -> Iterator[Remark]:
        if self.lost:
            first = self.lost[0]
            yield _LOST.remark(
                self.name,
                ended=first.ended,
                look=first.look,
                time=first.time,
                run=first.run + 1,
                lost=len(self.lost),
                of=self.runs,
            )
        counts = {
            "no answer in time": self.unanswered,
            "an answer of another length": self.misshapen,
            "an answer that is not finite": self.not_finite,
        }
        if samples := sum(counts.values()):
            why = ", ".join(f"{count} with {words}" for words, count in counts.items() if count)
            yield _WITHOUT.remark(self.name, samples=samples, messages=self.messages, why=why)

    def _quantile(self, share: float) -> float:
        return float(np.quantile(self.seconds, share)) if self.seconds.size else np.nan

    def _summary(self) -> Summary:
        times = {"median": self.median, "99 %": self.slow, "largest": self.largest}
        return Summary(
            title=f"Round trips of {self.name}: {counted(self.messages, 'message')} in {counted(self.runs, 'run')}",
            facts=[
                *((name, f"{significant(1e6 * time, 3)} us") for name, time in times.items()),
                ("over a sample", f"{percent(self.late_share)} %, of {1e3 * self.sample_time:g} ms"),
            ],
            tables=[self._histogram()],
            remarks=self.remarks,
            notes=("The simulation waits for each answer: this tests code and protocol, not real time.",),
        )

    def _histogram(self) -> Table:
        """Counts between 1, 2, 5, 10, ... microseconds, without empty ends."""
        edges = np.array([step * 10.0**power for power in range(7) for step in (1.0, 2.0, 5.0)])
        # Exact to the digits that are shown, so that a time on an edge is above it.
        counts = np.bincount(
            np.searchsorted(edges, 1e6 * self.seconds, side="right"), minlength=len(edges) + 1
        )
        filled = np.flatnonzero(counts)
        shown = range(filled[0], filled[-1] + 1) if filled.size else ()
        texts = [in_plain(f"{edge:,.0f}") for edge in edges]
        names = [f"below {texts[0]}", *map("{} to {}".format, texts, texts[1:]), f"{texts[-1]} and more"]
        rows = [
            (names[number], str(counts[number]), percent(counts[number] / counts.sum())) for number in shown
        ]
        return Table(columns=("round trip", "count", "share"), units=("us", "", "%"), rows=rows)
