"""Arguments of public functions, checked against the annotations that the functions have anyway.

`@checked` stands on functions, and on dataclasses that users build. A number or an array is finite unless its default
is infinite or NaN, or its annotation says otherwise, as `Annotated[ArrayLike, May.BE_NAN]`; a range is written
`Annotated[float, Within(above=0.0)]`. Lists become tuples, and numbers become arrays, where the annotation says so.
An annotation that cannot be checked, such as `Any` or a type of a library that is loaded late, takes everything.
A class says in `_made_by` how a user gets one of its objects.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from functools import wraps
from types import SimpleNamespace
from typing import Any, TypeVar, cast, get_type_hints

from mrwork.argument_kinds import Kind, May, Refusal, Within, kind_of
from mrwork.escaping import escaped

__all__ = ["May", "Within", "checked"]

TargetT = TypeVar("TargetT", bound=Callable[..., Any])


def checked(target: TargetT) -> TargetT:
    """Check the arguments of a function, or of the constructor of a dataclass, before it runs.

    Raises
    ------
    ArgumentError
        From the function: an argument is of another kind than its annotation.
    SettingError
        From the function: a number is not finite or out of its range, or a name is none of those to choose from.
    """
    if isinstance(target, type):
        if not is_dataclass(target):
            raise TypeError(f"{target.__name__} is no dataclass; put `checked` on its constructor")
        setattr(target, "__init__", _checking(target.__init__, target.__name__))  # noqa: B010 # not for a type checker
        return target
    return cast(TargetT, _checking(target, target.__name__))


def _checking(function: Any, name: str) -> Any:
    signature = inspect.signature(function)
    positional = tuple(
        each.name
        for each in signature.parameters.values()
        if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)
    )
    # Empty until the first call: an annotation may name what is defined after the function.
    kinds: dict[str, Kind] = {}

    @wraps(function)
    def checking(*args: Any, **given: Any) -> Any:
        if not kinds:
            kinds.update(_kinds_of(function, signature))
        values = [
            _accepted(kinds, name, parameter, value)
            for parameter, value in zip(positional, args, strict=False)
        ]
        named = {parameter: _accepted(kinds, name, parameter, value) for parameter, value in given.items()}
        return function(*values, *args[len(values) :], **named)

    return checking


def _accepted(kinds: Mapping[str, Kind], function: str, parameter: str, value: Any) -> Any:
    if parameter not in kinds:
        return value
    try:
        return kinds[parameter].accept(value)
    except Refusal as refusal:
        raise refusal.error(
            escaped(f"`{parameter}{refusal.place}` of {function} {refusal.sentence}")
        ) from None


def _kinds_of(function: Any, signature: inspect.Signature) -> dict[str, Kind]:
    return {
        name: kind_of(_resolved(parameter.annotation, function), parameter.default)
        for name, parameter in signature.parameters.items()
        if parameter.annotation is not parameter.empty
        and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    }


def _resolved(annotation: Any, function: Any) -> Any:
    alone = SimpleNamespace(__annotations__={"annotation": annotation})
    try:
        return get_type_hints(alone, function.__globals__, include_extras=True)["annotation"]
    except NameError:
        return Any
