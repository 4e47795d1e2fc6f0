"""Kinds of values that type hints declare: how a message calls them, and the check that accepts or refuses a value."""

from __future__ import annotations

import inspect
import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import partial
from numbers import Real
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from mrwork.errors import ArgumentError, MrworkError, SettingError, UnknownChoiceError
from mrwork.keys import LARGEST, Within, suggestion

# As many characters of a value as a message repeats.
_SHOWN = 40


class May(Enum):
    """Numbers that are not finite, and nevertheless mean something where an annotation names them; arrays of JAX."""

    BE_INFINITE = auto()
    BE_NAN = auto()
    BE_TRACED = auto()


@dataclass(frozen=True, slots=True)
class Shape:
    """Names of the axes of an array; an axis has the same length in all arguments of a call that name it."""

    axes: tuple[str, ...]

    def check(self, value: Any, known: dict[str, tuple[int, str]], parameter: str) -> None:
        """Refuse a shape with other axes, or with lengths that differ from the `known` ones, which are added to."""
        found = tuple(np.shape(value))
        wanted = f"({', '.join(self.axes)}{',' if len(self.axes) == 1 else ''})"
        if len(found) != len(self.axes):
            raise Refusal(f"has shape {found}; give shape {wanted}", SettingError)
        for axis, length in zip(self.axes, found, strict=True):
            expected, source = known.setdefault(axis, (length, parameter))
            if length != expected:
                raise Refusal(
                    f"has shape {found}; give shape {wanted} with {axis} = {expected}, as `{source}` has",
                    SettingError,
                )


def shape_of(hint: Any) -> Shape | None:
    """The shape that a hint, or a member of a union, declares."""
    for note in getattr(hint, "__metadata__", ()):
        if isinstance(note, Shape):
            return note
    members = get_args(hint) if get_origin(hint) in (Union, UnionType) else ()
    return next((found for each in members if (found := shape_of(each)) is not None), None)


class Refusal(Exception):  # noqa: N818 # becomes an error where the name of the argument is known
    """Why a value is refused: the place in the argument, the rest of the sentence, and the error to raise."""

    def __init__(self, sentence: str, error: type[MrworkError] = ArgumentError, place: str = "") -> None:
        super().__init__(sentence)
        self.sentence, self.error, self.place = sentence, error, place


class OtherKind(Refusal):
    """The value is of another kind altogether, so that another member of a union may take it."""

    def __init__(self, value: object, words: str) -> None:
        super().__init__(f"is {_quote_value(value)}; give {words}")


@dataclass(frozen=True, slots=True)
class Kind:
    """What an argument may be, and the check that returns it as the function gets it or raises `Refusal`.

    Of the members of a union, those of lower `rank` are asked first.
    """

    words: str
    accept: Callable[[Any], Any]
    rank: int = 1


def kind_of(hint: Any, default: Any = None, declared: Mapping[str, Any] | None = None) -> Kind:
    """The kind that a hint declares, with the range that the notes of its `key` declare, if it has one.

    Numbers may be infinite or NaN where the default is.
    """
    notes: tuple[Any, ...] = ()
    if declared is not None:
        notes = (declared["within"], *((May.BE_NAN,) if declared["may_be_nan"] else ()))
    if isinstance(default, float) and not math.isfinite(default):
        notes = (*notes, May.BE_NAN if math.isnan(default) else May.BE_INFINITE)
    return _kind(hint, notes)


def _kind(hint: Any, notes: tuple[Any, ...]) -> Kind:
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _kind(inner[0], (*notes, *inner[1:]))
    if origin in (Union, UnionType):
        return _one_of(inner, notes)
    if origin is Literal:
        return _name(inner)
    if origin is np.ndarray:
        return _array(get_args(inner[1])[0], notes)
    if origin is tuple:
        return _tuple(inner, notes)
    if hint in _SCALARS:
        return _SCALARS[hint](notes)
    if hint is Any and May.BE_TRACED in notes:
        return _array_like(notes)
    kind: Any = origin or hint
    if kind in (Any, object) or not isinstance(kind, type):
        return Kind("anything", lambda value: value)
    if kind is Callable:
        return _function(*inner or (..., Any))
    if kind is type:
        return Kind("a class", partial(_instance, type, "a class"))
    if kind is Iterable:
        return _iterable(*inner or (Any,))
    if kind is os.PathLike:
        return Kind("a path", _path)
    if issubclass(kind, Mapping):
        return _mapping(inner, notes)
    if issubclass(kind, Sequence) and inner:
        return _sequence(inner[0], notes)
    if getattr(kind, "_is_protocol", False):
        return _protocol(kind)
    return _object(kind)


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


