"""Seconds of peers side by side, and the processor that they are of."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable, Mapping
from pathlib import Path


def median_seconds(
    runs: Mapping[str, Callable[[], object]], rounds: int, turn: float = 0.08
) -> dict[str, float]:
    """Median seconds of a call of each of the runs, in turns, so that the load of the machine meets all alike.

    A turn of a run is as many calls as take `turn` seconds, or one call for 0, after one that wakes its threads. Each
    round begins with another run. Call every run once before, so that nothing is compiled here.
    """
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    calls = {name: math.ceil(turn / _seconds(run, 1)) if turn else 1 for name, run in runs.items()}
    names = list(runs)
    for first in range(rounds):
        for name in names[first % len(names) :] + names[: first % len(names)]:
            runs[name]()
            seconds[name].append(_seconds(runs[name], calls[name]))
    return {name: sorted(values)[len(values) // 2] for name, values in seconds.items()}


def _seconds(run: Callable[[], object], calls: int) -> float:
    began = time.perf_counter()
    for _ in range(calls):
        run()
    return (time.perf_counter() - began) / calls


def processor() -> str:
    """Name of the processor, which a table of seconds names."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    facts = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines[:30])}
    if "model name" not in facts:
        return platform.processor() or platform.machine()
    return f"{facts['model name']}, family {facts['cpu family']}, model {facts['model']}"
