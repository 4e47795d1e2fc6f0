"""Arguments of public functions, checked against the annotations that the functions have anyway.

`@checked` stands on functions, and on classes of data that users build, which it makes dataclasses. A number or an
array is finite unless its default is infinite or NaN, or its annotation says otherwise, as
`Annotated[ArrayLike, May.BE_NAN]`; a range is written `Annotated[float, Within(above=0.0)]`, or declared by the `key`
of a field. What must be above zero is at least 1e-100, so that its inverse and its square are finite; other numbers are
taken as they are. Lists become tuples, and numbers become arrays, where the annotation says so. `Any` takes everything;
an annotation of an unknown form is an error when the function is defined.
A class says in `_made_by` how a user gets one of its objects.

Each annotation becomes a `Kind`: how a message calls such a value, and the check that accepts or refuses one.
"""

from __future__ import annotations

import inspect
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, is_dataclass
from functools import partial, wraps
from itertools import chain, repeat
from numbers import Real
from types import NoneType
from typing import Annotated, Any, TypeVar, cast, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base import hints as nodes
from mrwork.base.hints import LARGEST, Node, Notes, fields_of, hint_in, node_of, notes_of_default, shape_of
from mrwork.base.hints import May as May
from mrwork.base.hints import Shape as Shape
from mrwork.base.hints import Within as Within
from mrwork.base.keys import closest, suggestion
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.errors import (
    ArgumentError,
    InvalidSettingError,
    MrworkError,
    Restorable,
    SettingError,
    UnknownChoiceError,
    escape_text,
)

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

_VARIADIC = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)

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
        kind.__init__ = _check_calls(kind.__init__, kind.__name__, kind)
        return cast(TargetT, kind)
    # A method is named with its class, a constructor by its class, a function within a function by its own name.
    name = target.__qualname__.rpartition("<locals>.")[2].removesuffix(".__init__")
    return cast(TargetT, _check_calls(target, name))


def _check_calls(function: Any, name: str, owner: type = object) -> Any:
    """The function with its arguments checked; a constructor takes the fields of its class, the `owner`."""
    signature = inspect.signature(function)
    parameters = signature.parameters.values()
    positional = tuple(
        parameter.name
        for parameter in parameters
        if parameter.kind in (parameter.POSITIONAL_ONLY, parameter.POSITIONAL_OR_KEYWORD)
    )
    variadic = {parameter.kind: parameter.name for parameter in parameters if parameter.kind in _VARIADIC}
    rest = variadic.get(inspect.Parameter.VAR_POSITIONAL, "")
    known = frozenset(signature.parameters)
    takes_any = inspect.Parameter.VAR_KEYWORD in variadic
    required = tuple(
        parameter.name
        for parameter in parameters
        if parameter.default is parameter.empty and parameter.kind not in variadic
    )
    kinds: dict[str, Kind] = {}
    shapes: dict[str, Shape] = {}

    def read_annotations() -> None:
        nodes = nodes_of(function, signature, owner)
        kinds.update({name: kind_of(node) for name, node in nodes.items()})
        shapes.update({name: shape for name, node in nodes.items() if (shape := shape_of(node))})

    # An annotation may name what is defined after the function; the first call reads it then.
    with suppress(NameError):
        read_annotations()

    def accept(parameter: str, value: Any) -> Any:
        if parameter not in kinds:
            return value
        try:
            return kinds[parameter].accept(value)
        except Refusal as refusal:
            raise _error(parameter, name, refusal, owner) from None

    @wraps(function)
    def checking(*args: Any, **given: Any) -> Any:
        if not kinds:
            read_annotations()
        if not (takes_any or given.keys() <= known):
            raise _unknown_argument(name, next(word for word in given if word not in known), signature)
        if len(args) > len(positional) and not rest:
            raise _by_position(name, positional, len(args), signature)
        if twice := given.keys() & positional[: len(args)]:
            raise ArgumentError(f"`{min(twice)}` of {name} is given by position and by name; give it once")
        values = list(map(accept, chain(positional, repeat(rest)), args))
        named = {parameter: accept(parameter, value) for parameter, value in given.items()}
        if missing := [parameter for parameter in required[len(args) :] if parameter not in given]:
            listed = list_names([f"`{parameter}`" for parameter in missing], len(missing))
            raise ArgumentError(f"{name} lacks {listed}; give {'it' if len(missing) == 1 else 'them'}")
        if shapes:
            _check_shapes(shapes, name, dict(zip(positional, values, strict=False)) | named)
        return function(*values, **named)

    return checking


