"""One line of progress on stderr."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING

from mrwork.identification.progress import Progress

if TYPE_CHECKING:
    from mrwork.study.run import StudyProgress
    from mrwork.uncertainty.choice.choose import ChoiceProgress
    from mrwork.uncertainty.posterior.sample import SamplingProgress

_EVERY = 0.2
# A sampling or a study that is over sooner needs no line.
_SAMPLING_FROM = 2.0
_THOUSAND = 1000.0
_MINUTE, _HOUR = 60.0, 3600.0


class _Line:
    """Rewrites one line on a terminal; elsewhere writes nothing, so that logs stay readable."""

    def __init__(self, *, quiet: bool) -> None:
        self.active = not quiet and sys.stderr.isatty()
        self._width = 0

    def write(self, text: str) -> None:
        """Put `text` in place of what is there."""
        print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = len(text)

    def close(self) -> None:
        """Clear the line."""
        if self.active:
            self.write("")
            print("\r", end="", file=sys.stderr, flush=True)


class ProgressLine:
    """An identification, in one line; of several, `prefix` says which."""

    def __init__(self, *, quiet: bool, prefix: str = "") -> None:
        self._line = _Line(quiet=quiet)
        self._prefix = prefix
        self._last = -math.inf
        self._began: Progress | None = None

    def __call__(self, progress: Progress) -> None:
        """Show where the identification stands."""
        if not self._line.active:
            return
        if self._began is None or self._began.stage != progress.stage:
            self._began = progress
        if progress.seconds - self._last < _EVERY:
            return
        self._last = progress.seconds
        self._line.write(self._prefix + described(progress, self._began))

    def close(self) -> None:
        """Clear the line."""
        self._line.close()


class SamplingLine:
    """A sampling, in one line, once it takes longer than two seconds."""

    def __init__(self, *, quiet: bool) -> None:
        self._line = _Line(quiet=quiet)

    def __call__(self, progress: SamplingProgress) -> None:
        """Show where the sampling stands."""
        if self._line.active and progress.seconds >= _SAMPLING_FROM:
            self._line.write(sampling_described(progress))

    def close(self) -> None:
        """Clear the line."""
        self._line.close()


class ChoiceLine:
    """A comparison of models, in one line."""

    def __init__(self, *, quiet: bool) -> None:
        self._line = _Line(quiet=quiet)
        self._last = -math.inf

    def __call__(self, progress: ChoiceProgress) -> None:
        """Show where the comparison stands."""
        if self._line.active and progress.seconds - self._last >= _EVERY:
            self._last = progress.seconds
            self._line.write(choice_described(progress))

    def close(self) -> None:
        """Clear the line."""
        self._line.close()


class StudyLine:
    """A study, in one line, once it takes longer than two seconds."""

    def __init__(self, *, quiet: bool) -> None:
        self._line = _Line(quiet=quiet)

    def __call__(self, progress: StudyProgress) -> None:
        """Show where the study stands."""
        if self._line.active and progress.seconds >= _SAMPLING_FROM:
            self._line.write(study_described(progress))

    def close(self) -> None:
        """Clear the line."""
        self._line.close()


def study_described(progress: StudyProgress) -> str:
    """Progress in one line: how many runs are done, whose are next, how long it may take."""
    parts = [f"{progress.done} of {progress.wanted} runs", progress.label]
    parts.append(_duration(progress.seconds))
    if progress.done:
        left = progress.seconds * (progress.wanted - progress.done) / progress.done
        parts.append(f"about {_duration(left)} left")
    return ", ".join(parts)


def choice_described(progress: ChoiceProgress) -> str:
    """Progress in one line: which model, how many there are, what is being fitted, how long it may take."""
    parts = [f"{progress.model}, model {progress.number} of {progress.n_models}", progress.task]
    if progress.within is not None:
        parts.append(f"best {progress.within.fit_percent:.2f} %")
    parts.append(_duration(progress.seconds))
    if progress.seconds_left is not None:
        parts.append(f"about {_duration(progress.seconds_left)} left")
    return ", ".join(parts)


def sampling_described(progress: SamplingProgress) -> str:
    """Progress in one line; the time left is that to the most steps allowed, for nobody knows when it converges."""
    parts = [f"step {progress.steps}", f"{_short(progress.steps_per_second)} steps/s"]
    if progress.diagnosis is not None:
        rhat = float(progress.diagnosis.rhat.max())
        parts.append(f"R-hat {rhat:.3f}, {progress.diagnosis.length:.0f} autocorrelation times")
    parts.append(_duration(progress.seconds))
    if progress.steps_per_second > 0.0:
        left = (progress.most_steps - progress.steps) / progress.steps_per_second
        parts.append(f"at most {_duration(left)} left")
    return ", ".join(parts)


def described(progress: Progress, began: Progress) -> str:
    """Progress in one line; rates and the time left are those since the stage `began`, as far as it was computed."""
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
    if running > 0.0 and progress.share > began.share:
        left = running * (1.0 - progress.share) / (progress.share - began.share)
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
