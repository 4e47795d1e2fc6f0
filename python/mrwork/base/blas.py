"""One thread of BLAS: OpenBLAS sums in another order on two threads, which gives other bits."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from typing import Any

_LOCK = threading.Lock()
_THREADS = "OPENBLAS_NUM_THREADS"
# Open blocks, and the limit of the first of them.
_blocks = 0
_HELD = ExitStack()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Multiply matrices on one thread in the block, also where NumPy has been loaded with more.

    The number of threads is one of the process: it is back when the last block, on any thread, has ended.
    """
    global _blocks
    with _LOCK:
        if not _blocks:
            _HELD.enter_context(_limited())
        _blocks += 1
    try:
        yield
    finally:
        with _LOCK:
            _blocks -= 1
            if not _blocks:
                _HELD.close()


on_one_blas_thread = one_blas_thread()
"""Decorator of a function that is done within `one_blas_thread`."""


@contextmanager
def _limited() -> Iterator[None]:
    limit = _controller("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas")
    before = os.environ.get(_THREADS)
    os.environ[_THREADS] = "1"
    yield
    limit.restore_original_limits()
    if before is None:
        del os.environ[_THREADS]
    else:
        os.environ[_THREADS] = before


@cache
def _controller(with_scipy: bool) -> Any:  # noqa: ARG001, of the cache
    """Of the libraries that are loaded, which are more with SciPy."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