def _unknown_argument(function: str, given: str, signature: inspect.Signature) -> ArgumentError:
    names = [parameter for parameter in signature.parameters if parameter not in ("self", "cls")]
    near = closest(given, names)
    meant = f", did you mean `{near}`" if near else f"; it takes {list_names(names, 12) or 'none'}"
    return ArgumentError(escape_text(f"{function} has no argument `{given}`{meant}"))


def _by_position(
    function: str, positional: tuple[str, ...], count: int, signature: inspect.Signature
) -> ArgumentError:
    own = [parameter for parameter in positional if parameter not in ("self", "cls")]
    left_out = len(positional) - len(own)
    named = [parameter for parameter in signature.parameters if parameter not in positional]
    taken = f"takes {list_names(own, 12)} by position" if own else "takes no argument by position"
    rest = ", ".join(f"{parameter}=..." for parameter in named[: count - len(positional)])
    remedy = f"give {'the others' if own else 'them'} by name, as in {rest}" if rest else "give no more"
    came = count - left_out
    return ArgumentError(f"{function} {taken} and got {came} value{'' if came == 1 else 's'}; {remedy}")


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


def _check_shapes(shapes: Mapping[str, Shape], function: str, given: Mapping[str, Any]) -> None:
    """Refuse an array with other axes, or other lengths than the arrays before it."""
    known: dict[str, tuple[int, str]] = {}
    for parameter, shape in shapes.items():
        value = given.get(parameter)
        # A number may stand for an array where the annotation has both.
        if value is None or isinstance(value, int | float):
            continue
        try:
            _check_shape(shape, value, known, parameter)
        except Refusal as refusal:
            raise _error(parameter, function, refusal) from None


def nodes_of(function: Any, signature: inspect.Signature, owner: type = object) -> dict[str, Node]:
    """Annotation node of each parameter of a function, or of the constructor of the dataclass `owner`."""
    own = inspect.unwrap(function).__globals__
    declared = fields_of(owner) if is_dataclass(owner) else {}
    return {
        name: declared[name]
        if name in declared
        else node_of(hint_in(own, parameter.annotation), notes_of_default(parameter.default))
        for name, parameter in signature.parameters.items()
        if parameter.annotation is not parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
    }


# Kinds of values

# As many characters of a value as a message repeats.
_SHOWN = 40


def _check_shape(shape: Shape, value: Any, known: dict[str, tuple[int, str]], parameter: str) -> None:
    given = tuple(np.shape(value))
    wanted = f"({', '.join(shape.axes)}{',' if len(shape.axes) == 1 else ''})"
    if len(given) != len(shape.axes):
        raise Refusal(f"has shape {given}; give shape {wanted}", SettingError)
    for axis, length in zip(shape.axes, given, strict=True):
        expected, source = known.setdefault(axis, (length, parameter))
        if length != expected:
            raise Refusal(
                f"has shape {given}; give shape {wanted} with {axis} = {expected}, as `{source}` has",
                SettingError,
            )


class Refusal(Restorable, Exception):  # noqa: N818 # becomes an error where the name of the argument is known
    """Refusal of a value: the place in the argument, the rest of the sentence, and the error to raise."""

    def __init__(self, sentence: str, error: type[MrworkError] = ArgumentError, place: str = "") -> None:
        super().__init__(sentence)
        self.sentence, self.error, self.place = sentence, error, place


class OtherKind(Refusal):
    """Refusal of a value of another type: another member of a union may accept it."""

    def __init__(self, value: object, words: str) -> None:
        super().__init__(f"is {_quote_value(value)}; give {words}")


@dataclass(frozen=True, slots=True)
class Kind:
    """Kind of an argument: its name in messages, and the check that returns the value or raises `Refusal`.

    Of the members of a union, those of lower `rank` are asked first.
    """

    words: str
    accept: Callable[[Any], Any]
    rank: int = 1


_ANYTHING = Kind("anything", lambda value: value)


