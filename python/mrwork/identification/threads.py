"""Work on several tests at once: a test on each thread, the calling thread included."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

# Interval at which Ctrl-C is noticed while compiled code runs [s].
_POLL_SECONDS = 0.05


def on_every_test(n_tests: int, threads: int, work: Callable[[int, int], T]) -> list[T]:
    """Results of `work(index, threads)` of every test, in the order of the tests.

    As many tests as there are threads run at once, on one thread each; what is left over shares all threads. `threads`
    are 0 for all. Where `work` fails, its error of the first such test is raised. After Ctrl-C no test is started, and
    those that run are abandoned; the threads of these end with the process.
    """
    available = threads or _processors()
    if n_tests == 1 or available == 1:
        return [work(index, threads) for index in range(n_tests)]
    left_over = n_tests % available
    shared = available // left_over if left_over else 1
    queue = iter([(index, 1 if index < n_tests - left_over else shared) for index in range(n_tests)])
    results: dict[int, T] = {}
    failures: dict[int, BaseException] = {}

    def share() -> None:
        # An iterator of a list gives each of its items to one thread only.
        for index, own in queue:
            if failures:
                return
            try:
                results[index] = work(index, own)
            except BaseException as error:  # raised again on the caller's thread
                failures[index] = error

    others = [
        threading.Thread(target=share, name="mrwork-test", daemon=True)
        for _ in range(min(available, n_tests) - 1)
    ]
    try:
        for other in others:
            other.start()
        share()
        if not any(isinstance(error, KeyboardInterrupt) for error in failures.values()):
            for other in others:
                wait_for(other)
    except KeyboardInterrupt as interrupt:
        failures[-1] = interrupt
    if failures:
        raise min(failures.items(), key=lambda failure: (isinstance(failure[1], Exception), failure[0]))[1]
    return [results[index] for index in range(n_tests)]


def wait_for(thread: threading.Thread) -> None:
    """Wait until a thread has ended, unless Ctrl-C comes first."""
    while thread.is_alive():
        thread.join(_POLL_SECONDS)


def _processors() -> int:
    """Number of processors of this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
