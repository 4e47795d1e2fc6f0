"""Workers of a Dask cluster, which somebody has started: its scheduler by address, or by the file that it wrote."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from mrwork.errors import SettingError, WorkerError, reason_of

# For an answer of the scheduler, and then for the first worker [s].
_SECONDS = 10
# Packages of which client, scheduler and workers need one version; the scheduler looks into what it passes on.
_SAME_VERSION = ("mrwork", "numpy")


@contextmanager
def cluster_workers(scheduler: str) -> Iterator[Executor]:
    """The workers of a scheduler, with the security of Dask's own configuration.

    Raises
    ------
    WorkerError
        If nobody answers in ten seconds, the scheduler has no worker, or versions differ.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as reason:
        raise SettingError(
            f"--cluster needs Dask ({reason}); install it with: python -m pip install 'mrwork[cluster]'"
        ) from reason
    # Dask tells of lost connections at length, which become a sentence here.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    address = {"scheduler_file" if Path(scheduler).is_file() else "address": scheduler}
    try:
        # Versions that matter are compared below.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            client = distributed.Client(**address, timeout=_SECONDS, set_as_default=False)
    except Exception as reason:  # of an address, or of whatever is in a file
        raise WorkerError(
            f"no scheduler answers at {scheduler} within {_SECONDS} s ({reason_of(reason)}); give tcp://HOST:8786, or "
            "the file that `dask scheduler --scheduler-file FILE` has written"
        ) from reason
    try:
        _wait_for_workers(client, scheduler)
        yield client.get_executor()
    finally:
        # A scheduler that has gone does not answer.
        with suppress(TimeoutError):
            client.close(timeout=1)


def _wait_for_workers(client: Any, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_SECONDS)
    except TimeoutError as reason:
        raise WorkerError(
            f"the scheduler at {scheduler} has no worker within {_SECONDS} s; start some by "
            f"`dask worker {client.scheduler.address}`"
        ) from reason
    versions = client.get_versions(packages=_SAME_VERSION)
    needed = versions["client"]["packages"]
    for who, answer in {"scheduler": versions["scheduler"], **versions["workers"]}.items():
        for package in _SAME_VERSION:
            if (version := answer["packages"][package]) != needed[package]:
                raise WorkerError(
                    f"{who} has {package} {version}, and this process {needed[package]}; install the same in the "
                    "environment in which Dask was started"
                )
