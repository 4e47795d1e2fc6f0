"""Python of a user: run from a file or a stored text, with file and line of what goes wrong; functions as a text.

Only this module runs a text as code (`tests/test_trust.py`).

The text of functions, with what they use, tells laws and dampers in Python apart, is the file that `Study.to_toml`
writes, and is what a damper of a user carries. What the functions use is stated by its value of now: a file or a cell
that is run once more may do more than define them.
"""

from __future__ import annotations

import ast
import functools
import inspect
import symtable
import sys
import textwrap
import uuid
from collections.abc import Callable, Iterator
from contextlib import chdir
from pathlib import Path
from traceback import walk_tb
from types import CodeType, ModuleType
from typing import Any

import numpy as np

from mrwork.errors import MrworkError, SettingError, reason_of
from mrwork.store.codec import digest_of
from mrwork.store.input_file import FileKind, text_of


def start_of(function: Callable[..., object]) -> tuple[str, int]:
    """File and line in which a function begins; empty and 0 if it is not written in Python."""
    while isinstance(function, functools.partial):
        function = function.func
    unwrapped = inspect.unwrap(function)
    # An object that is called has its code in its class.
    code = getattr(unwrapped, "__code__", None) or getattr(type(unwrapped).__call__, "__code__", None)
    return (code.co_filename, code.co_firstlineno) if isinstance(code, CodeType) else ("", 0)


def place_of(function: Callable[..., object]) -> str:
    """File and line in which a function begins, as "my_law.py, line 3"; empty if it is not written in Python."""
    return "{}, line {}".format(*start) if (start := start_of(function))[0] else ""


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


def error_in_words(error: BaseException) -> str:
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
        raise SettingError(
            f"{raised} failed when the file was run: {error_in_words(error)}; correct it"
        ) from None
    return module


# Annotations are not evaluated, and name nothing that is used.
_HEAD = "from __future__ import annotations\n"


class _NoTextError(Exception):
    pass


def function_text(*functions: Callable[..., Any], what: str, remedy: str) -> str:
    """A Python file with functions, and the modules, numbers, arrays and functions that they use.

    A function without a text of its own, as a lambda, or that uses anything else, is refused: `what` it is, `remedy`.
    """
    entries: dict[str, tuple[Any, str]] = {}
    try:
        for function in functions:
            _add_function(function, entries)
    except _NoTextError as error:
        raise SettingError(f"{what} {error}; {remedy}") from None
    texts = sorted(
        (text for _, text in entries.values()), key=lambda text: not text.startswith(("import ", "from "))
    )
    return "\n\n".join([_HEAD.rstrip(), *texts]) + "\n"


def text_to_compare(function: Callable[..., Any]) -> str:
    """What tells a function from others: its text, or where it has none a text that no other one has."""
    try:
        return function_text(function, what="", remedy="")
    except SettingError:
        return uuid.uuid4().hex


def _add_function(function: Any, entries: dict[str, tuple[Any, str]]) -> None:
    name = getattr(function, "__name__", type(function).__name__)
    try:
        text = textwrap.dedent(inspect.getsource(function)) if inspect.isfunction(function) else ""
        outside = function.__globals__ | inspect.getclosurevars(function).nonlocals if text else {}
        names = {*_names(symtable.symtable(_HEAD + text, name, "exec"))}
    except (OSError, SyntaxError, TypeError, ValueError):  # a text is not to be found, or cannot stand alone
        text = ""
    if not text.startswith("def "):
        raise _NoTextError(
            f"{name} has no text of its own that begins with def (a lambda, under a decorator, or typed at a prompt)"
        )
    # Kept before what it uses, so that functions which call each other end.
    entries[name] = function, ""
    for used in sorted(outside.keys() & names):
        if used not in entries:
            _add_value(name, used, outside[used], entries)
        elif entries[used][0] is not outside[used]:
            raise _NoTextError(f"{name} uses a {used} that is another one elsewhere")
    entries.pop(name)
    entries[name] = function, text.rstrip()


def _names(table: symtable.SymbolTable) -> Iterator[str]:
    """Names of variables outside of the text that its functions and their defaults use."""
    yield from (
        symbol.get_name() for symbol in table.get_symbols() if symbol.is_global() and symbol.is_referenced()
    )
    for inner in table.get_children():
        yield from _names(inner)


def _add_value(function: str, name: str, value: Any, entries: dict[str, tuple[Any, str]]) -> None:
    if isinstance(value, ModuleType):
        if not _is_installed(value):
            raise _NoTextError(f"{function} uses {name}, a module that is not installed")
        text = f"import {value.__name__} as {name}"
    elif callable(value) and (home := _installed(value, name)):
        text = f"from {home} import {name}"
    elif inspect.isfunction(value) and value.__name__ == name:
        _add_function(value, entries)
        return
    elif hasattr(value, "__array__") and np.asarray(value).dtype.kind in "biuf" and np.isfinite(value).all():
        array = np.asarray(value)
        entries["numpy"] = np, "import numpy"
        text = f"{name} = numpy.array({array.tolist()!r}, dtype={array.dtype.str!r})"
    else:
        try:
            ast.literal_eval(repr(value))
        except (SyntaxError, ValueError):
            raise _NoTextError(
                f"{function} uses {name}, of the type {type(value).__name__}, which no text states"
            ) from None
        text = f"{name} = {value!r}"
    entries[name] = value, text


def _installed(value: Any, name: str) -> str:
    """The module of Python or of an installed package that has a function or class; empty where none has."""
    module = sys.modules.get(getattr(value, "__module__", None) or "")
    is_home = module is not None and getattr(module, name, None) is value and _is_installed(module)
    return module.__name__ if module is not None and is_home else ""


def _is_installed(module: ModuleType) -> bool:
    """Whether another process finds a module: one of Python, of this package or of an installed one."""
    file, package = getattr(module, "__file__", None), module.__name__.partition(".")[0]
    if package == "__main__" or file is None or package in ("mrwork", *sys.stdlib_module_names):
        return package != "__main__"
    # Packages of the system and of the user count, beside packages of an environment.
    return bool({"site-packages", "dist-packages"} & {*Path(file).parts})
