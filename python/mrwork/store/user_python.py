"""Python of a user: run from a file or from a stored text, with file and line of what goes wrong.

Only this module runs a text as code (`tests/test_trust.py`).
"""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from traceback import walk_tb
from types import CodeType, ModuleType

from mrwork.errors import MrworkError, SettingError, reason_of
from mrwork.store.codec import digest_of
from mrwork.store.input_file import FileKind, text_of


def place_of(function: Callable[..., object]) -> str:
    """File and line in which a function begins, as "my_law.py, line 3"; empty if it is not written in Python."""
    while isinstance(function, functools.partial):
        function = function.func
    unwrapped = inspect.unwrap(function)
    # An object that is called has its code in its class.
    code = getattr(unwrapped, "__code__", None) or getattr(type(unwrapped).__call__, "__code__", None)
    return f"{code.co_filename}, line {code.co_firstlineno}" if isinstance(code, CodeType) else ""


def file_of(function: Callable[..., object]) -> str:
    """File of a function; empty if it is not written in Python."""
    return place_of(function).rpartition(", line ")[0]


def place_raised(error: BaseException, file: str) -> str:
    """File and line that raised an error: the last ones in `file`, or else the first call; empty without Python.

    The function that caught the error calls this one.
    """
    if isinstance(error, SyntaxError) and error.filename == file and error.lineno:
        return f"{file}, line {error.lineno}"
    # The first entry is the function that caught the error.
    called = [(frame.f_code.co_filename, line) for frame, line in walk_tb(error.__traceback__)][1:]
    raised = [call for call in called if call[0] == file] or called[:1]
    return f"{raised[-1][0]}, line {raised[-1][1]}" if raised else ""


def in_words(error: BaseException) -> str:
    """Type and text of an error in one line."""
    return f"{type(error).__name__}: {reason_of(error)}"


def run_file(path: Path, *, what: str) -> tuple[ModuleType, str]:
    """Run the Python file of `what` at `path`; return its module and its text."""
    file = f"the Python file of {what}"
    text = text_of(path, FileKind(name=file, largest=1 << 20, remedy=f"give {file}"))
    return run_text(text, str(path)), text


def run_text(text: str, name: str) -> ModuleType:
    """Run a text as Python in the working directory, which it leaves as it is; `name`: its file in messages."""
    module = ModuleType(f"mrwork_user_{digest_of(text)}")
    module.__file__ = name
    # Dataclasses look for the module of their class.
    sys.modules[module.__name__] = module
    try:
        with chdir("."):
            exec(compile(text, name, "exec"), vars(module))
    except KeyboardInterrupt:
        raise
    except MrworkError as error:
        raise SettingError(f"{place_raised(error, name) or name}: {error}") from None
    except BaseException as error:
        raised = place_raised(error, name) or name
        raise SettingError(f"{raised} failed when the file was run: {in_words(error)}; correct it") from None
    return module