def kind_of(node: Node) -> Kind:
    """Kind of argument that an annotation declares."""
    of = [kind_of(part) for part in node.parts]
    match node:
        case nodes.Scalar(kind):
            return _SCALARS[kind](node.notes)
        case nodes.Enumerated(values):
            return _name(values)
        case nodes.Array(None):
            return _array_like(node.notes)
        case nodes.Array(scalar):
            return _array(scalar, node.notes)
        case nodes.Items(kind):
            return _sequence(of[0], as_tuple=kind is tuple)
        case nodes.Fixed():
            return _tuple(of)
        case nodes.ByName():
            return _mapping(*of)
        case nodes.Either(kind):
            return _one_of([*of, *([_NONE] if kind is NoneType else ())])
        case nodes.Function((takes, returns)):
            return _function(takes, returns)
        case nodes.Record(kind) | nodes.Instance(kind):
            return _object(kind, of)
    return _ANYTHING


def _quote_value(value: object) -> str:
    """A value as messages quote it."""
    if value is None:
        return "None"
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape} with values of type {value.dtype}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if isinstance(value, str | bytes | bool | int | float | complex):
        try:
            text = repr(value)
        except ValueError:
            return "a number of thousands of digits"
        return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
    return f"{'an' if type(value).__name__[0] in 'AEIOUaeiou' else 'a'} {type(value).__name__}"


def _instance(kind: type, words: str, value: Any) -> Any:
    if not isinstance(value, kind):
        raise OtherKind(value, words)
    return value


# Scalars


def _float(notes: Notes) -> Kind:
    words = "a number"

    def accept(value: Any) -> Any:
        number = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
        if not isinstance(number, Real) or isinstance(number, bool):
            raise OtherKind(value, words)
        try:
            plain = float(number)
        except OverflowError:
            raise Refusal(f"is {_quote_value(value)}; give a smaller number", SettingError) from None
        if notes or not abs(plain) <= LARGEST:
            _check_numbers(np.float64(plain), notes)
        exact = isinstance(number, float) or (isinstance(number, int) and abs(number) < 2**53)
        return number if exact else plain

    return Kind(words, accept, rank=0)


def _int(notes: Notes) -> Kind:
    words = "a whole number"

    def accept(value: Any) -> int:
        if isinstance(value, bool | np.bool_):
            raise OtherKind(value, words)
        try:
            number = operator.index(value)
        except TypeError:
            raise OtherKind(value, words) from None
        for note in notes:
            if isinstance(note, Within) and note.excludes(number):
                wanted = note.instead_of(number, "whole number")
                raise Refusal(f"is {_quote_value(number)}; give {wanted}", SettingError)
        if not -(2**63) <= number < 2**64:
            raise Refusal(f"is {_quote_value(number)}; give a whole number of 64 bits", SettingError)
        return number

    return Kind(words, accept, rank=0)


def _bool(_: Notes) -> Kind:
    def accept(value: Any) -> bool:
        if not isinstance(value, bool | np.bool_):
            raise OtherKind(value, "true or false")
        return bool(value)

    return Kind("true or false", accept, rank=0)


_TEXT = Kind("a text", partial(_instance, str, "a text"), rank=0)
_NONE = Kind("None", partial(_instance, NoneType, "None"), rank=0)
_SCALARS: dict[type, Callable[[Notes], Kind]] = {
    float: _float, int: _int, bool: _bool, str: lambda _: _TEXT, NoneType: lambda _: _NONE,
}  # fmt: skip


def _name(choices: tuple[Any, ...]) -> Kind:
    texts = [choice for choice in choices if isinstance(choice, str)]
    words = " or ".join(map(repr, choices))

    def accept(value: Any) -> Any:
        # Not by `in`: an array would be compared element by element, and 1 equals true.
        for choice in choices:
            if type(value) is type(choice) and value == choice:
                return choice
        if isinstance(value, str) and texts:
            raise Refusal(f"is {_quote_value(value)}{suggestion(value, texts)}", UnknownChoiceError)
        if type(value) in {type(choice) for choice in choices}:
            raise Refusal(f"is {_quote_value(value)}; give {words}", UnknownChoiceError)
        raise OtherKind(value, words)

    return Kind(words, accept, rank=0)


# Arrays


