"""One line of progress on stderr."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Generic, TypeVar

from mrwork.cli.terminal import note, write_stderr
from mrwork.escaping import escape_text
from mrwork.identification.progress import Progress

if TYPE_CHECKING:
    from mrwork.identification.settings import OnRead
    from mrwork.report.section import PageProgress
    from mrwork.study.run import StudyProgress
    from mrwork.tuning.law_tuning import TuningProgress
    from mrwork.uncertainty.choice.choose import ChoiceProgress
    from mrwork.uncertainty.choice.laws import LawProgress
    from mrwork.uncertainty.identifiability.profile import ProfileProgress
    from mrwork.uncertainty.posterior.sample import SamplingProgress

Report = TypeVar("Report")

# Seconds between two updates of the line, and between two lines where there is no terminal.
_EVERY = 0.2
_EVERY_PLAIN = 60.0
PATIENCE = 2.0
"""Seconds until the progress line appears, for computations that are often shorter."""
# Seconds until the remaining time of a stage is first estimated, and within which it follows the estimate.
_FIRST_ESTIMATE = 1.0
_STEADY = 5.0
_THOUSAND = 1000.0
_MINUTE, _HOUR = 60.0, 3600.0


class ProgressLine(Generic[Report]):
    """Line that shows the latest progress report of a computation.

    On a terminal it appears after `patience` [s] and changes at most five times a second. Elsewhere, for example in
    the log of a batch job, a new line is written at most once a minute.
    """

    def __init__(self, described: Callable[[Report], str], *, quiet: bool, patience: float = 0.0) -> None:
        self._described = described
        self._active = not quiet
        self._plain = not sys.stderr.isatty()
        self._next = time.monotonic() + (_EVERY_PLAIN if self._plain else patience)
        self._width = 0

    def __call__(self, progress: Report) -> None:
        """Show a progress report."""
        if not self._active:
            return
        text = escape_text(self._described(progress))
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + (_EVERY_PLAIN if self._plain else _EVERY)
            self._write(text)

    def close(self) -> None:
        """Clear the line."""
        if self._width:
            self._write("")
            write_stderr("\r")

    def _write(self, text: str) -> None:
        if self._plain:
            note(text)
            return
        write_stderr("\r" + text.ljust(self._width))
        self._width = len(text)


@contextmanager
def progress_line(
    described: Callable[[Report], str], *, quiet: bool, patience: float = PATIENCE
) -> Iterator[ProgressLine[Report]]:
    """A line of progress, which is cleared at the end."""
    line = ProgressLine(described, quiet=quiet, patience=patience)
    try:
        yield line
    finally:
        line.close()


@contextmanager
def reading_line(*, quiet: bool) -> Iterator[OnRead]:
    """Progress line with the number of tests that have been read."""
    with progress_line(_reading_described, quiet=quiet, patience=0.0) as line:
        yield lambda done, total: line((done, total))


def _reading_described(read: tuple[int, int]) -> str:
    done, total = read
    return "reading the test" if total == 1 else f"reading {done + 1} of {total} tests"


@contextmanager
def task_line(task: str, *, quiet: bool) -> Iterator[None]:
    """A line that names a task while it is done."""
    with progress_line(str, quiet=quiet, patience=0.0) as line:
        line(task)
        yield


class IdentificationInWords:
    """Describes the progress of an identification; the line begins with `prefix`."""

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        self._began: Progress | None = None
        self._time_left = _TimeLeft(share=0.0, seconds=0.0)

    def __call__(self, progress: Progress) -> str:
        """Progress in one line, with rates and the remaining time since its stage began."""
        if self._began is None or self._began.stage != progress.stage:
            self._began = progress
            self._time_left = _TimeLeft(share=progress.share, seconds=progress.seconds)
        left = self._time_left.after(progress.share, progress.seconds)
        return self._prefix + describe_progress(progress, self._began, left)


class _TimeLeft:
    """Remaining time of a stage that began with this share done, at this time [s].

    It runs down with the clock, and approaches the estimate from the share that is done within some seconds: searches
    end early, and a share grows in steps.
    """

    def __init__(self, *, share: float, seconds: float) -> None:
        self._began = self._share, self._seconds = share, seconds
        self._left: float | None = None

    def after(self, share: float, seconds: float) -> float | None:
        """The time [s], not below 0; `None` where it is not known yet."""
        first, began = self._began
        self._share = max(self._share, min(share, 1.0))
        passed, self._seconds = seconds - self._seconds, seconds
        if self._share <= first or seconds - began < _FIRST_ESTIMATE:
            return None
        estimate = (seconds - began) * (1.0 - self._share) / (self._share - first)
        if self._left is None:
            self._left = estimate
        else:
            run_down = max(self._left - passed, 0.0)
            self._left = estimate + (run_down - estimate) * math.exp(-passed / _STEADY)
        return self._left


def profile_described(progress: ProfileProgress) -> str:
    """Progress in one line: completed sides of profiles, points on them, and the rate."""
    return (
        f"{progress.ended} of {progress.sides} sides, {progress.points} points, "
        f"{progress.evaluations / progress.seconds:.0f} evaluations/s, {progress.seconds:.0f} s"
    )


def page_described(progress: PageProgress) -> str:
    """Progress of a page in one line: drawn parts, and the next one."""
    return f"drawing the page, {progress.done} of {progress.total}: {progress.task}"


def study_described(progress: StudyProgress) -> str:
    """Progress in one line: completed runs, the next ones, the remaining time."""
    parts = [f"{progress.done} of {progress.total} runs", progress.label, _duration(progress.seconds)]
    if progress.done:
        left = progress.seconds * (progress.total - progress.done) / progress.done
        parts.append(f"about {_duration(left)} left")
    return ", ".join(parts)


def choice_described(progress: ChoiceProgress) -> str:
    """Progress in one line: the model and its number, the task, the remaining time."""
    parts = [f"{progress.model}, model {progress.number} of {progress.n_models}", progress.task]
    if progress.within is not None:
        parts.append(f"best {progress.within.fit_percent:.2f} %")
    parts.append(_duration(progress.seconds))
    if progress.seconds_left is not None:
        parts.append(f"about {_duration(progress.seconds_left)} left")
    return ", ".join(parts)


def laws_described(progress: LawProgress) -> str:
    """Progress in one line: the model if one of several, the task, how many laws are done, the best left-out fit."""
    several = progress.n_models > 1
    parts = [f"{progress.model}, model {progress.number} of {progress.n_models}"] if several else []
    parts.append(progress.task)
    if progress.n_tried:
        parts.append(f"{progress.n_tried} tried, best left-out fit {progress.left_out_percent:.2f} %")
    if progress.within is not None:
        parts.append(f"{progress.within.stage} {progress.within.fit_percent:.2f} %")
    return ", ".join([*parts, _duration(progress.seconds)])


def tuning_described(progress: TuningProgress) -> str:
    """Progress in one line: the present law, its candidates, its least objective, laws done."""
    return (
        f"{progress.label}: {progress.candidates} candidates, least objective {progress.least:.4f}, "
        f"{progress.done} of {progress.total} laws done, {_duration(progress.seconds)}"
    )


def sampling_described(progress: SamplingProgress) -> str:
    """Progress in one line; the remaining time is that of the most steps, as convergence cannot be predicted."""
    parts = [f"step {progress.steps}", f"{_short(progress.steps_per_second)} steps/s"]
    if progress.diagnosis is not None:
        rhat = float(progress.diagnosis.rhat.max())
        parts.append(f"R-hat {rhat:.3f}, {progress.diagnosis.length:.0f} autocorrelation times")
    parts.append(_duration(progress.seconds))
    if progress.steps_per_second > 0.0:
        left = (progress.most_steps - progress.steps) / progress.steps_per_second
        parts.append(f"at most {_duration(left)} left")
    return ", ".join(parts)


def describe_progress(progress: Progress, began: Progress, left: float | None) -> str:
    """Progress in one line; rates are measured since the stage `began`, of which this time is `left` [s]."""
    generation = f" {progress.generation}" if progress.generation else ""
    parts = [f"{progress.stage}{generation}", f"best {progress.fit_percent:.2f} %"]
    if math.isfinite(progress.median_percent):
        parts.append(f"median {progress.median_percent:.2f} %")
    if progress.unit == "steps":
        parts.append(f"{progress.count} steps")
    running = progress.seconds - began.seconds
    if running > 0.0 and progress.steps > began.steps:
        parts.append(f"{_short((progress.evaluations - began.evaluations) / running)} evaluations/s")
        parts.append(f"{_short((progress.steps - began.steps) / running)} steps/s")
    parts.append(_duration(progress.seconds))
    if left is not None:
        parts.append(f"at most {_duration(left)} of this stage left")
    return ", ".join(parts)


def _short(rate: float) -> str:
    """Three digits, as in 950, 1.25k, 3.10M."""
    for unit in ("", "k", "M"):
        if rate < _THOUSAND:
            return f"{rate:.3g}{unit}"
        rate /= _THOUSAND
    return f"{rate:.3g}G"


def _duration(seconds: float) -> str:
    if seconds < _MINUTE:
        return f"{seconds:.0f} s"
    if seconds < _HOUR:
        return f"{seconds / _MINUTE:.0f} min"
    return f"{seconds / _HOUR:.1f} h"
