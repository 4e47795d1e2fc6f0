"""Workers of a Dask cluster, which somebody has started: its scheduler by address, or by the file that it wrote."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mrwork.errors import SettingError, WorkerError, reason_of

# For an answer of the scheduler, and then for the first worker [s].
_SECONDS = 10


@contextmanager
def cluster_workers(scheduler: str | None) -> Iterator[Executor | None]:
    """The workers of a scheduler, `None` without one; security is that of Dask's own configuration.

    Raises
    ------
    SettingError
        If `scheduler` is no address and no file, or Dask is not installed.
    WorkerError
        If nobody answers in ten seconds, or the scheduler has no worker.
    """
    if scheduler is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError as reason:
        raise SettingError(
            f"--cluster needs Dask ({reason}); install it with: python -m pip install 'mrwork[cluster]'"
        ) from reason
    # Dask tells of lost connections at length, which become a sentence here.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    client = _connected(Client, scheduler)
    try:
        _wait_for_workers(client, scheduler)
        yield client.get_executor()
    finally:
        # A scheduler that has gone does not answer.
        with suppress(TimeoutError):
            client.close(timeout=1)


def _connected(client: Any, scheduler: str) -> Any:
    given = {"scheduler_file": scheduler} if Path(scheduler).is_file() else {"address": scheduler}
    if "address" in given and ":" not in scheduler:
        raise SettingError(
            f"--cluster is {scheduler!r}, which is no file here and no address; give tcp://HOST:8786, or the file that "
            "`dask scheduler --scheduler-file FILE` has written"
        )
    try:
        return client(**given, timeout=_SECONDS, set_as_default=False)
    except (OSError, ValueError, KeyError, TypeError) as reason:
        raise WorkerError(
            f"no scheduler answers at {scheduler} within {_SECONDS} s ({reason_of(reason)}); start one by "
            "`dask scheduler`, or give its address"
        ) from reason


def _wait_for_workers(client: Any, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_SECONDS)
    except TimeoutError as reason:
        raise WorkerError(
            f"the scheduler at {scheduler} has no worker within {_SECONDS} s; start some by `dask worker {scheduler}`"
        ) from reason
