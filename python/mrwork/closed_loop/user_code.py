"""Python of a user within a computation: what it changes in the process is undone, what it raises has file and line."""

from __future__ import annotations

import contextlib
import functools
import inspect
import os
import sys
from collections.abc import Callable
from types import CodeType, TracebackType


class Undone:
    """Restores working directory, stdout and stderr of now after each block in which Python of a user runs."""

    __slots__ = ("_folder", "_streams")

    def __init__(self) -> None:
        self._streams = sys.stdout, sys.stderr
        self._folder = _working_directory()

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        sys.stdout, sys.stderr = self._streams
        if self._folder and _working_directory() != self._folder:
            # Where the folder has been removed, what is read or written there next says so.
            with contextlib.suppress(OSError):
                os.chdir(self._folder)


def place_of(function: Callable[..., object]) -> str:
    """File and line in which a function begins, as "my_law.py, line 3"; empty if it is not written in Python."""
    code = _code_of(function)
    return "" if code is None else f"{code.co_filename}, line {code.co_firstlineno}"


def place_raised(error: BaseException, file: str) -> str:
    """File and line that raised an error: the last ones in `file`; without any, those that were called first.

    Call it in the function that caught the error. Empty if the error comes from no Python.
    """
    if isinstance(error, SyntaxError) and error.filename == file and error.lineno:
        return f"{file}, line {error.lineno}"
    # The first entry is that of the function that caught the error.
    trace = error.__traceback__.tb_next if error.__traceback__ is not None else None
    found = ""
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if name == file or not found:
            found = f"{name}, line {trace.tb_lineno}"
        trace = trace.tb_next
    return found


def file_of(function: Callable[..., object]) -> str:
    """Name of the file of a function; empty if it is not written in Python."""
    code = _code_of(function)
    return "" if code is None else code.co_filename


def in_words(error: BaseException) -> str:
    """Type and text of an error in one line."""
    try:
        text = " ".join(str(error).split())
    except Exception:
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def never_a_value(function: Callable[..., object]) -> str:
    """Why what a function returns can be no value, if it cannot."""
    if inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function):
        return "is declared with async def, so it returns a coroutine and no value; declare it with def"
    if inspect.isgeneratorfunction(function):
        return "has a yield, so it returns a generator and no value; return the value instead"
    return ""


def _code_of(function: Callable[..., object]) -> CodeType | None:
    while isinstance(function, functools.partial):
        function = function.func
    found = inspect.unwrap(function)
    # An object that is called has its code in its class.
    code = getattr(found, "__code__", None) or getattr(type(found).__call__, "__code__", None)
    return code if isinstance(code, CodeType) else None


def _working_directory() -> str:
    """The working directory; empty where it has been removed."""
    try:
        return os.getcwd()  # noqa: PTH109 # at every control sample, and `Path` takes longer
    except OSError:
        return ""
