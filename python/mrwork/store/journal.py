"""Journal of a deterministic run, from which an interrupted run resumes with the same result.

A run asks the journal for the result of each of its expensive steps, in order. A recorded result is returned to the
bit; any other step is computed and recorded. A resumed run asks again from the first step, and so continues where the
record ends. The file has a JSON object in each line, with a checksum that detects damage.
"""

from __future__ import annotations

import errno
import json
import os
import threading
import time
import zlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any, Final, TypeVar

from mrwork.base.arguments import checked
from mrwork.base.numbers import counted
from mrwork.errors import JournalError, MrworkError
from mrwork.store.codec import built, differences, plain
from mrwork.store.input_file import FileKind, bytes_of, is_there
from mrwork.store.output_file import Lock, explain_failure, open_to_write
from mrwork.store.run_folder import refuse_path_in_run

T = TypeVar("T")
_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)

# Largest share of the run time spent waiting for the disk. Lines that were written survive the death of the process;
# only a power cut loses lines that have not reached the disk.
_DISK_SHARE = 0.01
_LINES_SHOWN = 3
_NOT_LOST = "make room and resume, nothing in it is lost"
_ANEW = "run again with --replace, not --resume"


class Journal:
    """Steps of a run in a file, one per line.

    From the first step, of a resumed one from the start, until `close`, which the caller calls, no other journal of the
    file can be written.

    Parameters
    ----------
    path
        The file; its folder must exist.
    resume
        Whether to continue an existing file.
    replace
        Whether the first line that is written may replace a journal that has recorded steps.
    note
        Called with a sentence if the end of the file is damaged and ignored.

    Raises
    ------
    JournalError
        If the file is there and no journal, or has recorded steps and neither `resume` nor `replace` is given. On
        resuming: if there is no such file, or if it is damaged before its end.
        On resuming or at the first step: if another writer holds the file.
    OutputError
        If a line cannot be written, or the file is a link or belongs to a run.
    """

    @checked
    def __init__(
        self,
        path: str | Path,
        *,
        resume: bool = False,
        replace: bool = False,
        note: Callable[[str], None] | None = None,
    ) -> None:
        self._begin(Path(path))
        if resume:
            self._resume(self.path, note)
            return
        refuse_path_in_run(self.path)
        if is_there(self.path, JOURNAL_FILE) and not is_journal(self.path):
            raise JournalError(f"{self.path} is no journal, so it is left as it is; choose another name")
        if not replace and (steps := n_steps(self.path)):
            raise JournalError(
                f"{self.path} has {counted(steps, 'step')} of an earlier run; continue it with resume=True, or "
                "begin anew with replace=True"
            )

    def _begin(self, path: Path, *, locks: bool = True) -> None:
        self.path = path
        self._recorded: list[dict[str, Any]] = []
        self.n_asked = 0
        """Number of steps that have been asked for."""
        self._counters: Any = None
        # After an interrupt, a refinement may still run on its thread; it must not write to a closed journal.
        self._writing = threading.Lock()
        self._closed = False
        self._locks = locks
        # The lock, and the file above it.
        self._held = ExitStack()
        self._file: int | None = None
        self._next_sync, self._began = 0.0, time.perf_counter()
        self.lines = b""
        """The lines that were there when a file was resumed."""

    @property
    def seconds_before(self) -> float:
        """Duration of the recorded steps [s]."""
        return float(self._recorded[-1]["seconds"]) if self._recorded else 0.0

    @property
    def recalling(self) -> bool:
        """Whether the next step is recorded."""
        return self.n_asked < len(self._recorded)

    @checked
    def carry(self, counters: Any) -> None:
        """Record `counters.as_record()` in every following line, and `restore` it with every recorded step."""
        self._counters = counters

    @checked
    def agree(self, subject: str, facts: Mapping[str, object]) -> None:
        """Record the facts of a run, or refuse to resume one with others; `subject`, its kind, names the step."""
        stated = plain(facts)
        recorded = self._next(subject)
        if recorded is None:
            self._append(subject, {"facts": stated})
            return
        if differing := differences(recorded.get("facts"), stated):
            more = f" and {len(differing) - _LINES_SHOWN} more" if len(differing) > _LINES_SHOWN else ""
            raise JournalError(
                f"{self.path} is of another {subject}: {'; '.join(differing[:_LINES_SHOWN])}{more}; "
                f"resume with the same inputs and settings as before, or {_ANEW}"
            )

    @checked
    def recall(self, step: str, inputs: str, read: Callable[[dict[str, Any]], T]) -> T | None:
        """Return the recorded result of the next step, or `None` if the step must be computed.

        `inputs` is the digest of its inputs, and `read` makes the result from its record. Another step, or the same
        step with other inputs, is refused.
        """
        recorded = self._next(step, inputs)
        if recorded is None:
            return None
        if self._counters is not None and "counters" in recorded:
            self._counters.restore(recorded["counters"])
        return read(recorded["result"])

    @checked
    def record(self, step: str, inputs: str, result: Mapping[str, object]) -> None:
        """Record the result of a step for which `recall` has returned `None`."""
        counters = {} if self._counters is None else {"counters": self._counters.as_record()}
        self._append(step, {"inputs": inputs, "result": result, **counters})

    @checked
    def once(self, step: str, inputs: str, kind: type[T], compute: Callable[[], T]) -> T:
        """Return the recorded result of a step, or compute and record it; `kind` is a dataclass, see `built`."""
        recalled: T | None = self.recall(step, inputs, partial(built, kind))
        if recalled is not None:
            return recalled
        result = compute()
        self.record(step, inputs, plain(result))
        return result

    @checked
    def adopt(self, lines: bytes) -> None:
        """Append lines of this run that were made elsewhere; they begin with the lines of this journal."""
        if new := lines[len(self.lines) :]:
            self._write(new)

    def close(self) -> None:
        """Close the file and release it; a later step is refused."""
        with self._writing, explain_failure(f"write the journal {self.path}", _NOT_LOST):
            self._closed, self._file = True, None
            self._held.close()

    def _next(self, step: str, inputs: str = "") -> dict[str, Any] | None:
        """Next recorded line, which must be of this step with these inputs; `None` after the last."""
        if not self.recalling:
            return None
        recorded = self._recorded[self.n_asked]
        self.n_asked += 1
        if (recorded.get("step"), recorded.get("inputs", "")) != (step, inputs):
            raise JournalError(
                f"line {recorded['line']} of {self.path} is a {recorded.get('step')} where this run comes to another "
                f"{step}: its inputs, the program or the machine have changed since; {_ANEW}"
            )
        return recorded

    def _resume(self, path: Path, note: Callable[[str], None] | None) -> None:
        if not is_there(path, JOURNAL_FILE):
            raise JournalError(f"there is no {path.name} to resume in {path.parent}; run without --resume")
        self._take_lock()
        try:
            content = bytes_of(path, JOURNAL_FILE)
            lines = content.splitlines(keepends=True)
            entries = [_entry_of(line) for line in lines]
            # A dead process leaves the last line incomplete, a power cut damages the last few: these do not count.
            self._recorded = sound = [*takewhile(bool, entries)]
            fault = ""
            if any(entries[len(sound) :]):
                fault = f"is damaged in line {len(sound) + 1}, with sound lines after it"
            elif not sound and len(lines) > 1:
                fault = "is not a journal that this version can resume"
            elif sound and sound[0].get("format") != FORMAT:
                fault = f"has format {sound[0].get('format')}, this version reads {FORMAT}"
            if fault:
                raise JournalError(f"{path} {fault}; {_ANEW}")
        except MrworkError:
            self.close()
            raise
        length = sum(map(len, lines[: len(sound)]))
        if length < len(content) and note is not None:
            note(f"the end of {path} is torn; its last {len(content) - length} bytes do not count")
        self.lines = content[:length]
        self._began -= self.seconds_before

    def _take_lock(self) -> None:
        if self._locks:
            self._held.enter_context(Lock(self.path.parent, self.path.name))
            self._locks = False

    def _open(self) -> int:
        """Open the file, which keeps the lines that were resumed."""
        self._take_lock()
        with explain_failure(f"write {self.path}", "choose another folder"):
            self._file = file = open_to_write(self.path, _FLAGS)
        self._held.callback(os.close, file)
        self._held.callback(os.fsync, file)
        size = os.fstat(file).st_size
        os.ftruncate(file, min(size, len(self.lines)))
        os.write(file, self.lines[size:])
        return file

    def _append(self, step: str, entry: Mapping[str, object]) -> None:
        self.n_asked += 1
        first = {"format": FORMAT} if self.n_asked == 1 else {}
        seconds = time.perf_counter() - self._began
        numbered = {"line": self.n_asked, "step": step, **first, **entry, "seconds": seconds}
        text = json.dumps(plain(numbered), allow_nan=False, ensure_ascii=False)[:-1].encode()
        # The last key is the CRC-32 of the text before it.
        self._write(b'%s%s%08x"}\n' % (text, _SUM, zlib.crc32(text)))

    def _write(self, lines: bytes) -> None:
        with self._writing:
            if self._closed:
                raise JournalError(
                    f"{self.path} was closed before the run came to its end; open it again to resume"
                )
            with explain_failure(f"write the journal {self.path}", _NOT_LOST):
                file = self._open() if self._file is None else self._file
                # A single call writes all or nothing, except on a full disk.
                if os.write(file, lines) < len(lines):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                if (began := time.perf_counter()) >= self._next_sync:
                    os.fsync(file)
                    took = time.perf_counter() - began
                    self._next_sync = began + took + took / _DISK_SHARE


