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
import platform
import shutil
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import cache, wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numpy as np

from mrwork.base.arguments import Whole, checked
from mrwork.base.blas import blas_in_words, one_blas_thread
from mrwork.base.numbers import counted, duration_in_words
from mrwork.errors import MrworkError, WorkerError, reason_of
from mrwork.store.codec import package_version
from mrwork.store.journal import Journal
from mrwork.store.run_folder import chunks_beside

P = ParamSpec("P")
T = TypeVar("T")

# Chunks in flight per worker, so that none waits for the client.
_IN_FLIGHT = 2
# Interval at which Ctrl-C is noticed while chunks are done [s].
_POLL_SECONDS = 0.1
# Values that many chunks share and a worker keeps, the last ones that it was sent.
_KEPT = 8
_RESUME = (
    "a journal keeps what was finished: run again with --resume, on this executor, on another or on none"
)


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
    """What a chunk came to: its value, or the error of the package that ended it; and the kind of its process."""

    value: T | None = None
    error: MrworkError | None = None
    kind: str = ""

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
    arguments: bytes,
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
            _SHARED[shared.digest] = prepare(pickle.loads(shared.data))
            while len(_SHARED) > _KEPT:
                _SHARED.popitem(last=False)
        _SHARED.move_to_end(shared.digest)
        with one_blas_thread():
            value = function(_SHARED[shared.digest], *pickle.loads(arguments))
        return Outcome(value=value, kind=own_kind())
    except MrworkError as error:
        return Outcome(error=error, kind=own_kind())


@cache
def _versions() -> tuple[str, str]:
    return package_version("mrwork"), np.__version__


@cache
def own_kind() -> str:
    """Kind of this process in words: the processor, and for which its BLAS and NumPy compute.

    Lanes have the same bits on every kind. Sums of NumPy and BLAS have them on one.
    """
    table = Path("/proc/cpuinfo")
    lines = table.read_text().splitlines() if table.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    # NumPy shows them in `np.show_runtime` alone.
    features: dict[str, bool] = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    digest = hashlib.sha256(repr(sorted(features.items())).encode()).hexdigest()[:4]
    processor = names[0] if names else platform.processor() or platform.machine()
    return f"{processor} ({blas_in_words()}, NumPy with instructions {digest})"


def kinds_remark(kinds: Iterable[str]) -> str:
    """Sentence on results of several kinds of processes; empty where all are of one."""
    several = sorted({*kinds} - {""})
    if len(several) < 2:
        return ""
    count, kinds = len(several), "; ".join(several)
    return f"done on {count} kinds of processors, on which fits agree to 1e-9 and not to the bit: {kinds}"