def _array(scalar: type, notes: Notes) -> Kind:
    kinds = {"f": "iuf", "i": "iu", "u": "iu", "c": "iufc", "b": "b"}.get(np.dtype(scalar).kind, "")
    words = {"f": "an array of numbers", "c": "an array of numbers"}.get(
        np.dtype(scalar).kind, f"an array of {np.dtype(scalar)}"
    )

    def accept(value: Any) -> Any:
        array = _as_array(value, kinds, words)
        if array.dtype.kind in "fciu":
            _check_numbers(array, notes)
        return array if array.dtype == scalar else array.astype(scalar)

    return Kind(words, accept, rank=3) if kinds else _ANYTHING


def _array_like(notes: Notes) -> Kind:
    words = "an array of numbers"

    def accept(value: Any) -> Any:
        of_other_library = hasattr(value, "__array_namespace__") and not isinstance(
            value, np.ndarray | np.generic
        )
        if May.BE_TRACED in notes and of_other_library:
            return value
        array = _as_array(value, "iuf", words)
        _check_numbers(array, notes)
        if May.BE_TRACED in notes:
            return array.astype(np.float64, copy=False)
        return value if isinstance(value, int | float | list | tuple) else array

    return Kind(words, accept, rank=3)


def _as_array(value: Any, kinds: str, words: str) -> Any:
    if value is None or isinstance(value, str | bytes | Mapping | set | frozenset):
        raise OtherKind(value, words)
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise Refusal("has masked values; fill them in or cut them out")
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        raise Refusal(
            f"is {_quote_value(value)} that is no array; give {words} in rows of one length"
        ) from None
    if array.ndim == 0 and array.dtype.kind == "O" and not isinstance(value, int):
        raise OtherKind(value, words)
    if array.dtype.kind == "O" and all(type(item) is int for item in array.flat):
        raise Refusal("has whole numbers of more than 64 bits; give smaller ones", SettingError)
    if array.dtype.kind not in kinds and array.size:
        raise Refusal(f"has values of type {array.dtype}; give {words}")
    return array if array.size else array.astype(np.float64 if "f" in kinds else np.int64)


def _check_numbers(values: Any, notes: Notes) -> None:
    """Refuse numbers that are not finite, and those out of the ranges among the notes."""
    numbers = "finite numbers" if np.ndim(values) else "a finite number"
    # The limits are beyond single precision.
    size = np.abs(values.astype(np.float64) if values.dtype.itemsize < 8 else values)
    if not (size <= LARGEST).all():
        allowed = (
            (size <= LARGEST)
            | ((size > LARGEST) & (May.BE_INFINITE in notes))
            | (np.isnan(values) & (May.BE_NAN in notes))
        )
        if not np.all(allowed):
            most = "" if np.any(~allowed & ~np.isfinite(values)) else f" of at most {LARGEST:g}"
            raise Refusal(f"{_worst(values, ~allowed)}; give {numbers}{most}", SettingError)
    for note in notes:
        if isinstance(note, Within) and np.any(out := note.excludes(values)):
            first = values if np.ndim(values) == 0 else values[np.asarray(out)][0]
            wanted = note.instead_of(first, "numbers" if np.ndim(values) else "number")
            raise Refusal(f"{_worst(values, out)}; give {wanted}", SettingError)


def _worst(values: Any, out: Any) -> str:
    if np.ndim(values) == 0:
        return f"is {values:g}"
    first = tuple(int(index) for index in np.argwhere(out)[0])
    return f"is {values[first]:g} at {first[0] if len(first) == 1 else first}"


# Containers


def _sequence(of: Kind, *, as_tuple: bool) -> Kind:
    words = f"a list, each item {of.words}"

    def accept(value: Any) -> Any:
        # The rows of a matrix are items of their own where items are lists.
        listed = _list_values(value, words, most_axes=2 if of.rank > 1 else 1)
        items = [_accept_at(of, item, f"[{position}]") for position, item in enumerate(listed)]
        if listed is value and all(new is old for new, old in zip(items, listed, strict=True)):
            items = value
        return tuple(items) if as_tuple or not isinstance(listed, list) else items

    return Kind(words, accept, rank=2)


def _iterable(of: Kind) -> Kind:
    """Kind of an iterable: items of a container and keys of a dict are checked, those of an iterator are not."""
    words = f"several values, each {of.words}"

    def accept(value: Any) -> Any:
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            raise OtherKind(value, words)
        if isinstance(value, list | tuple | set | frozenset | Mapping):
            return tuple(_accept_at(of, item, f"[{position}]") for position, item in enumerate(value))
        return value

    return Kind(words, accept, rank=2)


