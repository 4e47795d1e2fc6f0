"""Pieces of work that do not need each other: one after the other here, or by the workers that there are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import mrwork as mr

S = TypeVar("S")
P = TypeVar("P")
T = TypeVar("T")


def results_of(
    prepare: Callable[[S], P], function: Callable[..., T], shared: S, pieces: Sequence[tuple[object, ...]]
) -> Iterator[T]:
    """`function(prepare(shared), *arguments)` of each piece in turn, worked out when it is asked for.

    Workers import the functions, and work ahead.
    """
    workers = mr.present_workers()
    if workers is not None:
        yield from (outcome.get() for outcome in workers.outcomes(prepare, function, shared, pieces))
        return
    prepared = prepare(shared)
    yield from (function(prepared, *arguments) for arguments in pieces)