def journal_in_run(path: Path, *, committed: Path, resume: bool, note: Callable[[str], None]) -> Journal:
    """The journal that grows at `path` in a run folder, which is locked.

    One that is resumed and not there begins as the `committed` one does, once a step is added.
    """
    journal = Journal.__new__(Journal)
    journal._begin(path, locks=False)
    if resume:
        journal._resume(path if path.is_file() else committed, note)
    return journal


# Increased whenever names or order of the entries change, or the bits of what is computed: older journals are refused.
FORMAT = 6

JOURNAL_FILE: Final = FileKind(
    name="a journal", largest=1 << 30, remedy="move it away, and run again without --resume"
)
_START = b'{"line": '
_SUM = b', "crc32": "'


def is_journal(path: Path) -> bool:
    """Whether a file begins as a journal does; an empty one is one that has not begun."""
    start = bytes_of(path, JOURNAL_FILE, len(_START))
    return start in (_START, b"")


def n_steps(path: Path) -> int:
    """Number of recorded steps in a journal of any format, of which the header is none; 0 where there is no file."""
    if not is_there(path, JOURNAL_FILE):
        return 0
    return sum("result" in _entry_of(line) for line in bytes_of(path, JOURNAL_FILE).splitlines(keepends=True))


def _entry_of(line: bytes) -> dict[str, Any]:
    text, _, end = line.rpartition(_SUM)
    return json.loads(text + b"}") if end == b'%08x"}\n' % zlib.crc32(text) else {}