@dataclass(slots=True, kw_only=True)
class _Stand:
    """Where work stands: chunks done before it began, done, in total; and when it began."""

    before: int = 0
    done: int = 0
    total: int = 0
    began: float = field(default_factory=time.perf_counter)


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
        Finished chunks of runs are kept beside it until the computation that records there ends.

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
    _sent: set[str] = field(default_factory=set, init=False)

    def __post_init__(self) -> None:
        if not self.in_flight:
            object.__setattr__(self, "in_flight", _IN_FLIGHT * self.n_workers)

    @property
    def n_workers(self) -> int:
        """Number of workers of the executor, or of processors of this machine where it does not tell."""
        if isinstance(told := getattr(self.executor, "_max_workers", None), int) and told > 0:
            return told
        if (client := getattr(self.executor, "_client", None)) is not None:
            return max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
        return os.cpu_count() or 1

    @property
    def in_words(self) -> str:
        """Where the present work stands: chunks done, workers, and the time that is left."""
        chunks = f"{self._stand.done} of {self._stand.total} chunks" if self._stand.total else "chunks"
        stands = f"{chunks} on {counted(self.n_workers, 'worker')}"
        left = self.seconds_left
        return stands if left is None else f"{stands}, about {duration_in_words(left)} left"

    @property
    def seconds_left(self) -> float | None:
        """Time left of the present work [s], if its other chunks last as those that are done; `None` before any is."""
        stand = self._stand
        done = stand.done - stand.before
        return (time.perf_counter() - stand.began) / done * (stand.total - stand.done) if done else None

    @checked
    def outcomes(
        self,
        prepare: Callable[[Any], object],
        function: Callable[..., T],
        shared: Any,
        chunks: Sequence[tuple[object, ...]],
        on_done: Callable[[int, Outcome[T]], None] = lambda number, outcome: None,
        done: Mapping[int, Outcome[T]] = MappingProxyType({}),
    ) -> Iterator[Outcome[T]]:
        """What `function(prepare(shared), *arguments)` comes to for each chunk of arguments, in their order.

        Each is there as soon as it and those before it are done; `on_done` is called on this thread as they come, in
        any order. Chunks that are `done` already are not done again. After Ctrl-C, or where nobody asks any more, those
        that have not begun are cancelled, and what the others come to is dropped.

        Raises
        ------
        WorkerError
            If a worker or the executor is lost, or a worker cannot do a chunk at all.
        """
        versions, whole = _versions(), Shared.of(shared)
        found = dict(done)
        waiting = [number for number in reversed(range(len(chunks))) if number not in found]
        running: dict[Future[Outcome[T] | _Unknown], int] = {}
        # The first chunks carry a shared value that is new, and those of workers that turn out not to have it.
        carrying = set[int]() if whole.digest in self._sent else {*waiting[-self.in_flight :]}
        self._sent.add(whole.digest)
        stand = self._stand
        stand.before = stand.done = len(found)
        stand.total, stand.began = len(chunks), time.perf_counter()
        try:
            for asked in range(len(chunks)):
                while asked not in found:
                    while waiting and len(running) < self.in_flight:
                        number = waiting.pop()
                        sent = whole if number in carrying else Shared(digest=whole.digest)
                        # As bytes, since executors may hand over arrays that are not aligned.
                        arguments = pickle.dumps(chunks[number], protocol=pickle.HIGHEST_PROTOCOL)
                        future = self.executor.submit(
                            work_on_chunk, versions, prepare, function, sent, arguments
                        )
                        running[future] = number
                    ready, _ = wait(running, timeout=_POLL_SECONDS, return_when=FIRST_COMPLETED)
                    for future in ready:
                        number, outcome = running.pop(future), future.result()
                        if isinstance(outcome, _Unknown):
                            carrying.add(number)
                            waiting.append(number)
                            continue
                        found[number] = outcome
                        stand.done += 1
                        on_done(number, outcome)
                yield found.pop(asked)
        except (CancelledError, Exception) as error:
            if isinstance(error, MrworkError):
                raise
            # What others have finished counts.
            for future, number in running.items():
                if future.done() and not future.cancelled() and future.exception() is None:
                    outcome = future.result()
                    if not isinstance(outcome, _Unknown):
                        on_done(number, outcome)
            what = f"{type(error).__name__}: {reason_of(error)}"
            kind = type(self.executor)
            name = f"{kind.__module__.split('.')[0]}'s {kind.__name__}"
            raise WorkerError(f"{name} lost a part of the work ({what}); {_RESUME}") from error
        finally:
            for future in running:
                future.cancel()


_PRESENT: ContextVar[Workers | None] = ContextVar("workers", default=None)


@contextmanager
def working_on(executor: Executor | Workers | None) -> Iterator[None]:
    """Let runs and fits in the block be done on an executor; `None` leaves it as it is."""
    if executor is None:
        yield
        return
    token = _PRESENT.set(executor if isinstance(executor, Workers) else Workers(executor))
    try:
        yield
    finally:
        _PRESENT.reset(token)


def on_executor(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator of a function whose runs and fits are done on its argument `executor`, which it need not hand down.

    Chunks are kept beside its argument `journal`, if there is one, until it ends.
    """

    @wraps(function)
    def working(*args: P.args, **kwargs: P.kwargs) -> T:
        with working_on(cast("Executor | Workers | None", kwargs.get("executor"))):
            workers, journal = present_workers(), cast("Journal | None", kwargs.get("journal"))
            if workers is None or journal is None:
                return function(*args, **kwargs)
            kept = chunks_beside(journal.path)
            if not journal.recalling:
                shutil.rmtree(kept, ignore_errors=True)
            with working_on(replace(workers, journal=journal)):
                result = function(*args, **kwargs)
            shutil.rmtree(kept, ignore_errors=True)
            return result

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
    for end, own in enumerate(costs, start=1):
        cost += own
        if cost >= least:
            slices.append(slice(start, end))
            start, cost = end, 0.0
    if start < end:
        slices.append(slice(start, end))
    return slices
