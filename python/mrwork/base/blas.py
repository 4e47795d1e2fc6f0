"""One thread of BLAS: OpenBLAS sums in another order on two threads, which gives other bits."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

_LOCK = threading.Lock()
_THREADS = "OPENBLAS_NUM_THREADS"


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Multiply matrices on one thread in the block, also where NumPy has been loaded with more.

    The number of threads is one of the process: it is back when the last block, on any thread, has ended.
    """
    with _LOCK:
        if not _LIMIT.blocks:
            _LIMIT.begin()
        _LIMIT.blocks += 1
    try:
        yield
    finally:
        with _LOCK:
            _LIMIT.blocks -= 1
            if not _LIMIT.blocks:
                _LIMIT.end()


on_one_blas_thread = one_blas_thread()
"""Decorator of a function that is done within `one_blas_thread`."""


@dataclass(slots=True)
class _Limit:
    """Open blocks, the limit of the first of them, and the variable that limits a BLAS which is loaded later."""

    blocks: int = 0
    present: Any = None
    variable: str | None = None

    def begin(self) -> None:
        loaded = _controller("scipy.linalg" in sys.modules)
        self.present = loaded.limit(limits=1, user_api="blas")
        self.variable = os.environ.get(_THREADS)
        os.environ[_THREADS] = "1"

    def end(self) -> None:
        self.present.restore_original_limits()
        if self.variable is None:
            del os.environ[_THREADS]
        else:
            os.environ[_THREADS] = self.variable


_LIMIT = _Limit()


@cache
def _controller(with_scipy: bool) -> Any:  # noqa: ARG001, of the cache
    """Of the libraries that are loaded, which are more with SciPy."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
