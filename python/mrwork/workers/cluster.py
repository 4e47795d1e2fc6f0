"""Workers of a Dask cluster, which somebody has started: its scheduler by address, or by the file that it wrote."""

from __future__ import annotations

import json
import logging
import re
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from mrwork.errors import SettingError, WorkerError, reason_of
from mrwork.store.input_file import FileKind, text_of

# For an answer of the scheduler, and then for the first worker [s].
_SECONDS = 10
_ADDRESS = re.compile(r"(\w+://)?([\w.-]+|\[[0-9a-fA-F:]+\]):\d{1,5}")
_SCHEDULER_FILE = FileKind(name="the file of a scheduler", largest=1 << 20, remedy="give its address instead")


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
    address = address_of(scheduler)
    try:
        from distributed import Client
    except ImportError as reason:
        raise SettingError(
            f"--cluster needs Dask ({reason}); install it with: python -m pip install 'mrwork[cluster]'"
        ) from reason
    # Dask tells of lost connections at length, which become a sentence here.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    client = _connected(Client, address)
    try:
        _wait_for_workers(client, address)
        _refuse_without_package(client, address)
        yield client.get_executor()
    finally:
        # A scheduler that has gone does not answer.
        with suppress(TimeoutError):
            client.close(timeout=1)


def address_of(scheduler: str) -> str:
    """The address itself, or that in the file of a scheduler."""
    address: object = scheduler
    if Path(scheduler).is_file():
        try:
            address = json.loads(text_of(Path(scheduler), _SCHEDULER_FILE))["address"]
        except (LookupError, TypeError, ValueError):
            address = ""
    if not (isinstance(address, str) and _ADDRESS.fullmatch(address)):
        raise SettingError(
            f"--cluster is {scheduler!r}, which is no address and not the file of a scheduler; give "
            "tcp://HOST:8786, or the file that `dask scheduler --scheduler-file FILE` has written"
        )
    return address


def _connected(client: Any, address: str) -> Any:
    try:
        # Versions that matter are compared chunk by chunk.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return client(address, timeout=_SECONDS, set_as_default=False)
    except (OSError, ValueError) as reason:
        raise WorkerError(
            f"no scheduler answers at {address} within {_SECONDS} s ({reason_of(reason)}); start one by "
            "`dask scheduler`, or give its address"
        ) from reason


def _wait_for_workers(client: Any, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_SECONDS)
    except TimeoutError as reason:
        raise WorkerError(
            f"the scheduler at {address} has no worker within {_SECONDS} s; start some by `dask worker {address}`"
        ) from reason


def _refuse_without_package(client: Any, address: str) -> None:
    for who, ask in (("scheduler", client.run_on_scheduler), ("workers", client.run)):
        try:
            ask(version, "mrwork")
        except PackageNotFoundError as reason:
            raise WorkerError(
                f"the {who} at {address} cannot find mrwork; install it in the environment in which Dask was started"
            ) from reason
