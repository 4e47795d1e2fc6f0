"""One protocol of workers: a job runs in a process of its own, pinned to its cores, and its rows come back.

jax and numba size their thread pools when they are imported, so every number of threads has a process. A job is a
generator function of a module. It takes plain values and the number of threads, and yields texts, which tell the
progress, and rows, which are dataclasses of plain values. They are lines of JSON on the stdout of the worker.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, is_dataclass
from importlib import import_module
from typing import Any

from mrwork.errors import MrworkError, SettingError
from studies.former.records import ROOT

Say = Callable[[str], None]
"""Tells a person what is measured now."""


def silent(what: str) -> None:
    """Tell nothing."""


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


def rows_of(
    job: Callable[..., Iterator[Any]], cores: Sequence[int], settings: Mapping[str, Any], say: Say = silent
) -> Iterator[Any]:
    """Rows that `job(threads=len(cores), **settings)` yields in a process on these cores, as they come."""
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
    given = json.dumps([list(cores), job.__module__, job.__name__, settings])
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as errors,
        subprocess.Popen(
            [sys.executable, "-m", __name__, given],
            stdout=subprocess.PIPE,
            stderr=errors,
            env=environment,
            text=True,
        ) as worker,
    ):
        try:
            for line in worker.stdout or ():
                kind, content = json.loads(line)
                if kind == "failure":
                    raise MrworkError(content)
                if kind == "progress":
                    say(f"{count} thread(s), {content}")
                else:
                    module, name = kind
                    yield getattr(import_module(module), name)(**content)
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


def main() -> None:
    """Run the job that the command line names, in the process of the worker."""
    cores, module, name, settings = json.loads(sys.argv[1])
    if sys.platform == "linux":
        os.sched_setaffinity(0, cores)
    try:
        for row in getattr(import_module(module), name)(threads=len(cores), **settings):
            if is_dataclass(row) and not isinstance(row, type):
                _send((type(row).__module__, type(row).__name__), asdict(row))
            else:
                _send("progress", row)
    except MrworkError as error:
        _send("failure", str(error))


def _send(kind: str | tuple[str, str], content: object) -> None:
    print(json.dumps([kind, content]), flush=True)


if __name__ == "__main__":
    main()
