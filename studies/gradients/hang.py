"""Whether a call ever hangs or changes a bit: many threads on a loaded machine, and processes that share programs."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import mrwork as mr
from mrwork.errors import MrworkError
from mrwork.report import Table
from studies.former.table import Cell, table_of
from studies.gradients.posed import near_nominal, record

MODEL = "normalised_bouc_wen"
_BATCH = 8
# How often the main thread looks [s].
_LOOKS = 0.5
_COUNTED = {
    "/jax/compilation_cache/cache_hits": "hits",
    "/jax/compilation_cache/cache_misses": "misses",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ThreadRow:
    """Calls of several threads beside busy processes; `longest_pause` [s] is that of all threads at once."""

    calls: int
    threads: int
    busy: int
    seconds: float
    load: float
    longest_pause: float
    changed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CacheRow:
    """A process on a folder of compiled programs: which it found there, and a digest of what it computed."""

    process: str
    hits: int
    misses: int
    files: int
    seconds: float
    digest: str


def measure(
    *, threads: int, n_time: int, calls: int, callers: int, busy: int, patience: float
) -> Iterator[ThreadRow | str]:
    """Call value and gradient, of a point and of a batch, in turn; a `patience` [s] without a call is a failure."""
    functions = _functions(n_time, threads)
    expected = [function() for function in functions]
    done, changed, pauses = [0] * callers, [0] * callers, [0.0]

    def call(caller: int) -> None:
        while done[caller] < -(-calls // callers):
            place = (caller + done[caller]) % len(functions)
            changed[caller] += functions[place]() != expected[place]
            done[caller] += 1

    with _busy(busy):
        workers = [threading.Thread(target=call, args=(each,), daemon=True) for each in range(callers)]
        began = moved = time.perf_counter()
        for worker in workers:
            worker.start()
        last = told = 0
        while alive := [worker for worker in workers if worker.is_alive()]:
            alive[0].join(_LOOKS)
            now = time.perf_counter()
            if sum(done) > last:
                last, moved = sum(done), now
            pauses.append(now - moved)
            if now - moved > patience:
                raise MrworkError(
                    f"{callers} threads made no call for {patience:g} s after {last} of {calls}: they hang; look "
                    "at them with py-spy or gdb"
                )
            if last >= told + calls // 10:
                told = last
                yield f"{last} of {calls} calls"
        if sum(done) < calls:
            raise MrworkError(
                f"{calls} calls were expected and {sum(done)} made; read the traces of the threads"
            )
        yield ThreadRow(
            calls=sum(done),
            threads=callers,
            busy=busy,
            seconds=time.perf_counter() - began,
            load=os.getloadavg()[0],
            longest_pause=max(pauses),
            changed=sum(changed),
        )


def _functions(n_time: int, threads: int) -> list[Callable[[], bytes]]:
    """Misfit and its gradient of a point, and of a batch on the threads of the core, as bytes."""
    misfit = mr.jax.misfit(MODEL, record(MODEL, n_time), threads=threads)
    point, batch = jnp.asarray(near_nominal(MODEL, 1)), jnp.asarray(near_nominal(MODEL, _BATCH))
    value, gradient = jax.jit(misfit), jax.jit(jax.grad(misfit))
    values, gradients = jax.jit(jax.vmap(misfit, (0, None))), jax.jit(jax.vmap(jax.grad(misfit), (0, None)))
    return [
        lambda function=function, given=given: np.asarray(function(given, misfit.data)).tobytes()  # type: ignore[misc] # its type is that of the defaults
        for function, given in ((value, point), (gradient, point), (values, batch), (gradients, batch))
    ]


@contextmanager
def _busy(count: int) -> Iterator[None]:
    """Processes that compute and do nothing else."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def cached(*, threads: int, n_time: int, folder: str, process: str) -> Iterator[CacheRow]:
    """What one process finds in a folder of compiled programs."""
    config: Any = jax.config
    config.update("jax_compilation_cache_dir", folder)
    config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    heard: list[str] = []
    jax.monitoring.register_event_listener(lambda event, **_: heard.append(_COUNTED.get(event, "")))
    began = time.perf_counter()
    found = b"".join(function() for function in _functions(n_time, threads))
    seconds = time.perf_counter() - began
    files = [file for file in Path(folder).iterdir() if not file.name.endswith("-atime")]
    yield CacheRow(
        process=process,
        hits=heard.count("hits"),
        misses=heard.count("misses"),
        files=len(files),
        seconds=seconds,
        digest=hashlib.sha256(found).hexdigest()[:12],
    )


def judged(rows: Sequence[ThreadRow | CacheRow]) -> dict[str, int]:
    """Calls whose bits changed, different digests of the processes, and programs that the last one compiled again."""
    processes = [row for row in rows if isinstance(row, CacheRow)]
    return {
        "changed": sum(row.changed for row in rows if isinstance(row, ThreadRow)),
        "digests": len({row.digest for row in processes}),
        "compiled_again": processes[-1].misses,
    }


def tables(rows: Sequence[ThreadRow | CacheRow]) -> Iterator[Table]:
    """Threads, and processes on one folder."""
    columns: dict[str, Cell] = {
        "changed bits": "{changed}",
        "seconds": "{seconds:.0f}",
        "load": "{load:.1f}",
        "longest pause s": "{longest_pause:.1f}",
    }
    threads = [asdict(row) for row in rows if isinstance(row, ThreadRow)]
    if threads:
        yield table_of(
            "Threads on a loaded machine",
            "calls",
            (
                (f"{row['calls']} of {row['threads']} threads beside {row['busy']} busy processes", row)
                for row in threads
            ),
            columns,
        )
    processes = [asdict(row) for row in rows if isinstance(row, CacheRow)]
    if processes:
        columns = {
            "programs found": "{hits}",
            "compiled": "{misses}",
            "files": "{files}",
            "seconds to the first values": "{seconds:.2f}",
            "digest of values and gradients": "{digest}",
        }
        yield table_of(
            "Processes that share compiled programs",
            "process",
            ((row["process"], row) for row in processes),
            columns,
        )
