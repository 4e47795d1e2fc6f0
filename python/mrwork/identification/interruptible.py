"""Work inside compiled code that Ctrl-C can leave behind."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

# How often a wait looks for Ctrl-C [s].
_WATCH = 0.05

T = TypeVar("T")


def interruptible(work: Callable[[], T]) -> T:
    """Run `work` where Ctrl-C can reach the caller while compiled code holds no interpreter.

    On an interrupt the work is left behind on its thread; it ends with the process.
    """
    outcome: list[T] = []
    failure: list[BaseException] = []

    def body() -> None:
        try:
            outcome.append(work())
        except BaseException as error:  # handed to the caller's thread, whatever it is
            failure.append(error)

    thread = threading.Thread(target=body, name="mrwork-refinement", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_WATCH)
    if failure:
        raise failure[0]
    return outcome[0]
