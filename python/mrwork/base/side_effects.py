"""What a function does beside its result, found in its text: a recording would do it once.

Statements that only call something, and changes of what is not the function's own, are found in the function and in the
functions of its user that it calls.
"""

from __future__ import annotations

import ast
import dis
import inspect
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

# What no statement changes.
_FIXED = (int, float, complex, str, bytes, tuple, frozenset, type(None), ModuleType)
_OUTSIDE = ("STORE_GLOBAL", "DELETE_GLOBAL")
_CHANGES = ("STORE_SUBSCR", "STORE_ATTR", "STORE_SLICE", "DELETE_SUBSCR", "DELETE_ATTR")
_FRESH = (ast.List, ast.Dict, ast.ListComp, ast.DictComp, ast.Tuple)


def effect_of(function: Callable[..., Any], *, remedy: str = "keep it in the memory") -> str | None:
    """The first effect of a function beside its result, as a sentence with file and line; `None` without one.

    `remedy` says what is done in place of a change of what is outside.
    """
    return next((effect for each in _functions_of(function) for effect in _effects(each, remedy)), None)


def with_numpy(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with NumPy in place of jax.numpy, in it and in the functions of its user that it calls."""
    if not any(_uses_jax(each) for each in _functions_of(function)):
        return function
    copy: Callable[..., Any] = _copied(function, {})
    return copy


def _uses_jax(function: FunctionType) -> bool:
    return any(_is_jax(value) for value in _names_of(function).values())


def _is_jax(value: Any) -> bool:
    return isinstance(value, ModuleType) and value.__name__ == "jax.numpy"


def _copied(function: Any, made: dict[int, Any]) -> Any:
    if isinstance(function, MethodType):
        return MethodType(_copied(function.__func__, made), function.__self__)
    if not isinstance(function, FunctionType):
        return function
    if id(function) not in made:
        names = dict(function.__globals__)
        copy = FunctionType(
            function.__code__, names, function.__name__, function.__defaults__, function.__closure__
        )
        copy.__kwdefaults__ = function.__kwdefaults__
        made[id(function)] = copy
        for name in function.__code__.co_names:
            if name in names:
                value = names[name]
                names[name] = np if _is_jax(value) else _copied(value, made) if _is_of_user(value) else value
    return made[id(function)]


def _is_of_user(value: Any) -> bool:
    """Whether it is a function in a file that is no installed package."""
    if not isinstance(value, FunctionType):
        return False
    parts = {*Path(value.__code__.co_filename).parts}
    in_package = value.__module__ is not None and value.__module__.partition(".")[0] == "mrwork"
    return not (in_package or {"site-packages", "dist-packages"} & parts or value.__module__ in _STANDARD)


_STANDARD = frozenset(
    ("math", "functools", "itertools", "dataclasses", "copy", "statistics", "random", "typing")
)


def _names_of(function: FunctionType) -> dict[str, Any]:
    """What a function uses from outside, by name."""
    names = {
        name: function.__globals__[name]
        for name in _names_in(function.__code__)
        if name in function.__globals__
    }
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    for name, cell in cells:
        try:
            names[name] = cell.cell_contents
        except ValueError:  # not bound yet
            continue
    return names


def _names_in(code: Any) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if hasattr(constant, "co_names"):
            yield from _names_in(constant)


def _functions_of(function: Any) -> Iterator[FunctionType]:
    """A function and those of its user that it calls."""
    if isinstance(function, MethodType):
        function = function.__func__
    elif not isinstance(function, FunctionType):
        function = type(function).__call__
    found: dict[int, FunctionType] = {}
    left = [function]
    while left:
        each = left.pop()
        if isinstance(each, FunctionType) and id(each) not in found:
            found[id(each)] = each
            left += (value for value in _names_of(each).values() if _is_of_user(value))
    yield from found.values()


def _effects(function: FunctionType, remedy: str) -> Iterator[str]:
    file, first = function.__code__.co_filename, function.__code__.co_firstlineno
    try:
        text = textwrap.dedent(inspect.getsource(function))
        tree = ast.parse(text)
    except (OSError, SyntaxError, TypeError, ValueError):
        yield from _effects_in_code(function, remedy)
        return
    definition = tree.body[0]
    if not isinstance(definition, ast.FunctionDef):
        return
    own, fresh = _own_names(definition, is_method="." in function.__qualname__.rpartition("<locals>")[2])
    for node in ast.walk(definition):
        at = f"{file}, line {first + getattr(node, 'lineno', 1) - 1}"
        if isinstance(node, ast.Expr) and isinstance(
            node.value, (ast.Call, ast.Await, ast.Yield, ast.YieldFrom)
        ):
            called = node.value.func if isinstance(node.value, ast.Call) else None
            if called is None or _root(called) not in fresh:
                words = (
                    "yields" if called is None else f"calls {ast.unparse(called)} and does not use the result"
                )
                yield f"{at}: it {words}: what it does beside its result would happen once; leave it out"
        elif isinstance(node, (ast.Global, ast.Nonlocal)):
            yield f"{at}: it changes {', '.join(node.names)}, which would happen once; {remedy}"
        elif isinstance(node, (ast.Subscript, ast.Attribute)) and not isinstance(node.ctx, ast.Load):
            root = _root(node)
            if root is not None and root not in own:
                yield f"{at}: it changes {root} from outside, which would happen once; {remedy}"


def _effects_in_code(function: FunctionType, remedy: str) -> Iterator[str]:
    """Effects of a function without a text, as one typed at a prompt, by its instructions.

    These do not tell whose entry is changed: nothing from outside that can be changed may stand beside such a change.
    """
    file, outside = function.__code__.co_filename, _names_of(function).items()
    mutable = [name for name, value in outside if not callable(value) and not isinstance(value, _FIXED)]
    for code in _codes_in(function.__code__):
        before = ""
        for each in dis.get_instructions(code):
            at = f"{file}, line {each.positions.lineno if each.positions else code.co_firstlineno}"
            if each.opname == "POP_TOP" and before.startswith("CALL"):
                yield (
                    f"{at}: it calls something and does not use the result: what it does beside its result would "
                    "happen once; leave it out, or write it in a file"
                )
            elif each.opname in _OUTSIDE or (
                each.opname == "STORE_DEREF" and each.argval in function.__code__.co_freevars
            ):
                yield f"{at}: it changes {each.argval}, which would happen once; {remedy}"
            elif each.opname in _CHANGES and mutable:
                yield (
                    f"{at}: it changes something, and {mutable[0]} from outside may be that, which would happen once; "
                    f"write it in a file, or {remedy}"
                )
            before = each.opname


def _codes_in(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes_in(constant)


def _root(node: ast.expr) -> str | None:
    """The name that a place or method belongs to; `None` without one."""
    while isinstance(node, (ast.Subscript, ast.Attribute)):
        node = node.value
    return node.id if isinstance(node, ast.Name) else None


def _own_names(definition: ast.FunctionDef, *, is_method: bool) -> tuple[set[str], set[str]]:
    """Names of what a function has of its own, and of what it has made itself in its text."""
    arguments = definition.args
    own = {each.arg for each in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)}
    if is_method and arguments.args:
        # An object keeps what is set in it.
        own -= {arguments.args[0].arg}
    fresh, foreign, named = set[str](), set[str](), list[tuple[str, str]]()
    for node in ast.walk(definition):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            own.add(node.id)
        if isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name):
                    (fresh if isinstance(node.value, _FRESH) else foreign).add(target.id)
                    if isinstance(node.value, (ast.Name, ast.Attribute, ast.Subscript)):
                        named.append((target.id, _root(node.value) or ""))
    # Another name for something from outside is that too.
    for _ in named:
        own -= {name for name, root in named if root not in own}
    return own, fresh - foreign
