"""Chunks of work on an executor: a bounded number in flight, results in their order, failures as values.

An executor is anything with the interface of `concurrent.futures.Executor`: a pool of processes, Dask's
`Client.get_executor()`, `mpi4py.futures.MPIPoolExecutor`, loky. A chunk is a function that another process can import,
with plain values. What it computes depends on these alone, so that its result is the same wherever it is done. Queues,
retries, lost workers and security are the executor's.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from importlib.metadata import version
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numpy as np

from mrwork.errors import MrworkError, WorkerError, reason_of

P = ParamSpec("P")
S = TypeVar("S")
T = TypeVar("T")

# Chunks in flight per worker, so that none waits for the client.
_IN_FLIGHT = 2
# Interval at which Ctrl-C is noticed while chunks are done [s].
_POLL_SECONDS = 0.1
# Values that many chunks share and a worker keeps, the last ones that it was sent.
_KEPT = 8
_RESUME = "what was finished is kept; run again with --resume, on this executor, on another or on none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Shared:
    """A value that many chunks share, as bytes with their digest; a worker that has it is sent the digest alone."""

    digest: str
    data: bytes = b""

    @classmethod
    def of(cls, value: object) -> Shared:
        """The value with its bytes."""
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        return cls(digest=hashlib.sha256(data).hexdigest(), data=data)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome(Generic[T]):
    """What a chunk came to: its value, or the error of the package that ended it."""

    value: T | None = None
    error: MrworkError | None = None

    def get(self) -> T:
        """The value; the error is raised."""
        if self.error is not None:
            raise self.error
        return cast("T", self.value)


class _Unknown:
    """The answer of a worker that was sent the digest of a value which it does not have."""


_SHARED: OrderedDict[str, object] = OrderedDict()


def work_on_chunk(
    versions: tuple[str, str],
    prepare: Callable[[Any], object],
    function: Callable[..., T],
    shared: Shared,
    arguments: tuple[object, ...],
) -> Outcome[T] | _Unknown:
    """Do a chunk on a worker, which prepares what chunks share once; an error of the package is a value."""
    if (own := _versions()) != versions:
        has, needs = (f"mrwork {each[0]} with NumPy {each[1]}" for each in (own, versions))
        return Outcome(
            error=WorkerError(f"a worker has {has}, and this process {needs}; install the same there")
        )
    try:
        if shared.digest not in _SHARED:
            if not shared.data:
                return _Unknown()
            value = pickle.loads(shared.data)
            _SHARED[shared.digest] = prepare(value)
            while len(_SHARED) > _KEPT:
                _SHARED.popitem(last=False)
        _SHARED.move_to_end(shared.digest)
        return Outcome(value=function(_SHARED[shared.digest], *arguments))
    except MrworkError as error:
        return Outcome(error=error)


def _versions() -> tuple[str, str]:
    return version("mrwork"), np.__version__


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """An executor, and how many chunks are given to it at once."""

    executor: Executor
    in_flight: int

    @classmethod
    def on(cls, executor: Executor, in_flight: int = 0) -> Engine:
        """The engine of an executor; without a number twice as many chunks as it has workers."""
        return cls(executor=executor, in_flight=in_flight or _IN_FLIGHT * _count_workers(executor))

    def outcomes(
        self,
        prepare: Callable[[S], object],
        function: Callable[..., T],
        shared: S,
        chunks: Sequence[tuple[object, ...]],
        on_done: Callable[[int, Outcome[T]], None] = lambda number, outcome: None,
    ) -> list[Outcome[T]]:
        """What `function(prepare(shared), *arguments)` comes to for each chunk of arguments, in their order.

        `on_done` is called on this thread with each outcome as it comes. After Ctrl-C chunks that have not begun are
        cancelled, and what those that have come to is dropped.

        Raises
        ------
        WorkerError
            If a worker or the executor is lost, or a worker cannot do a chunk at all.
        """
        versions, whole = _versions(), Shared.of(shared)
        done: dict[int, Outcome[T]] = {}
        waiting = list(reversed(range(len(chunks))))
        running: dict[Future[Outcome[T] | _Unknown], int] = {}
        # The first chunks carry the shared value, and those of workers that turn out not to have it.
        carrying = set(range(min(self.in_flight, len(chunks))))
        try:
            while waiting or running:
                while waiting and len(running) < self.in_flight:
                    number = waiting.pop()
                    sent = whole if number in carrying else Shared(digest=whole.digest)
                    future = self.executor.submit(
                        work_on_chunk, versions, prepare, function, sent, chunks[number]
                    )
                    running[future] = number
                ready, _ = wait(running, timeout=_POLL_SECONDS, return_when=FIRST_COMPLETED)
                for future in ready:
                    number, outcome = running.pop(future), future.result()
                    if isinstance(outcome, _Unknown):
                        carrying.add(number)
                        waiting.append(number)
                        continue
                    done[number] = outcome
                    on_done(number, outcome)
        except (CancelledError, Exception) as error:
            if isinstance(error, MrworkError):
                raise
            what = f"{type(error).__name__}: {reason_of(error)}"
            raise WorkerError(
                f"{_name_of(self.executor)} lost a part of the work ({what}); {_RESUME}"
            ) from error
        finally:
            for future in running:
                future.cancel()
        return [done[number] for number in range(len(chunks))]


def _count_workers(executor: Any) -> int:
    """Workers of an executor, or processors of this machine where it does not tell."""
    if isinstance(told := getattr(executor, "_max_workers", None), int) and told > 0:
        return told
    if (client := getattr(executor, "_client", None)) is not None:
        return max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
    return os.cpu_count() or 1


def _name_of(executor: Executor) -> str:
    return f"{type(executor).__module__.split('.')[0]}'s {type(executor).__name__}"


_PRESENT: ContextVar[Engine | None] = ContextVar("engine", default=None)


@contextmanager
def working_on(executor: Executor | Engine | None) -> Iterator[None]:
    """Let runs and fits in the block be done on an executor; `None` leaves it as it is."""
    if executor is None:
        yield
        return
    token = _PRESENT.set(executor if isinstance(executor, Engine) else Engine.on(executor))
    try:
        yield
    finally:
        _PRESENT.reset(token)


def on_executor(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator of a function whose runs and fits are done on its argument `executor`, which it need not hand down."""

    @wraps(function)
    def working(*args: P.args, **kwargs: P.kwargs) -> T:
        with working_on(cast("Executor | None", kwargs.get("executor"))):
            return function(*args, **kwargs)

    return working


def present_engine() -> Engine | None:
    """The engine of the innermost block, `None` where this process works itself."""
    return _PRESENT.get()


def cut_into_chunks(costs: Iterable[float], least: float) -> list[slice]:
    """Slices of consecutive items whose costs add up to `least` or more; they depend on the costs alone."""
    slices, start, cost, end = list[slice](), 0, 0.0, 0
    for end, own in enumerate(costs, start=1):
        cost += own
        if cost >= least:
            slices.append(slice(start, end))
            start, cost = end, 0.0
    if start < end:
        slices.append(slice(start, end))
    return slices
