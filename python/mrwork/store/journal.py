"""A write-ahead memo of a deterministic run: a step that is recorded is recalled, any other is done and recorded.

A run asks the journal for each of its costly steps, in their order. Resuming asks again from the first: recorded
steps come back at once, to the bit, and the run goes on where the record ends. So the result is that of a run that
was never interrupted.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol, TypeVar

from mrwork.errors import JournalError, OutputError
from mrwork.store.codec import plain, rebuilt
from mrwork.store.fingerprint import differences
from mrwork.store.journal_file import FORMAT, line_of, locked, read_lines

T = TypeVar("T")

# The disk is waited for so that it takes at most this share of the run: a process that is killed loses nothing
# that was written, only a power cut does.
_DISK_SHARE = 0.01
_SHOWN = 3


class Counters(Protocol):
    """What a run counts as it goes, which every line carries."""

    def as_record(self) -> Mapping[str, object]:
        """The counts."""

    def restore(self, record: Mapping[str, Any]) -> None:
        """Count as a record says."""


class Journal:
    """Steps of a run in a file, one line each.

    Parameters
    ----------
    path
        The file; its folder must exist. It is made when the first line is written, in place of what was there.
    resume
        Keep what is there and go on from it.
    note
        Told in a sentence if the end of the file is damaged and does not count.

    Raises
    ------
    JournalError
        On resuming, if there is no such file, it is no journal or damaged before its end. If another process is
        writing it: on resuming, or at the first step.
    OutputError
        If a line cannot be written.
    """

    def __init__(
        self, path: str | Path, *, resume: bool = False, note: Callable[[str], None] | None = None
    ) -> None:
        self.path = Path(path)
        self._recorded: list[dict[str, Any]] = []
        self._asked = 0
        self._counters: Counters | None = None
        # A refinement that an interrupt left behind on its thread must not write into a journal that was closed.
        self._writing = threading.Lock()
        self._closed = False
        self._file: int | None = None
        self._own = False
        self._synced, self._pause = 0.0, 0.0
        if resume:
            self._recorded = self._opened(note)
        self._began = time.perf_counter() - self.seconds_before

    @property
    def seconds_before(self) -> float:
        """Time that the recorded steps took [s]."""
        return float(self._recorded[-1]["seconds"]) if self._recorded else 0.0

    @property
    def is_own(self) -> bool:
        """Whether the file has been opened here, so that nobody else is writing it."""
        return self._own

    @property
    def recalling(self) -> bool:
        """Whether the next step is recorded."""
        return self._asked < len(self._recorded)

    def carry(self, counters: Counters) -> None:
        """Write these counts into every line from here on, and restore them with every step that is recalled."""
        self._counters = counters

    def agree(self, subject: str, facts: Mapping[str, object]) -> None:
        """Write down what a run rests on, or check that a resumed run rests on the same.

        Raises
        ------
        JournalError
            Where it does not; the message names what differs.
        """
        stated = plain(facts)
        recorded = self._next(subject)
        if recorded is None:
            self._append(subject, {"facts": stated})
            return
        found = differences(recorded.get("facts"), stated)
        if found:
            more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
            raise JournalError(
                f"{self.path} is of another {subject}: {'; '.join(found[:_SHOWN])}{more}; "
                "resume with what it was begun with, or run again without --resume"
            )

    def recall(self, step: str, inputs: str) -> dict[str, Any] | None:
        """Result of the next step if it is recorded, `None` if it is to be done; `inputs` is a digest.

        Raises
        ------
        JournalError
            Where something else is recorded.
        """
        recorded = self._next(step)
        if recorded is None:
            return None
        if recorded.get("inputs") != inputs:
            raise self._astray(recorded, step)
        if self._counters is not None and "counters" in recorded:
            self._counters.restore(recorded["counters"])
        result: dict[str, Any] = recorded["result"]
        return result

    def record(self, step: str, inputs: str, result: Mapping[str, object]) -> None:
        """Record the result of a step that `recall` did not know."""
        entry: dict[str, object] = {"inputs": inputs, "result": result}
        if self._counters is not None:
            entry["counters"] = self._counters.as_record()
        self._append(step, entry)

    def once(self, step: str, inputs: str, kind: type[T], compute: Callable[[], T]) -> T:
        """What `compute` returns, recalled or recorded: a dataclass `kind` of numbers, flags and arrays of them."""
        recalled = self.recall(step, inputs)
        if recalled is not None:
            return rebuilt(kind, recalled)
        result = compute()
        self.record(step, inputs, plain(result))
        return result

    def close(self) -> None:
        """Write no more; whoever tries is told so."""
        with self._writing:
            self._closed = True
            if self._file is not None:
                os.fsync(self._file)
                os.close(self._file)
                self._file = None

    def _next(self, step: str) -> dict[str, Any] | None:
        """The next recorded line, which must be of this step; `None` past the last."""
        if not self.recalling:
            return None
        recorded = self._recorded[self._asked]
        self._asked += 1
        if recorded.get("step") != step:
            raise self._astray(recorded, step)
        return recorded

    def _astray(self, recorded: Mapping[str, Any], step: str) -> JournalError:
        return JournalError(
            f"line {recorded['line']} of {self.path} is a {recorded.get('step')} where this run comes to another "
            f"{step}: the program or the machine has changed since; run again without --resume"
        )

    def _opened(self, note: Callable[[str], None] | None) -> list[dict[str, Any]]:
        if not self.path.is_file():
            raise JournalError(f"there is no journal at {self.path} to resume; run without --resume")
        self._open()
        content = self.path.read_bytes()
        try:
            recorded, length = read_lines(content, self.path)
        except JournalError:
            self.close()
            raise
        if length < len(content):
            if note is not None:
                note(f"the end of {self.path} is torn; its last {len(content) - length} bytes do not count")
            os.truncate(self.path, length)
        return recorded

    def _open(self) -> int:
        self._file = locked(self.path)
        self._own = True
        return self._file

    def _append(self, step: str, entry: Mapping[str, object]) -> None:
        with self._writing:
            if self._closed:
                raise JournalError(
                    f"{self.path} was closed before the run came to its end; open it again to resume"
                )
            self._asked += 1
            first = {"format": FORMAT} if self._asked == 1 else {}
            numbered = {"line": self._asked, "step": step, **first, **entry}
            line = line_of(numbered | {"seconds": time.perf_counter() - self._began})
            try:
                file = self._file
                if file is None:
                    file = self._open()
                    os.ftruncate(file, 0)
                # One call for the whole line, so that it is there or not, but on a full disk.
                if os.write(file, line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                self._sync(file)
            except OSError as reason:
                raise OutputError(
                    f"cannot write the journal {self.path}: {reason.strerror}; what is in it can be resumed"
                ) from reason

    def _sync(self, file: int) -> None:
        began = time.perf_counter()
        if began - self._synced >= self._pause:
            os.fsync(file)
            self._synced = time.perf_counter()
            self._pause = (self._synced - began) / _DISK_SHARE