# Scalars


def _float(notes: tuple[Any, ...]) -> Kind:
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


def _int(notes: tuple[Any, ...]) -> Kind:
    words = "a whole number"

    def accept(value: Any) -> int:
        if isinstance(value, bool | np.bool_):
            raise OtherKind(value, words)
        try:
            number = operator.index(value)
        except TypeError:
            raise OtherKind(value, words) from None
        for each in notes:
            if isinstance(each, Within) and each.excludes(number):
                wanted = each.instead_of(number, "whole number")
                raise Refusal(f"is {_quote_value(number)}; give {wanted}", SettingError)
        if not -(2**63) <= number < 2**64:
            raise Refusal(f"is {_quote_value(number)}; give a whole number of 64 bits", SettingError)
        return number

    return Kind(words, accept, rank=0)


def _bool(_: tuple[Any, ...]) -> Kind:
    def accept(value: Any) -> bool:
        if not isinstance(value, bool | np.bool_):
            raise OtherKind(value, "true or false")
        return bool(value)

    return Kind("true or false", accept, rank=0)


def _text(_: tuple[Any, ...]) -> Kind:
    return Kind("a text", partial(_instance, str, "a text"), rank=0)


def _none(_: tuple[Any, ...]) -> Kind:
    return Kind("None", partial(_instance, NoneType, "None"), rank=0)


_SCALARS: dict[Any, Callable[[tuple[Any, ...]], Kind]] = {
    float: _float, int: _int, bool: _bool, str: _text, NoneType: _none,
}  # fmt: skip


def _name(choices: tuple[Any, ...]) -> Kind:
    texts = [each for each in choices if isinstance(each, str)]
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


def _array(scalar: type, notes: tuple[Any, ...]) -> Kind:
    kinds = {"f": "iuf", "i": "iu", "u": "iu", "c": "iufc", "b": "b"}.get(np.dtype(scalar).kind, "")
    words = {"f": "an array of numbers", "c": "an array of numbers"}.get(
        np.dtype(scalar).kind, f"an array of {np.dtype(scalar)}"
    )

    def accept(value: Any) -> Any:
        array = _as_array(value, kinds, words)
        if array.dtype.kind in "fciu":
            _check_numbers(array, notes)
        return array if array.dtype == scalar else array.astype(scalar)

    return Kind(words, accept, rank=3) if kinds else Kind("anything", lambda value: value)


def _array_like(notes: tuple[Any, ...]) -> Kind:
    words = "an array of numbers"

    def accept(value: Any) -> Any:
        if May.BE_TRACED in notes and _is_traced(value):
            return value
        array = _as_array(value, "iuf", words)
        _check_numbers(array, notes)
        if May.BE_TRACED in notes:
            return array.astype(np.float64, copy=False)
        return value if isinstance(value, int | float | list | tuple) else array

    return Kind(words, accept, rank=3)


def _is_traced(value: Any) -> bool:
    """Whether this is an array of another library than NumPy."""
    return hasattr(value, "__array_namespace__") and not isinstance(value, np.ndarray | np.generic)


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
    if array.dtype.kind == "O" and all(type(each) is int for each in array.flat):
        raise Refusal("has whole numbers of more than 64 bits; give smaller ones", SettingError)
    if array.dtype.kind not in kinds and array.size:
        raise Refusal(f"has values of type {array.dtype}; give {words}")
    return array if array.size else array.astype(np.float64 if "f" in kinds else np.int64)


def _check_numbers(values: Any, notes: tuple[Any, ...]) -> None:
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
    for each in notes:
        if isinstance(each, Within) and np.any(out := each.excludes(values)):
            first = values if np.ndim(values) == 0 else values[np.asarray(out)][0]
            wanted = each.instead_of(first, "numbers" if np.ndim(values) else "number")
            raise Refusal(f"{_worst(values, out)}; give {wanted}", SettingError)


def _worst(values: Any, out: Any) -> str:
    if np.ndim(values) == 0:
        return f"is {values:g}"
    first = tuple(int(each) for each in np.argwhere(out)[0])
    return f"is {values[first]:g} at {first[0] if len(first) == 1 else first}"


# Containers


