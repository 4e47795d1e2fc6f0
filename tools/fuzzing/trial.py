"""One process with limits in which mutants are read, and what it tells of each."""

from __future__ import annotations

import faulthandler
import gc
import importlib
import json
import logging
import os
import resource
import signal
import sys
import tempfile
import traceback
import unicodedata
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import RawArray
from pathlib import Path
from typing import Any, Final, get_args

from mrwork.errors import MistakesError, MrworkError, MrworkWarning
from mrwork.store import child_program, child_reader
from mrwork.store.input_file import compute_allowance
from tools.fuzzing.reader import Reader

SECONDS: Final = 10.0
"""Processor time after which a reader hangs."""
BYTES: Final = 1 << 30
"""Memory beyond that of the interpreter."""
LONGEST: Final = 2000
"""Characters of a message."""
# Address space that a process may have beyond that; not all of it becomes memory.
_UNUSED: Final = 256 << 20
_MESSAGES: Final = 4000


class Tally:
    """What is known of the mutants that a process has read, in memory that it shares with the harness."""

    _NAMES = ("number", "results", "refusals", "failures", "longest", "slowest", "peak")

    def __init__(self) -> None:
        self._shared = RawArray("d", len(self._NAMES))

    def __getattr__(self, name: str) -> float:
        return float(self._shared[self._NAMES.index(name)])

    def begin(self, number: int) -> None:
        """Count nothing yet; the mutant of that number is the first."""
        self._shared[:] = [float(number), *(0.0,) * (len(self._NAMES) - 1)]

    def at(self, number: int) -> None:
        """The mutant of that number is read now."""
        self._shared[0] = number

    def count(self, outcome: str, taken: float, used: int) -> None:
        """Count a mutant that took so many seconds and bytes."""
        self._shared[self._NAMES.index(outcome)] += 1.0
        if taken > self._shared[4]:
            self._shared[4], self._shared[5] = taken, self._shared[0]
        self._shared[6] = max(self._shared[6], used)


