"""Arguments of public functions, checked against the annotations that the functions have anyway.

`@checked` stands on functions, and on classes of data that users build, which it makes dataclasses. A number or an
array is finite unless its default is infinite or NaN, or its annotation says otherwise, as
`Annotated[ArrayLike, May.BE_NAN]`; a range is written `Annotated[float, Within(above=0.0)]`, or declared by the `key`
of a field. What must be above zero is at least 1e-100, so that its inverse and its square are finite; other numbers are
taken as they are. Lists become tuples, and numbers become arrays, where the annotation says so. An annotation that
cannot be checked, such as `Any` or a type of a library that is loaded late, takes everything.
A class says in `_made_by` how a user gets one of its objects.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, is_dataclass
from functools import wraps
from typing import Annotated, Any, TypeVar, cast, dataclass_transform

from numpy.typing import ArrayLike

from mrwork.base.argument_kinds import Kind, Refusal, check_shape, kind_of
from mrwork.base.hints import (
    May,
    Node,
    Shape,
    Within,
    fields_of,
    hint_in,
    node_of,
    notes_of_default,
    shape_of,
)
from mrwork.base.keys import closest
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.errors import ArgumentError, InvalidSettingError, MrworkError, SettingError, escape_text

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
AnyNumbers = Annotated[Floats, May.BE_INFINITE, May.BE_NAN]
# A force, or a history of something else; draws or candidates in rows.
Samples = Annotated[Floats, Shape(("n_time",))]
Rows = Annotated[Floats, Shape(("n_batch", "n_time"))]
# Of NumPy or JAX.
AnyArray = Annotated[Any, May.BE_TRACED, May.BE_INFINITE, May.BE_NAN]
AnyArrayLike = Annotated[ArrayLike, May.BE_INFINITE, May.BE_NAN]

TargetT = TypeVar("TargetT", bound=Callable[..., Any])


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def checked(target: TargetT) -> TargetT:
    """Check the arguments of a function, or of the constructor of a dataclass, before it runs.

    A class becomes a frozen, slotted, keyword-only dataclass, unless it is a dataclass already. The function raises an
    `ArgumentError` for an argument of another kind than its annotation, of an unknown name, by position where a name is
    wanted, or left out; and a `SettingError` for a number that is not finite or out of its range, or a name that is
    none of those to choose from.
    """
    if isinstance(target, type):
        kind: Any = target
        if "__dataclass_fields__" not in vars(target):
            if "__init__" in vars(target):
                raise TypeError(f"{target.__name__} is no dataclass; put `checked` on its constructor")
            kind = dataclass(frozen=True, slots=True, kw_only=True)(target)
        kind.__init__ = _checking(kind.__init__, kind.__name__, kind)
        return cast(TargetT, kind)
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
    takes_any = any(each.kind is each.VAR_KEYWORD for each in signature.parameters.values())
    known = frozenset(signature.parameters)
    required = tuple(
        each.name
        for each in signature.parameters.values()
        if each.default is each.empty and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
    )
    # Empty until the first call: an annotation may name what is defined after the function.
    kinds: dict[str, Kind] = {}
    shapes: dict[str, Shape] = {}

    @wraps(function)
    def checking(*args: Any, **given: Any) -> Any:
        if not kinds:
            nodes = nodes_of(function, signature, owner)
            kinds.update({name: kind_of(node) for name, node in nodes.items()})
            shapes.update({name: shape for name, node in nodes.items() if (shape := shape_of(node))})
        if not (takes_any or given.keys() <= known):
            raise _unknown_argument(name, next(each for each in given if each not in known), signature)
        if len(args) > len(positional) and not rest:
            raise _by_position(name, positional, len(args), signature)
        if twice := given.keys() & positional[: len(args)]:
            raise ArgumentError(f"`{min(twice)}` of {name} is given by position and by name; give it once")
        values = [
            _accept_value(kinds, name, parameter, value, owner)
            for parameter, value in zip(positional, args, strict=False)
        ]
        more = [_accept_value(kinds, name, rest, value, owner) for value in args[len(values) :]]
        named = {
            parameter: _accept_value(kinds, name, parameter, value, owner)
            for parameter, value in given.items()
        }
        if missing := [each for each in required[len(args) :] if each not in given]:
            listed = list_names([f"`{each}`" for each in missing], len(missing))
            raise ArgumentError(f"{name} lacks {listed}; give {'it' if len(missing) == 1 else 'them'}")
        if shapes:
            _agree(shapes, name, dict(zip(positional, values, strict=False)) | named)
        return function(*values, *more, **named)

    return checking


def _unknown_argument(function: str, given: str, signature: inspect.Signature) -> ArgumentError:
    names = [each for each in signature.parameters if each not in ("self", "cls")]
    near = closest(given, names)
    meant = f", did you mean `{near}`" if near else f"; it takes {list_names(names, 12) or 'none'}"
    return ArgumentError(escape_text(f"{function} has no argument `{given}`{meant}"))


def _by_position(
    function: str, positional: tuple[str, ...], count: int, signature: inspect.Signature
) -> ArgumentError:
    own = [each for each in positional if each not in ("self", "cls")]
    left_out = len(positional) - len(own)
    named = [each for each in signature.parameters if each not in positional]
    taken = f"takes {list_names(own, 12)} by position" if own else "takes no argument by position"
    rest = ", ".join(f"{each}=..." for each in named[: count - len(positional)])
    remedy = f"give {'the others' if own else 'them'} by name, as in {rest}" if rest else "give no more"
    came = count - left_out
    return ArgumentError(f"{function} {taken} and got {came} value{'' if came == 1 else 's'}; {remedy}")


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
            check_shape(shape, value, known, parameter)
        except Refusal as refusal:
            raise _error(parameter, function, refusal) from None


def nodes_of(function: Any, signature: inspect.Signature, owner: type = object) -> dict[str, Node]:
    """What each parameter of a function declares, or of the constructor of a dataclass."""
    own = inspect.unwrap(function).__globals__
    declared = fields_of(owner) if is_dataclass(owner) else {}
    return {
        name: declared[name]
        if name in declared
        else node_of(hint_in(own, parameter.annotation), notes_of_default(parameter.default))
        for name, parameter in signature.parameters.items()
        if parameter.annotation is not parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
    }
