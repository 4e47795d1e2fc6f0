"""One line of progress on stderr."""

from __future__ import annotations

import math
import sys

from mrwork.identification.run import Progress

_EVERY = 0.2
_THOUSAND = 1000.0
_MINUTE, _HOUR = 60.0, 3600.0


class ProgressLine:
    """Rewrites one line on a terminal; elsewhere writes nothing, so that logs stay readable."""

    def __init__(self, *, quiet: bool, prefix: str = "") -> None:
        self._prefix = prefix
        self._active = not quiet and sys.stderr.isatty()
        self._last = -math.inf
        self._began: Progress | None = None
        self._width = 0

    def __call__(self, progress: Progress) -> None:
        """Show where the identification stands."""
        if not self._active:
            return
        if self._began is None or self._began.stage != progress.stage:
            self._began = progress
        if progress.seconds - self._last < _EVERY:
            return
        self._last = progress.seconds
        self._write(self._prefix + described(progress, self._began))

    def close(self) -> None:
        """Clear the line."""
        if self._active:
            self._write("")
            print("\r", end="", file=sys.stderr, flush=True)

    def _write(self, text: str) -> None:
        print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = len(text)


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
