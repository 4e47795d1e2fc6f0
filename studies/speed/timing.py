"""Fair turns: find the fastest variant of a peer that agrees with us, then time all contenders side by side."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from mrwork import dampers as core
from mrwork.errors import MrworkError
from studies.former.arrays import Floats
from studies.speed.workload import Run

# All contenders sum the same 2000 squares in the same order; a library's power may differ by some ulp.
AGREEMENT = 1e-9
# Long enough that starting and waking threads does not count, short enough for turns to meet the same noise.
TURN_SECONDS = 0.08
TRIAL_SECONDS = 0.02

T = TypeVar("T")


class Variant(Protocol):
    """A way to lay out and compile a contender."""

    def describe(self) -> str:
        """In a few words, for the table."""


V = TypeVar("V", bound=Variant)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedPeer(Generic[V]):
    """A library to compare with: where its search for the fastest variant starts and what it may change."""

    start: V
    changes: tuple[Callable[[V], V], ...]
    prepare: Callable[[V], Run]


def fastest_variant(name: str, peer: TimedPeer[V], expected: Floats) -> tuple[Run, str]:
    """Find the fastest variant by trying each change once on the best so far; return it and what it is.

    A changed variant that loses the agreement (fast-math may) is not eligible.
    """
    best = peer.start
    run = peer.prepare(best)
    require_agreement(f"{name} and the compiled kernel", "misfit", _disagreement(run(), expected), AGREEMENT)
    seconds = _trial(run)
    tried = {best}
    for change in peer.changes:
        variant = change(best)
        if variant in tried:
            continue
        tried.add(variant)
        contender = peer.prepare(variant)
        if not _disagreement(contender(), expected) <= AGREEMENT:
            continue
        trial = _trial(contender)
        if trial < seconds:
            best, run, seconds = variant, contender, trial
    return run, best.describe()


def require_agreement(contenders: str, what: str, difference: float, allowed: float) -> None:
    """Refuse to time contenders whose results differ by more than is allowed, relative to their size."""
    if not difference <= allowed:
        raise MrworkError(
            f"{contenders} were expected to agree on every {what} to {allowed:g}, they differ by {difference:.2e} "
            "(relative); do not trust the times, find which one is wrong"
        )


def _disagreement(misfit: object, expected: Floats) -> float:
    return float(np.max(np.abs(np.asarray(misfit) / expected - 1.0)))


def _trial(run: Run) -> float:
    return min(_seconds_per_call(run, _calls(run, TRIAL_SECONDS)) for _ in range(5))


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


def beside_peers(
    ours: Callable[[], Floats],
    peers: Mapping[str, TimedPeer[Any]],
    *,
    label: str,
    steps: int,
    rounds: int,
    threads: int,
    flops_per_step: float,
) -> Iterator[str | dict[str, Any]]:
    """Time our kernel and the fastest variant of each peer in turns, once they agree.

    What is done, and last the figures of a row: those of `speed_figures`, and the variants.
    """
    expected = ours()
    runs: dict[str, Run] = {"ours": ours}
    variants: dict[str, str] = {}
    for name, peer in peers.items():
        yield f"{label}: choosing the fastest {name}"
        runs[name], variants[name] = fastest_variant(f"{label} as {name}", peer, expected)
    yield f"{label}: timing {', '.join(runs)} in {rounds} rounds"
    seconds, fma_peak = time_in_turns(runs, rounds, lambda: core.fma_peak(threads, TURN_SECONDS / 2))
    speeds = {name: steps / value for name, value in seconds.items()}
    yield {"variants": variants, **speed_figures(speeds, flops_per_step=flops_per_step, fma_peak=fma_peak)}


def speed_figures(speeds: Mapping[str, float], *, flops_per_step: float, fma_peak: float) -> dict[str, float]:
    """Speeds by contender [steps/s], ours over each peer's, and our share of the machine's peak [flop/s]."""
    ours = speeds["ours"]
    return {
        **speeds,
        **{f"ratio_{name}": ours / speed for name, speed in speeds.items() if name != "ours"},
        "peak_fraction": ours * flops_per_step / fma_peak,
        "flops_per_step": flops_per_step,
        "fma_peak": fma_peak,
    }