def try_all(
    reader: Reader, numbers: range, folder: Path, tally: Tally, tell: Callable[[dict[str, Any]], None]
) -> None:
    """Read the mutants of those numbers, each from `folder`; failures are told one by one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    faulthandler.disable()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("always")
    gc.collect()
    if reader.in_child is False:
        _limit_memory(child_reader.memory_of_child(max(len(seed.content) for seed in reader.seeds)))
        _read_here()
    else:
        _limit_memory(BYTES + _UNUSED)
    base = _peak()
    os.chdir(folder)
    for file, content in reader.beside.items():
        _write(folder / file, content)
    with _reports() as reports:
        for number in numbers:
            tally.at(number)
            seed, content = reader.mutant(number)
            path = folder / seed.file
            _write(path, content)
            reports.clear()
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            began = _seconds()
            outcome, why = _outcome(reader, path)
            taken = _seconds() - began
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            used = _peak() - base
            if outcome != "failures" and reports:
                outcome, why = "failures", reports[0]
            if outcome != "failures" and used > BYTES:
                outcome, why = "failures", f"took {used / 1e6:.0f} MB"
            tally.count(outcome, taken, used)
            if outcome == "failures":
                tell({"number": number, "why": why})
            if seed.file in reader.beside:
                path.write_bytes(reader.beside[seed.file])
            else:
                path.unlink(missing_ok=True)
            if used > BYTES:
                # The peak of a process does not fall again.
                return


def _read_here() -> None:
    """Let the program of a child process read in this process, which is limited as well."""
    answers = {form: getattr(child_program, form) for form in get_args(child_reader.Format)}

    def read_members(data: bytes, form: child_reader.Format) -> dict[str, child_reader.Member]:
        with tempfile.TemporaryFile(dir=Path.cwd()) as stream:
            try:
                answers[form](data, stream)
            except Exception as error:
                raise child_reader.UnreadableError(str(error).partition("\n")[0]) from None
            stream.seek(0)
            try:
                return child_reader.receive_members(stream, compute_allowance(len(data)))
            except EOFError:
                raise child_reader.UnreadableError("incomplete") from None

    for module in (
        "mrwork.files.matlab",
        "mrwork.files.open_table",
        "mrwork.files.named_columns",
        "mrwork.uncertainty.posterior.draws",
    ):
        vars(importlib.import_module(module))["read_members"] = read_members


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def _outcome(reader: Reader, path: Path) -> tuple[str, str]:
    try:
        result = reader.read(path)
        # What a program does with a result at least.
        repr(result)
    except MrworkError as error:
        try:
            text = str(error)
            # Several mistakes have a line each.
            lines = text.split("\n  ") if isinstance(error, MistakesError) else [text]
            fault = next(filter(None, map(_fault_of, lines)), "")
        except Exception as other:  # a text that cannot be shown
            return "failures", _where(other)
        return (
            ("failures", f"{type(error).__name__} {fault}: {text[:_MESSAGES]!r}")
            if fault
            else ("refusals", "")
        )
    except BaseException as error:  # panics of Rust are no `Exception`
        return "failures", _where(error)
    return "results", ""


def _fault_of(text: str) -> str:
    """What is wrong with a message, if anything."""
    if not text.strip():
        return "is empty"
    if len(text) > LONGEST:
        return f"has {len(text)} characters"
    # Where there is no glyph for it, or half of it, or where it is a command.
    hidden = any(unicodedata.category(each) in ("Cc", "Cf", "Co", "Cs", "Zl", "Zp") for each in text)
    return "is not one printable line" if hidden else ""


def _where(error: BaseException) -> str:
    """An error, and the lines that lead to it."""
    try:
        lines = traceback.format_exception(error, limit=-12)
    except Exception as other:  # an error that cannot even be shown
        lines = [repr(other)]
    return "".join(lines)[-_MESSAGES:]


@contextmanager
def _reports() -> Iterator[list[str]]:
    """Warnings and messages that are no `MrworkWarning` of one printable line."""
    found: list[str] = []

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
        text = str(message)
        if not issubclass(category, MrworkWarning):
            found.append(f"{category.__name__} at {filename}:{lineno}: {text[:_MESSAGES]}")
        elif fault := _fault_of(text):
            found.append(f"{category.__name__} {fault}: {text[:_MESSAGES]!r}")

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            found.append(f"logged by {record.name}: {record.getMessage()[:_MESSAGES]}")

    kept = Kept(logging.WARNING)
    logging.getLogger().addHandler(kept)
    shown, warnings.showwarning = warnings.showwarning, show  # type: ignore[assignment] # fewer arguments are used
    try:
        yield found
    finally:
        warnings.showwarning = shown
        logging.getLogger().removeHandler(kept)


def _limit_memory(more: int) -> None:
    """Let this process reserve no more than that beyond what it has."""
    if sys.platform == "linux":
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + more, used + more))


def _peak() -> int:
    """Largest memory of this process and of any of its children [bytes]."""
    of = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * max(resource.getrusage(each).ru_maxrss for each in of)


def _seconds() -> float:
    """Processor time of this process and of its children."""
    found = (resource.getrusage(each) for each in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in found)


def start(reader: Reader, numbers: range, folder: Path, tally: Tally) -> tuple[int, int]:
    """Fork a process for the mutants of those numbers; its id, and the end of a pipe with a line for each failure."""
    tally.begin(numbers.start)
    ours, theirs = os.pipe()
    process = os.fork()
    if process:
        os.close(theirs)
        return process, ours
    status = 1
    try:
        os.close(ours)
        os.setsid()
        nothing = os.open(os.devnull, os.O_RDWR)
        for each in (0, 1, 2):
            os.dup2(nothing, each)

        def tell(failure: dict[str, Any]) -> None:
            line = json.dumps(failure).encode() + b"\n"
            while line:
                line = line[os.write(theirs, line) :]

        try_all(reader, numbers, folder, tally, tell)
        status = 0
    except BaseException as error:
        os.write(theirs, json.dumps({"number": -1, "why": "the harness: " + _where(error)}).encode() + b"\n")
    finally:
        os._exit(status)
    raise AssertionError
