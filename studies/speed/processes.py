"""A process per number of threads: jax and numba size their thread pools when they are imported.

The parent starts a worker on its cores and reads its messages: one JSON object with one key per line of stdout.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from mrwork.errors import MrworkError, SettingError
from studies.common.records import ROOT

S = TypeVar("S")


def cores_for(threads: Sequence[int]) -> list[int]:
    """Return the cores that this process may use, at least as many as the largest of `threads`."""
    cores = list(range(os.cpu_count() or 1))
    if sys.platform == "linux":
        cores = sorted(os.sched_getaffinity(0))
    if max(threads) > len(cores):
        raise SettingError(
            f"{max(threads)} threads were requested, this machine offers {len(cores)} core(s); "
            "give fewer threads"
        )
    return cores


def run_worker(module: str, cores: Sequence[int], arguments: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Run `module` with the cores and `arguments`; yield its messages, kind and content, as they come."""
    count = str(len(cores))
    folders = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(folders),
        "NUMBA_NUM_THREADS": count,
        "OMP_NUM_THREADS": count,
        "RAYON_NUM_THREADS": count,
        "JAX_PLATFORMS": "cpu",
        "JAX_NUM_CPU_DEVICES": count,
    }
    command = [sys.executable, "-m", module, ",".join(map(str, cores)), *arguments]
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as errors,
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=errors, env=environment, text=True
        ) as worker,
    ):
        try:
            for line in worker.stdout or ():
                ((kind, content),) = json.loads(line).items()
                if kind == "failure":
                    raise MrworkError(content)
                yield kind, content
        except BaseException:
            # Also if the caller is interrupted or stops iterating, since leaving the block waits for the worker.
            worker.kill()
            raise
        if worker.wait() != 0:
            errors.seek(0)
            last = (errors.read().strip().splitlines() or ["no message"])[-1]
            raise MrworkError(
                f"the benchmark process on {count} core(s) ended with code {worker.returncode}: {last}"
            )


def pin(cores: Sequence[int]) -> None:
    """Restrict this process, a worker, to its cores, where the system can."""
    if sys.platform == "linux":
        os.sched_setaffinity(0, cores)


def serve(settings: Callable[..., S], measure: Callable[[S, int], None]) -> None:
    """Run a worker: read cores and settings from the command line, and measure with a thread per core."""
    cores = [int(core) for core in sys.argv[1].split(",")]
    given = settings(**json.loads(sys.argv[2]))
    pin(cores)
    try:
        measure(given, len(cores))
    except MrworkError as error:
        send("failure", str(error))


def send(kind: str, content: object) -> None:
    """Send a message to the parent."""
    print(json.dumps({kind: content}), flush=True)
