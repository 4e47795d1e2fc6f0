"""Ctrl-C and SIGTERM of a command: while it starts, while it runs, and when it has ended.

It stands apart and loads nothing, because it must be there before anything else is loaded.
"""

from __future__ import annotations

import os
import signal
import sys

# Seconds until an interrupt that was lost is raised again.
_AGAIN = 0.01


class StopSignals:
    """The signals among `numbers` that a command answers: those for which the process has no answer of its own."""

    def __init__(self, numbers: tuple[int, ...] = ()) -> None:
        handlers = (signal.SIG_DFL, signal.default_int_handler)
        self._numbers = tuple(number for number in numbers if signal.getsignal(number) in handlers)
        self._received: int = signal.SIGINT

    @classmethod
    def of_this_process(cls) -> StopSignals:
        """Ctrl-C and SIGTERM, each of which ends the process at once: nothing has been begun that could be kept."""
        signals = cls((signal.SIGINT, signal.SIGTERM))
        signals._answer(signals._leave_in_words)
        return signals

    @property
    def status(self) -> int:
        """Exit status of an interrupted command: 130 after Ctrl-C, 143 after SIGTERM."""
        return 128 + self._received

    def interrupt(self) -> None:
        """From now on each raises KeyboardInterrupt, after which a computation keeps what it has."""
        self._answer(self._interrupt)
        if self._numbers:
            sys.unraisablehook = self._raise_again

    def leave_with(self, status: int) -> None:
        """From now on each ends the process at once with this status."""
        self._answer(lambda number, frame: os._exit(status))

    def _answer(self, handler: object) -> None:
        for number in self._numbers:
            signal.signal(number, handler)  # type: ignore[arg-type] # typing takes longer to load than this module

    def _leave_in_words(self, number: int, frame: object) -> None:
        try:
            os.write(2, b"mrwork: interrupted\n")
        finally:
            os._exit(128 + number)

    def _raise_again(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Raise an interrupt again that came where nothing can be raised, as while an object is released."""
        if isinstance(unraisable.exc_value, KeyboardInterrupt) and hasattr(signal, "setitimer"):
            received = self._received
            signal.signal(signal.SIGALRM, lambda number, frame: self._interrupt(received, frame))
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        else:
            sys.__unraisablehook__(unraisable)

    def _interrupt(self, number: int, frame: object) -> None:
        self._received = number
        raise KeyboardInterrupt
