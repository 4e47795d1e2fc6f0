"""The text of a law that is a Python function: a file of its own, with what the function uses.

It tells laws of a study apart in journals, and is the file that `Study.to_toml` writes. A module of its own because it
takes Python apart, which nothing else of a study does.
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
from types import CodeType, ModuleType
from typing import Any

import numpy as np

from mrwork.errors import SettingError

_REMEDY = (
    "write it into a Python file, and give that file, as user={'file': 'my_law.py', 'function': 'my_law'}"
)


def law_text(function: Callable[..., Any]) -> str:
    """A Python file with a function, and the modules, numbers, arrays and functions that it uses.

    Raises
    ------
    SettingError
        If it has no text of its own, as a lambda, or uses anything else.
    """
    parts: dict[str, str] = {}
    _add_function(function, parts)
    # Imports first; annotations are not evaluated.
    texts = sorted(parts.values(), key=lambda text: not text.startswith(("import ", "from ")))
    return "\n\n".join(["from __future__ import annotations", *texts]) + "\n"


def text_to_compare(function: Callable[..., Any]) -> str:
    """What tells a law from others: its text, or where it has none a text that no other law has."""
    try:
        return law_text(function)
    except SettingError:
        return uuid.uuid4().hex


def _add_function(function: Any, parts: dict[str, str]) -> None:
    name = getattr(function, "__name__", type(function).__name__)
    try:
        text = textwrap.dedent(inspect.getsource(function)) if inspect.isfunction(function) else ""
        closed = inspect.getclosurevars(function).nonlocals if text else {}
    except (OSError, TypeError, ValueError):
        text = ""
    if not text.startswith("def "):
        raise SettingError(f"the law {name} has no text of its own that begins with def; {_REMEDY}")
    known = {**vars(builtins), **function.__globals__, **closed}
    # Kept before what it uses, so that functions which call each other end.
    parts[name] = ""
    for used in (*_names_in_defaults(text), *_names(function.__code__)):
        if used in known and used not in parts and known[used] is not vars(builtins).get(used):
            _add_value(name, used, known[used], parts)
    parts.pop(name)
    parts[name] = text.rstrip()


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


def _add_value(law: str, name: str, value: Any, parts: dict[str, str]) -> None:
    if isinstance(value, ModuleType):
        parts[name] = f"import {value.__name__} as {name}"
    elif callable(value) and (home := _installed(value, name)):
        parts[name] = f"from {home} import {name}"
    elif inspect.isfunction(value) and value.__name__ == name:
        _add_function(value, parts)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and np.isfinite(value).all():
        parts["numpy"] = "import numpy"
        parts[name] = f"{name} = numpy.array({value.tolist()!r}, dtype={value.dtype.str!r})"
    elif _is_plain(value):
        parts[name] = f"{name} = {value!r}"
    else:
        raise SettingError(
            f"the law {law} uses {name}, of the type {type(value).__name__}, which no text states; {_REMEDY}"
        )


def _installed(value: Any, name: str) -> str:
    """The module of Python or of an installed package that has a function or class; empty where none has."""
    module = sys.modules.get(getattr(value, "__module__", None) or "")
    if module is None or module.__name__ == "__main__" or getattr(module, name, None) is not value:
        return ""
    places = (sysconfig.get_path(each) for each in ("stdlib", "purelib", "platlib"))
    file = getattr(module, "__file__", None)
    return module.__name__ if file is None or file.startswith((*places,)) else ""


def _is_plain(value: object) -> bool:
    """Whether `repr` is the value as Python is typed."""
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return type(value) in (bool, int, str, type(None)) or (type(value) is float and abs(value) < np.inf)
