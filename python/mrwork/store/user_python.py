"""Python of a user: run from a file or from a stored text, with file and line of what goes wrong.

What it changes in the process is undone. Only this module runs a text as code (`tests/test_trust.py`).
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType, ModuleType, TracebackType

from mrwork.errors import MrworkError, SettingError
from mrwork.store.codec import digest_of
from mrwork.store.input_file import FileKind, text_of


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
    code = code_of(function)
    return "" if code is None else f"{code.co_filename}, line {code.co_firstlineno}"


def place_raised(error: BaseException, file: str) -> str:
    """File and line that raised an error: the last ones in `file`; without any, those that were called first.

    Call it in the function that caught the error. Empty if the error comes from no Python.
    """
    if isinstance(error, SyntaxError) and error.filename == file and error.lineno:
        return f"{file}, line {error.lineno}"
    # The first entry is that of the function that caught the error.
    trace = error.__traceback__.tb_next if error.__traceback__ is not None else None
    place = ""
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if name == file or not place:
            place = f"{name}, line {trace.tb_lineno}"
        trace = trace.tb_next
    return place


def in_words(error: BaseException) -> str:
    """Type and text of an error in one line."""
    try:
        text = " ".join(str(error).split())
    except Exception:
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def code_of(function: Callable[..., object]) -> CodeType | None:
    """The code of a function; `None` if it is not written in Python."""
    while isinstance(function, functools.partial):
        function = function.func
    unwrapped = inspect.unwrap(function)
    # An object that is called has its code in its class.
    code = getattr(unwrapped, "__code__", None) or getattr(type(unwrapped).__call__, "__code__", None)
    return code if isinstance(code, CodeType) else None


def _working_directory() -> str:
    """The working directory; empty where it has been removed."""
    try:
        return os.getcwd()  # noqa: PTH109 # at every control sample, and `Path` takes longer
    except OSError:
        return ""


def run_file(path: Path, *, what: str) -> tuple[ModuleType, str]:
    """Run the Python file at `path`, which is that of `what`; return its module and its text."""
    file = f"the Python file of {what}"
    text = text_of(path, FileKind(name=file, largest=1 << 20, remedy=f"give {file}"))
    return run_text(text, str(path)), text


def run_text(text: str, name: str) -> ModuleType:
    """Run a text as Python; `name` stands for its file in messages.

    Raises
    ------
    SettingError
        Where it ends in an error, with its line.
    """
    module = ModuleType(f"mrwork_user_{digest_of(text)}")
    module.__file__ = name
    # Dataclasses look for the module of their class.
    sys.modules[module.__name__] = module
    try:
        with Undone():
            exec(compile(text, name, "exec"), vars(module))
    except KeyboardInterrupt:
        raise
    except MrworkError as error:
        raise SettingError(f"{place_raised(error, name) or name}: {error}") from None
    except BaseException as error:
        raised = place_raised(error, name) or name
        raise SettingError(f"{raised} failed when the file was run: {in_words(error)}; correct it") from None
    return module
