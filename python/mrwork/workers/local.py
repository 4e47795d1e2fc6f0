"""Processes of this machine as workers: started for a computation, ended with it and with their parent."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

# Interval at which a worker looks whether its parent is alive [s].
_LOOK_SECONDS = 1.0


@contextmanager
def local_workers(count: int) -> Iterator[ProcessPoolExecutor | None]:
    """A pool of so many processes, `None` for 0, which is ended at once where the block is left.

    The processes are spawned, since a process that has threads of JAX cannot be forked, and leave Ctrl-C to the parent.
    """
    if not count:
        yield None
        return
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=spawn, initializer=_serve, initargs=(os.getpid(),))
    try:
        yield pool
    finally:
        # What they compute is dropped, so nothing is lost.
        processes = [*(pool._processes or {}).values()]  # `terminate_workers` comes with Python 3.14
        for process in processes:
            process.terminate()
        # With its semaphores, which a process that ends at once would leave behind.
        pool.shutdown(wait=True, cancel_futures=True)


def _serve(parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The stdout of a command is for its result.
    os.dup2(2, 1)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, name="mrwork-parent", daemon=True).start()
