"""Seconds of a call without those in which JAX traces and compiles."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import jax

T = TypeVar("T")

# Begin and end of every tracing, lowering and compilation; that of a function lies within that of its caller.
_SPANS: list[tuple[float, float]] = []


def _note(event: str, duration_secs: float, **_: str | int) -> None:
    if event.startswith("/jax/core/compile/"):
        end = time.perf_counter()
        _SPANS.append((end - duration_secs, end))


jax.monitoring.register_event_duration_secs_listener(_note)


def timed_apart(work: Callable[[], T]) -> tuple[T, float, float]:
    """A result, seconds without those of compilation, and these."""
    first, began = len(_SPANS), time.perf_counter()
    result = work()
    seconds, compiled = time.perf_counter() - began, covered(_SPANS[first:])
    return result, seconds - compiled, compiled


def covered(spans: Sequence[tuple[float, float]]) -> float:
    """Length of what spans of time cover together."""
    total, reached = 0.0, float("-inf")
    for begin, end in sorted(spans):
        total += max(end - max(begin, reached), 0.0)
        reached = max(reached, end)
    return total
