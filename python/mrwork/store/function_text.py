"""The text of functions of a user: a Python file of its own, with what the functions use.

It tells laws and dampers in Python apart, is the file that `Study.to_toml` writes, and is what a damper of a user
carries. What the functions use is stated by its value of now: a file or a cell that is run once more may do more than
define them.
"""

from __future__ import annotations

import ast
import inspect
import symtable
import sys
import textwrap
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from mrwork.errors import SettingError

# Annotations are not evaluated, and name nothing that is used.
_HEAD = "from __future__ import annotations\n"


class _NoTextError(Exception):
    """No text states a function."""


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
