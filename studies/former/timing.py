"""Fair turns: contenders that agree are timed side by side."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from mrwork.errors import MrworkError

Run = Callable[[], object]
"""Ready to be timed: computes the whole batch once and waits for it."""
# Long enough that starting and waking threads does not count, short enough for turns to meet the same noise.
TURN_SECONDS = 0.08

T = TypeVar("T")


def require_agreement(contenders: str, what: str, difference: float, allowed: float) -> None:
    """Refuse to time contenders whose results differ by more than is allowed, relative to their size."""
    if not difference <= allowed:
        raise MrworkError(
            f"{contenders} were expected to agree on every {what} to {allowed:g}, they differ by {difference:.2e} "
            "(relative); do not trust the times, find which one is wrong"
        )


def _calls(run: Run, seconds: float) -> int:
    return max(1, math.ceil(seconds / min(_seconds_per_call(run, 1) for _ in range(3))))


def _seconds_per_call(run: Run, calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        run()
    return (time.perf_counter() - start) / calls


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """The result of one call, and its seconds."""
    began = time.perf_counter()
    result = run()
    return result, time.perf_counter() - began


def rotated(contenders: list[T], turn: int) -> list[T]:
    """The contenders from another one in every turn: so the same one is not always the first."""
    first = turn % len(contenders)
    return contenders[first:] + contenders[:first]


def time_in_turns(
    runs: dict[str, Run], rounds: int, fma_peak: Callable[[], float]
) -> tuple[dict[str, float], float]:
    """Return the median seconds per call of each contender, and the median of `fma_peak`, over the rounds."""
    calls = {name: _calls(run, TURN_SECONDS) for name, run in runs.items()}
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    peaks: list[float] = []
    names = list(runs)
    for turn in range(rounds):
        for name in rotated(names, turn):
            runs[name]()  # wakes this contender's threads and puts the previous one's to sleep
            seconds[name].append(_seconds_per_call(runs[name], calls[name]))
        peaks.append(fma_peak())
    return {name: float(np.median(values)) for name, values in seconds.items()}, float(np.median(peaks))
