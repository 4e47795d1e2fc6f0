"""Processes of this machine as workers: started for a computation, ended with it and with their parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class _Pool(ProcessPoolExecutor):
    """A pool whose processes, which start where work is submitted, begin with Ctrl-C blocked: they inherit the mask."""

    def submit(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        if not hasattr(signal, "pthread_sigmask"):
            return super().submit(function, *args, **kwargs)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(function, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def local_workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of so many processes, which is ended at once where the block is left.

    The processes are spawned, since a process that has threads of JAX cannot be forked, and leave Ctrl-C to the parent.
    """
    pool = _Pool(count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_to_serve)
    try:
        yield pool
    finally:
        # What they compute is dropped, so nothing is lost.
        for process in [*(pool._processes or {}).values()]:  # `terminate_workers` comes with Python 3.14
            process.terminate()
        # With its semaphores, which a process that ends at once would leave behind.
        pool.shutdown(wait=True, cancel_futures=True)


def _begin_to_serve() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The stdout of a command is for its result.
    os.dup2(2, 1)
    threading.Thread(target=_end_with_parent, name="mrwork-parent", daemon=True).start()


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
    os._exit(1)
