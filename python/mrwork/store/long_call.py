"""What travels with a long call: its journal, who hears of its progress, and what there is of its result so far."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

from mrwork.base.progress import OnProgress, Progress, since
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import Interrupted
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal

T = TypeVar("T")
SoFar = TypeVar("SoFar")
# Interval at which Ctrl-C is noticed while a thread works [s].
_POLL_SECONDS = 0.05


def interruptible(work: Callable[[], T]) -> T:
    """Do work on a thread, so that Ctrl-C reaches the caller; an abandoned thread ends with the process.

    Only the main thread hears of Ctrl-C: others do the work themselves.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    outcome = Future[T]()

    def body() -> None:
        try:
            outcome.set_result(work())
        except BaseException as error:  # raised again on the caller's thread
            outcome.set_exception(error)

    thread = threading.Thread(target=body, name="mrwork-work", daemon=True)
    thread.start()
    wait_for(thread)
    return outcome.result()


def wait_for(thread: threading.Thread) -> None:
    """Wait until a thread has ended, unless Ctrl-C comes first."""
    while thread.is_alive():
        thread.join(_POLL_SECONDS)


@array_dataclass()
class _Numbers:
    values: Floats


@dataclass(slots=True, kw_only=True, eq=False)
class LongCall(Generic[SoFar]):
    """A computation that can be resumed, watched and stopped.

    `journal` recalls its steps. `on_progress` takes its reports, and ends it by returning true. `so_far` makes the best
    result that there is, `None` where there is none; an interrupt carries it. `began` is the time on the clock of
    `time.perf_counter` [s]; a resumed call has run before that for as long as its journal says.
    """

    journal: Journal | None = None
    on_progress: OnProgress | None = None
    so_far: Callable[[], SoFar | None] | None = None
    began: float = field(default_factory=time.perf_counter)
    _stage_began: Progress | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        if self.journal is not None:
            self.began -= self.journal.seconds_before

    @property
    def seconds(self) -> float:
        """Time since the call began [s]."""
        return time.perf_counter() - self.began

    @property
    def recalling(self) -> bool:
        """Whether the next step is recalled from the journal."""
        return self.journal is not None and self.journal.recalling

    def step(self, name: str, kind: type[T], compute: Callable[[], T], *inputs: object) -> T:
        """The result of a step with these inputs, a dataclass: recalled from the journal, or computed and recorded."""
        if self.journal is None:
            return compute()
        return self.journal.once(name, digest_of(*inputs), kind, compute)

    def array(self, name: str, compute: Callable[[], Floats], *inputs: object) -> Floats:
        """The result of a step as above that is an array."""
        return self.step(name, _Numbers, lambda: _Numbers(values=compute()), *inputs).values

    def ends(self, progress: Progress) -> bool:
        """Report progress with its times, and whether it ends the call; a stage begins here after recalled steps."""
        if self.on_progress is None:
            return False
        progress = replace(progress, seconds=self.seconds)
        began = self._stage_began
        if began is None or began.stage != progress.stage or self.recalling:
            self._stage_began = began = progress
        return not self.recalling and bool(self.on_progress(since(began, progress)))

    def report(self, progress: Progress) -> None:
        """Report progress, but not of steps that are recalled."""
        if self.ends(progress):
            raise Interrupted(None, "computation", stopped=True)

    @contextmanager
    def keeping(self, task: str) -> Iterator[None]:
        """Let an interrupt in the block carry the result so far; its sentence names the task."""
        try:
            yield
        except KeyboardInterrupt as interrupt:
            raise Interrupted(None if self.so_far is None else self.so_far(), task) from interrupt