def _tuple(kinds: list[Kind]) -> Kind:
    words = f"{len(kinds)} values: {', '.join(kind.words for kind in kinds)}"

    def accept(value: Any) -> Any:
        listed = _list_values(value, words)
        if len(listed) != len(kinds):
            raise Refusal(f"has {len(listed)} values; give {words}")
        return tuple(
            _accept_at(kind, item, f"[{position}]")
            for position, (kind, item) in enumerate(zip(kinds, listed, strict=True))
        )

    return Kind(words, accept, rank=2)


def _mapping(names: Kind, values: Kind) -> Kind:
    words = "a dict" if values is _ANYTHING else f"a dict, each value {values.words}"

    def accept(value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise OtherKind(value, words)
        accepted = {
            _accept_at(names, name, f" key {name!r}"): _accept_at(values, item, f"[{name!r}]")
            for name, item in value.items()
        }
        return value if all(accepted[name] is value[name] for name in accepted) else accepted

    return Kind(words, accept, rank=2)


def _list_values(value: Any, words: str, most_axes: int = 1) -> Any:
    if isinstance(value, np.ndarray) and 1 <= value.ndim <= most_axes and not np.ma.is_masked(value):
        return value.tolist()
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise OtherKind(value, words)
    return value if isinstance(value, list | tuple) else tuple(value)


def _accept_at(kind: Kind, value: Any, place: str) -> Any:
    try:
        return kind.accept(value)
    except Refusal as refusal:
        refusal.place = f"{place}{refusal.place}"
        raise


# Objects


def _object(kind: Any, of: list[Kind]) -> Kind:
    if kind is type:
        return Kind("a class", partial(_instance, type, "a class"))
    if kind is Iterable:
        return _iterable(*of or (_ANYTHING,))
    if kind is os.PathLike:
        return Kind("a path", _path)
    if getattr(kind, "_is_protocol", False):
        return _protocol(kind)
    made = getattr(kind, "_made_by", "")
    words = (
        f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}{f', made by {made}' if made else ''}"
    )
    return Kind(words, partial(_instance, kind, words))


def _path(value: Any) -> Any:
    if not isinstance(value, os.PathLike) or not isinstance(os.fspath(value), str):
        raise OtherKind(value, "a path")
    return value


def _function(takes: Any, returns: Any) -> Kind:
    """Kind of a function by its number of arguments; where it returns nothing, a class is refused."""
    alone = returns in (None, NoneType, bool | None)
    count = len(takes) if isinstance(takes, list) else None
    words = "a function" if count is None else f"a function of {count} argument{'' if count == 1 else 's'}"

    def accept(value: Any) -> Any:
        if not callable(value) or (alone and isinstance(value, type)):
            raise OtherKind(value, words)
        if count is not None and not _takes(value, count):
            raise Refusal(f"is a function of other arguments; give {words}")
        return value

    return Kind(words, accept)


def _takes(function: Any, count: int) -> bool:
    try:
        signature = inspect.signature(function)
    except (ValueError, TypeError):
        # Some compiled functions have none.
        return True
    try:
        signature.bind(*[None] * count)
    except TypeError:
        return False
    return True


def _protocol(kind: type) -> Kind:
    members = {
        name
        for base in kind.__mro__
        if getattr(base, "_is_protocol", False) and base.__module__ != "typing"
        for name in (*vars(base), *vars(base).get("__annotations__", ()))
        if name == "__call__" or not name.startswith("_")
    }
    words = "a function" if "__call__" in members else f"an object with {', '.join(sorted(members))}"

    def accept(value: Any) -> Any:
        if isinstance(value, type) or not all(hasattr(value, name) for name in members):
            raise OtherKind(value, words)
        return value

    return Kind(words, accept)


def _one_of(kinds: list[Kind]) -> Kind:
    kinds.sort(key=lambda kind: kind.rank)
    words = " or ".join(kind.words for kind in kinds if kind.words != "None")

    def accept(value: Any) -> Any:
        closest: Refusal | None = None
        for kind in kinds:
            try:
                return kind.accept(value)
            except OtherKind as refusal:
                if refusal.place:
                    closest = closest or refusal
            except Refusal as refusal:
                closest = closest or refusal
        raise closest or OtherKind(value, words)

    return Kind(words, accept, rank=max(kind.rank for kind in kinds))
