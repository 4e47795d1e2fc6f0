"""Chunks of work on an executor: a bounded number in flight, results in their order.

An executor is anything with the interface of `concurrent.futures.Executor`: a pool of processes, Dask's
`Client.get_executor()`, `mpi4py.futures.MPIPoolExecutor`, loky. A chunk is a function that another process can import,
with plain values. What it computes depends on these alone, so that its result is the same wherever it is done. Queues,
retries, lost workers and security are the executor's.
"""

from __future__ import annotations

import os
import pickle
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import lru_cache, wraps
from itertools import islice
from typing import Any, ParamSpec, TypeVar

from mrwork.base.arguments import Whole, checked
from mrwork.base.blas import one_blas_thread
from mrwork.base.numbers import counted
from mrwork.errors import MrworkError, WorkerError, reason_of
from mrwork.store.journal import Journal
from mrwork.store.run_folder import chunks_beside

P = ParamSpec("P")
T = TypeVar("T")

_IN_FLIGHT = 2  # per worker, so that none waits for the client
# Interval at which Ctrl-C is noticed while chunks are done [s].
_POLL_SECONDS = 0.1


def work_on_chunk(common: bytes, arguments: bytes) -> Any:
    """Do a chunk on a worker, on one thread of BLAS."""
    function, shared = _prepared(common)
    with one_blas_thread():
        return function(shared, *pickle.loads(arguments))


@lru_cache(maxsize=2)
def _prepared(common: bytes) -> tuple[Callable[..., Any], object]:
    """The function of chunks and what they share, which a worker prepares once."""
    prepare, function, shared = pickle.loads(common)
    return function, prepare(shared)


@dataclass(slots=True)
class _Stand:
    done: int = 0
    total: int = 0


@checked
@dataclass(frozen=True, slots=True)
class Workers:
    """An executor, and how many chunks are given to it at once.

    Parameters
    ----------
    executor
        As of `concurrent.futures`.
    in_flight
        Chunks that it is given at once; 0 for twice as many as it has workers, or as this machine has processors where
        it does not tell.
    journal
        Finished chunks of runs are kept beside it.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import mrwork as mr
    >>> mr.Workers(ThreadPoolExecutor(3)).in_flight
    6
    """

    executor: Executor
    in_flight: Whole = 0
    journal: Journal | None = field(default=None, kw_only=True)
    _stand: _Stand = field(default_factory=_Stand, init=False)

    def __post_init__(self) -> None:
        if not self.in_flight:
            object.__setattr__(self, "in_flight", _IN_FLIGHT * self.n_workers)

    @property
    def n_workers(self) -> int:
        """Number of workers of the executor, or of processors of this machine where it does not tell."""
        if isinstance(count := getattr(self.executor, "_max_workers", None), int) and count > 0:
            return count
        if (client := getattr(self.executor, "_client", None)) is not None:
            return max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
        return os.cpu_count() or 1

    @property
    def in_words(self) -> str:
        """Where the present work stands: chunks done, and workers."""
        stand = self._stand
        chunks = f"{stand.done} of {stand.total} chunks" if stand.total else "chunks"
        return f"{chunks} on {counted(self.n_workers, 'worker')}"

    @checked
    def futures(
        self,
        prepare: Callable[[Any], object],
        function: Callable[..., T],
        shared: Any,
        chunks: Sequence[tuple[object, ...]],
        on_done: Callable[[int, Future[T]], None] = lambda number, future: None,
    ) -> Iterator[Future[T]]:
        """What `function(prepare(shared), *arguments)` comes to for each chunk of arguments, in their order.

        Each is there as soon as it and those before it are done, with its value or an error of the package; `on_done`
        is called on this thread as they come, in any order. After Ctrl-C, or where nobody asks any more, those that
        have not begun are cancelled, and what the others come to is dropped.

        Raises
        ------
        WorkerError
            If a worker or the executor is lost, or a worker cannot do a chunk at all.
        """
        common = pickle.dumps((prepare, function, shared), protocol=pickle.HIGHEST_PROTOCOL)
        waiting = iter(enumerate(chunks))
        running: dict[Future[T], int] = {}
        done: dict[int, Future[T]] = {}
        stand = self._stand
        stand.done, stand.total = 0, len(chunks)
        try:
            for asked in range(len(chunks)):
                while asked not in done:
                    for number, chunk in islice(waiting, self.in_flight - len(running)):
                        # As bytes, since executors may hand over arrays that are not aligned.
                        arguments = pickle.dumps(chunk, protocol=pickle.HIGHEST_PROTOCOL)
                        running[self.executor.submit(work_on_chunk, common, arguments)] = number
                    ready, _ = wait(running, timeout=_POLL_SECONDS, return_when=FIRST_COMPLETED)
                    for future in ready:
                        number = running.pop(future)
                        if not isinstance(error := future.exception(), MrworkError | None):
                            raise error
                        done[number] = future
                        stand.done += 1
                        on_done(number, future)
                yield done.pop(asked)
        except MrworkError:
            raise
        except Exception as error:
            name, kind = type(self.executor).__name__, type(error).__name__
            raise WorkerError(
                f"{name} lost a part of the work ({kind}: {reason_of(error)}); a journal keeps what was finished: run "
                "again with --resume, on this executor, on another or on none"
            ) from error
        finally:
            for future in running:
                future.cancel()


_PRESENT: ContextVar[Workers | None] = ContextVar("workers", default=None)


@contextmanager
def working_on(executor: Executor | Workers | None, journal: Journal | None = None) -> Iterator[None]:
    """Let runs and fits in the block be done on an executor; `None` leaves it as it is.

    Finished chunks of runs are kept beside the journal, if there is one, until the block ends without an error.
    """
    workers = Workers(executor) if isinstance(executor, Executor) else executor or present_workers()
    folder = None
    if workers is not None and journal is not None:
        workers, folder = replace(workers, journal=journal), chunks_beside(journal.path)
        if not journal.recalling:
            shutil.rmtree(folder, ignore_errors=True)
    token = _PRESENT.set(workers)
    try:
        yield
    finally:
        _PRESENT.reset(token)
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)


def on_executor(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator of a function whose block is `working_on` its arguments `executor` and `journal`."""

    @wraps(function)
    def working(*args: Any, **kwargs: Any) -> Any:
        with working_on(kwargs.get("executor"), kwargs.get("journal")):
            return function(*args, **kwargs)

    return working


def present_workers() -> Workers | None:
    """The workers of the innermost block, `None` where this process works itself."""
    return _PRESENT.get()


def by_whom() -> str:
    """Who works, after a label of progress: " on 2 workers", empty where this process does."""
    workers = present_workers()
    return "" if workers is None else f" on {counted(workers.n_workers, 'worker')}"


def cut_into_chunks(costs: Iterable[float], least: float) -> list[slice]:
    """Slices of consecutive items whose costs add up to `least` or more; they depend on the costs alone."""
    slices, start, cost, end = list[slice](), 0, 0.0, 0
    for end, item_cost in enumerate(costs, start=1):
        cost += item_cost
        if cost >= least:
            slices.append(slice(start, end))
            start, cost = end, 0.0
    if start < end:
        slices.append(slice(start, end))
    return slices