def _sequence(item: Any, notes: tuple[Any, ...]) -> Kind:
    # A range is that of a number or of an array of numbers; entries beside the diagonal of a matrix have none.
    is_matrix = get_origin(item) in (tuple, Sequence)
    of = _kind(item, tuple(each for each in notes if not (is_matrix and isinstance(each, Within))))
    words = f"a list, each item {of.words}"

    def accept(value: Any) -> Any:
        # The rows of a matrix are items of their own where items are lists.
        listed = _list_values(value, words, most_axes=2 if of.rank > 1 else 1)
        items = [_at(of, each, f"[{position}]") for position, each in enumerate(listed)]
        unchanged = listed is value and all(new is old for new, old in zip(items, listed, strict=True))
        return value if unchanged else items if isinstance(listed, list) else tuple(items)

    return Kind(words, accept, rank=2)


def _iterable(item: Any) -> Kind:
    """Items of a container are checked, of a dict its keys; those of an iterator only come when it is used."""
    of = _kind(item, ())
    words = f"several values, each {of.words}"

    def accept(value: Any) -> Any:
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            raise OtherKind(value, words)
        if isinstance(value, list | tuple | set | frozenset | Mapping):
            return tuple(_at(of, each, f"[{position}]") for position, each in enumerate(value))
        return value

    return Kind(words, accept, rank=2)


def _tuple(items: tuple[Any, ...], notes: tuple[Any, ...]) -> Kind:
    if len(items) == 2 and items[1] is ...:
        of = _sequence(items[0], notes)
        return Kind(of.words, lambda value: tuple(of.accept(value)), rank=2)
    kinds = [_kind(each, notes) for each in items]
    words = f"{len(kinds)} values: {', '.join(each.words for each in kinds)}"

    def accept(value: Any) -> Any:
        listed = _list_values(value, words)
        if len(listed) != len(kinds):
            raise Refusal(f"has {len(listed)} values; give {words}")
        return tuple(
            _at(kind, each, f"[{position}]")
            for position, (kind, each) in enumerate(zip(kinds, listed, strict=True))
        )

    return Kind(words, accept, rank=2)


def _mapping(inner: tuple[Any, ...], notes: tuple[Any, ...]) -> Kind:
    names, values = (_kind(each, notes) for each in inner or (Any, Any))
    words = f"a dict, each value {values.words}"

    def accept(value: Any) -> Any:
        if not isinstance(value, Mapping):
            raise OtherKind(value, words)
        found = {
            _at(names, name, f" key {name!r}"): _at(values, each, f"[{name!r}]")
            for name, each in value.items()
        }
        return value if all(found[name] is value[name] for name in found) else found

    return Kind(words, accept, rank=2)


def _list_values(value: Any, words: str, most_axes: int = 1) -> Any:
    if isinstance(value, np.ndarray) and 1 <= value.ndim <= most_axes and not np.ma.is_masked(value):
        return value.tolist()
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise OtherKind(value, words)
    return value if isinstance(value, list | tuple) else tuple(value)


def _at(kind: Kind, value: Any, place: str) -> Any:
    try:
        return kind.accept(value)
    except Refusal as refusal:
        refusal.place = f"{place}{refusal.place}"
        raise


# Objects


def _object(kind: type) -> Kind:
    made = getattr(kind, "_made_by", "")
    words = (
        f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}{f', made by {made}' if made else ''}"
    )
    return Kind(words, partial(_instance, kind, words))


def _path(value: Any) -> Any:
    if not isinstance(value, os.PathLike) or not isinstance(os.fspath(value), str):
        raise OtherKind(value, "a path")
    return value


def _instance(kind: type, words: str, value: Any) -> Any:
    if not isinstance(value, kind):
        raise OtherKind(value, words)
    return value


def _function(takes: Any, returns: Any) -> Kind:
    """A function that can be called with so many arguments; no class where it is called for its effect alone."""
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


def _one_of(hints: tuple[Any, ...], notes: tuple[Any, ...]) -> Kind:
    kinds = [_kind(each, notes) for each in hints if each not in _ARRAY_LIKE]
    if set(hints) >= _ARRAY_LIKE:
        kinds.append(_array_like(notes))
    else:
        kinds = [_kind(each, notes) for each in hints]
    kinds.sort(key=lambda each: each.rank)
    words = " or ".join(each.words for each in kinds if each.words != "None")

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

    return Kind(words, accept, rank=max(each.rank for each in kinds))


_ARRAY_LIKE = frozenset(get_args(ArrayLike))
