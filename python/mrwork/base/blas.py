"""One thread of BLAS: OpenBLAS sums in another order on two threads, which gives other bits."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

_LOCK = threading.Lock()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Multiply matrices on one thread in the block, also where NumPy has been loaded with more.

    The number of threads is one of the process: it is back when the last block, on any thread, has ended.
    """
    limit = _limit()
    with _LOCK:
        limit.blocks += 1
        if limit.blocks == 1:
            limit.present = limit.controller.limit(limits=1, user_api="blas")
    try:
        yield
    finally:
        with _LOCK:
            limit.blocks -= 1
            if not limit.blocks:
                limit.present.restore_original_limits()


def on_one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Decorator of a function that is done within `one_blas_thread`."""

    @wraps(function)
    def alone(*args: P.args, **kwargs: P.kwargs) -> T:
        with one_blas_thread():
            return function(*args, **kwargs)

    return alone


def blas_in_words() -> str:
    """The libraries of BLAS of this process: version, and kind of processor for which each computes."""
    found = {
        f"{each['internal_api']} {each['version']} for {each.get('architecture') or 'any processor'}"
        for each in _limit().controller.info()
        if each["user_api"] == "blas"
    }
    return " and ".join(sorted(found))


@dataclass(slots=True)
class _Limit:
    """Open blocks, and the limit that the first of them has set."""

    controller: Any
    blocks: int = 0
    present: Any = None


@cache
def _limit() -> _Limit:
    # SciPy's BLAS is a second one, which must be there to be found.
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return _Limit(controller=ThreadpoolController())
