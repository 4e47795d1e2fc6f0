"""Arguments of public functions, checked against the annotations that the functions have anyway.

`@checked` stands on functions, and on dataclasses that users build. A number or an array is finite unless its default
is infinite or NaN, or its annotation says otherwise, as `Annotated[ArrayLike, May.BE_NAN]`; a range is written
`Annotated[float, Within(above=0.0)]`, or declared by the `key` of a field. What must be above zero is at least 1e-100,
so that its inverse and its square are finite; other numbers are taken as they are. Lists become tuples, and numbers
become arrays, where the annotation says so. An annotation that cannot be checked, such as `Any` or a type of a library
that is loaded late, takes everything.
A class says in `_made_by` how a user gets one of its objects.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from functools import wraps
from types import SimpleNamespace
from typing import Annotated, Any, TypeVar, cast, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.argument_kinds import Kind, May, Refusal, Shape, kind_of, shape_of
from mrwork.errors import InvalidSettingError, MrworkError, SettingError
from mrwork.escaping import escape_text
from mrwork.keys import Within, keys_of

__all__ = [
    "AnyArray",
    "AnyArrayLike",
    "AnyNumbers",
    "Count",
    "Level",
    "May",
    "NotNegative",
    "Positive",
    "Rows",
    "Samples",
    "Seed",
    "Shape",
    "Share",
    "Threads",
    "Whole",
    "Within",
    "checked",
]

Positive = Annotated[float, Within(above=0.0)]
NotNegative = Annotated[float, Within(least=0.0)]
Share = Annotated[float, Within(least=0.0, most=1.0)]
# Of a band.
Level = Annotated[float, Within(above=0.0, below=1.0)]
Whole = Annotated[int, Within(least=0, most=2**63 - 1)]
Count = Annotated[int, Within(least=1, most=2**63 - 1)]
Seed = Annotated[int, Within(least=0, most=2**64 - 1)]
# 0 is all.
Threads = Annotated[int, Within(least=0, most=1024)]
# Misfits of failed candidates are infinite, and the functions say more of a wrong number than its place.
AnyNumbers = Annotated[NDArray[np.float64], May.BE_INFINITE, May.BE_NAN]
# A force, or a history of something else; draws or candidates in rows.
Samples = Annotated[NDArray[np.float64], Shape(("n_time",))]
Rows = Annotated[NDArray[np.float64], Shape(("n_batch", "n_time"))]
# Of NumPy or JAX.
AnyArray = Annotated[Any, May.BE_TRACED, May.BE_INFINITE, May.BE_NAN]
AnyArrayLike = Annotated[ArrayLike, May.BE_INFINITE, May.BE_NAN]

TargetT = TypeVar("TargetT", bound=Callable[..., Any])


def checked(target: TargetT) -> TargetT:
    """Check the arguments of a function, or of the constructor of a dataclass, before it runs.

    The function raises an `ArgumentError` for an argument of another kind than its annotation, and a `SettingError` for
    a number that is not finite or out of its range, or a name that is none of those to choose from.
    """
    if isinstance(target, type):
        if not is_dataclass(target):
            raise TypeError(f"{target.__name__} is no dataclass; put `checked` on its constructor")
        setattr(target, "__init__", _checking(target.__init__, target.__name__, target))  # noqa: B010 # not for a type checker
        return target
    # A method is named with its class, a constructor by its class, a function within a function by its own name.
    name = target.__qualname__.rpartition("<locals>.")[2].removesuffix(".__init__")
    return cast(TargetT, _checking(target, name))


def _checking(function: Any, name: str, owner: type = object) -> Any:
    """The function behind the check; a constructor has the fields of its class, the `owner`."""
    signature = inspect.signature(function)
    positional = tuple(
        each.name
        for each in signature.parameters.values()
        if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)
    )
    rest = next((each.name for each in signature.parameters.values() if each.kind is each.VAR_POSITIONAL), "")
    # Empty until the first call: an annotation may name what is defined after the function.
    kinds: dict[str, Kind] = {}
    shapes: dict[str, Shape] = {}

    @wraps(function)
    def checking(*args: Any, **given: Any) -> Any:
        if not kinds:
            kinds.update(_kinds_of(function, signature, owner))
            shapes.update(_shapes_of(function, signature))
        values = [
            _accept_value(kinds, name, parameter, value, owner)
            for parameter, value in zip(positional, args, strict=False)
        ]
        more = [_accept_value(kinds, name, rest, value, owner) for value in args[len(values) :]]
        named = {
            parameter: _accept_value(kinds, name, parameter, value, owner)
            for parameter, value in given.items()
        }
        if shapes:
            _agree(shapes, name, dict(zip(positional, values, strict=False)) | named)
        return function(*values, *more, **named)

    return checking


def _accept_value(kinds: Mapping[str, Kind], function: str, parameter: str, value: Any, owner: type) -> Any:
    if parameter not in kinds:
        return value
    try:
        return kinds[parameter].accept(value)
    except Refusal as refusal:
        raise _error(parameter, function, refusal, owner) from None


def _error(parameter: str, function: str, refusal: Refusal, owner: type = object) -> MrworkError:
    name = f"`{parameter}{refusal.place}`"
    sentence = escape_text(f"{name} of {function} {refusal.sentence}")
    if owner is not object and issubclass(refusal.error, SettingError):
        error: MrworkError = InvalidSettingError(parameter, sentence)
    else:
        error = refusal.error(sentence)
        error.key = parameter
    error.in_a_file = escape_text(f"{name} {refusal.sentence}")
    return error


def _agree(shapes: Mapping[str, Shape], function: str, given: Mapping[str, Any]) -> None:
    known: dict[str, tuple[int, str]] = {}
    for parameter, shape in shapes.items():
        value = given.get(parameter)
        # A number may stand for an array where the annotation has both.
        if value is None or isinstance(value, int | float):
            continue
        try:
            shape.check(value, known, parameter)
        except Refusal as refusal:
            raise _error(parameter, function, refusal) from None


def _shapes_of(function: Any, signature: inspect.Signature) -> dict[str, Shape]:
    own = inspect.unwrap(function).__globals__
    found = {
        name: shape_of(_resolve_annotation(parameter.annotation, own))
        for name, parameter in signature.parameters.items()
    }
    return {name: shape for name, shape in found.items() if shape is not None}


def _kinds_of(function: Any, signature: inspect.Signature, owner: type = object) -> dict[str, Kind]:
    # An inherited field is annotated with names of the module of its own class.
    homes = {
        name: vars(sys.modules[each.__module__])
        for each in reversed(owner.__mro__)
        for name in vars(each).get("__annotations__", ())
    }
    own = inspect.unwrap(function).__globals__
    declared = {entry.name: entry.metadata for entry in keys_of(owner)} if is_dataclass(owner) else {}
    return {
        name: kind_of(
            _resolve_annotation(parameter.annotation, homes.get(name, own)),
            parameter.default,
            declared.get(name),
        )
        for name, parameter in signature.parameters.items()
        if parameter.annotation is not parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
    }


def _resolve_annotation(annotation: Any, names: dict[str, Any]) -> Any:
    alone = SimpleNamespace(__annotations__={"annotation": annotation})
    try:
        return get_type_hints(alone, names, include_extras=True)["annotation"]
    except NameError:
        return Any
