"""The text of functions of a user: a Python file of its own, with what the functions use.

It tells laws and dampers in Python apart, is the file that `Study.to_toml` writes, and is what a damper of a user
carries. A module of its own because it takes Python apart, which nothing else does.
"""

from __future__ import annotations

import ast
import builtins
import dis
import inspect
import sys
import sysconfig
import textwrap
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np

from mrwork.errors import SettingError


class _NoTextError(Exception):
    """No text states a function."""


def function_text(*functions: Callable[..., Any], what: str, remedy: str) -> str:
    """A Python file with functions, and the modules, numbers, arrays and functions that they use.

    Raises
    ------
    SettingError
        If one of them has no text of its own, as a lambda, or uses anything else; `what` they are, with the `remedy`.
    """
    known: dict[str, tuple[Any, str]] = {}
    try:
        for function in functions:
            _add_function(function, known)
    except _NoTextError as error:
        raise SettingError(f"{what} {error}; {remedy}") from None
    # Imports first; annotations are not evaluated.
    texts = sorted(
        (text for _, text in known.values()), key=lambda text: not text.startswith(("import ", "from "))
    )
    return "\n\n".join(["from __future__ import annotations", *texts]) + "\n"


def text_to_compare(function: Callable[..., Any]) -> str:
    """What tells a function from others: its text, or where it has none a text that no other one has."""
    try:
        return function_text(function, what="", remedy="")
    except SettingError:
        return uuid.uuid4().hex


def _add_function(function: Any, known: dict[str, tuple[Any, str]]) -> None:
    name = getattr(function, "__name__", type(function).__name__)
    try:
        text = textwrap.dedent(inspect.getsource(function)) if inspect.isfunction(function) else ""
        closed = inspect.getclosurevars(function).nonlocals if text else {}
    except (OSError, TypeError, ValueError):
        text = ""
    if not text.startswith("def "):
        raise _NoTextError(
            f"{name} has no text of its own that begins with def (a lambda, under a decorator, or typed at a prompt)"
        )
    outside = {**vars(builtins), **function.__globals__, **closed}
    # Kept before what it uses, so that functions which call each other end.
    known[name] = function, ""
    for used in (*_names_in_defaults(text), *_names(function.__code__)):
        if used not in outside or outside[used] is vars(builtins).get(used):
            continue
        if used not in known:
            _add_value(name, used, outside[used], known)
        elif known[used][0] is not outside[used]:
            raise _NoTextError(f"{name} uses a {used} that is another one elsewhere")
    known.pop(name)
    known[name] = function, text.rstrip()


def _names_in_defaults(text: str) -> Iterator[str]:
    """Names in the defaults of the arguments of a function."""
    (function,) = ast.parse(text).body
    assert isinstance(function, ast.FunctionDef)
    for default in filter(None, (*function.args.defaults, *function.args.kw_defaults)):
        yield from (each.id for each in ast.walk(default) if isinstance(each, ast.Name))


def _names(code: CodeType) -> Iterator[str]:
    """Names of variables outside of a function that it, or a function in it, uses."""
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_DEREF"):
            yield str(step.argval)
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)


def _add_value(function: str, name: str, value: Any, known: dict[str, tuple[Any, str]]) -> None:
    if isinstance(value, ModuleType):
        if not _is_installed(value):
            raise _NoTextError(f"{function} uses {name}, a module that is not installed")
        text = f"import {value.__name__} as {name}"
    elif callable(value) and (home := _installed(value, name)):
        text = f"from {home} import {name}"
    elif inspect.isfunction(value) and value.__name__ == name:
        _add_function(value, known)
        return
    elif hasattr(value, "__array__") and np.asarray(value).dtype.kind in "biuf" and np.isfinite(value).all():
        array = np.asarray(value)
        known["numpy"] = np, "import numpy"
        text = f"{name} = numpy.array({array.tolist()!r}, dtype={array.dtype.str!r})"
    elif _is_plain(value):
        text = f"{name} = {value!r}"
    else:
        raise _NoTextError(
            f"{function} uses {name}, of the type {type(value).__name__}, which no text states"
        )
    known[name] = value, text


def _installed(value: Any, name: str) -> str:
    """The module of Python or of an installed package that has a function or class; empty where none has."""
    module = sys.modules.get(getattr(value, "__module__", None) or "")
    found = module is not None and getattr(module, name, None) is value and _is_installed(module)
    return module.__name__ if module is not None and found else ""


def _is_installed(module: ModuleType) -> bool:
    """Whether another process finds a module: one of Python, of this package or of an installed one."""
    file, package = getattr(module, "__file__", None), module.__name__.partition(".")[0]
    if package == "__main__" or file is None or package == "mrwork":
        return package != "__main__"
    # Packages may be those of the system or of the user, beside those of an environment.
    return bool({"site-packages", "dist-packages"} & {*Path(file).parts}) or str(file).startswith(
        sysconfig.get_path("stdlib")
    )


def _is_plain(value: object) -> bool:
    """Whether `repr` is the value as Python is typed."""
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return type(value) in (bool, int, str, type(None)) or (type(value) is float and abs(value) < np.inf)
