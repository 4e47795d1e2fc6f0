"""Wrong arguments made from right ones: of another kind, shape, length, size, range or name."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


class ValidCall(NamedTuple):
    """A function, and arguments that it takes."""

    function: Callable[..., object]
    arguments: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Of the function, the method or the class, or of the class of an object that is called."""
        return str(getattr(self.function, "__qualname__", type(self.function).__qualname__))


# A call is made when it is asked for.
Calls = Iterator[ValidCall]


def call(function: Callable[..., object], **arguments: Any) -> ValidCall:
    """A valid call with these arguments."""
    return ValidCall(function, arguments)


def calls_with(values: Mapping[str, Any], *functions: Callable[..., object]) -> Calls:
    """A valid call of each function, with those of the values that its parameters name."""
    for function in functions:
        names = inspect.signature(function).parameters
        yield ValidCall(function, {name: values[name] for name in names if name in values})


class Nothing:
    """Of no kind that a function takes."""


def wrong(value: Any) -> Iterator[tuple[str, Any]]:
    """Other values in the place of a right one, each with what it is; some of them may be right, too."""
    if inspect.isfunction(value):
        yield from (("nothing", Nothing()), ("a text", "x"), ("a number", 3))
        return
    yield from (
        ("nothing", Nothing()),
        ("None", None),
        ("a text", "x\x1b\n"),
        ("a class", int),
        ("bytes", b"x"),
    )
    if isinstance(value, bool):
        yield from (("a number", 1), ("an array", np.array([True, False])))
    elif isinstance(value, int | float):
        yield from _numbers(value)
    elif isinstance(value, str):
        yield from (
            ("empty", ""),
            ("long", "x" * 300),
            ("a number", 3),
            ("a list", [value]),
            ("upper", value.upper()),
        )
    elif isinstance(value, np.ndarray) and value.ndim:
        yield from _arrays(value)
    elif isinstance(value, Mapping):
        yield from _mappings(value)
    elif isinstance(value, list | tuple):
        yield from _lists(value)
    elif isinstance(value, os.PathLike):
        yield from (
            ("a folder", Path(value).parent),
            ("absent", f"{value}.none"),
            ("NUL", "a\0b"),
            ("empty", ""),
        )
    elif is_dataclass(value):
        yield from (("its class", type(value)), ("several", [value, value]), ("a number", 3.0))


def _numbers(value: float) -> Iterator[tuple[str, Any]]:
    for number in (
        -value,
        0,
        1,
        -1,
        0.5,
        1e308,
        -1e308,
        1e-100,
        np.nan,
        np.inf,
        -np.inf,
        1j,
        True,
        2**70,
        10**400,
    ):
        yield str(number)[:20], number
    yield "0-d", np.array(value)
    yield "1-d", np.array([value])
    yield "2-d", np.array([[value, value]])
    yield "a date", np.datetime64("2020-01-01")


def _arrays(value: np.ndarray) -> Iterator[tuple[str, Any]]:
    yield "empty", value[:0]
    yield "0-d", np.array(value.flat[0])
    yield "a number", float(value.flat[0])
    yield "shorter", value[:-1]
    yield "longer", np.concatenate([value, value[-1:]])
    yield "one", value[:1]
    yield "one more axis", value[None]
    yield "a further axis", value[..., None]
    if value.ndim > 1:
        yield "transposed", value.T
        yield "flat", value.ravel()
        yield "fewer columns", value[..., :-1]
        yield "more columns", np.concatenate([value, value[..., -1:]], axis=-1)
    for number in (np.nan, np.inf, -1.0, 0.0, 1e308, -1e308, 1e-100):
        one = np.array(value, dtype=np.float64)
        one.flat[-1] = number
        yield f"{number} at an end", one
        yield f"all {number}", np.full(value.shape, number)
    yield "masked", np.ma.masked_array(value, np.arange(value.size).reshape(value.shape) == 0)
    yield "texts", value.astype(str)
    yield "objects", np.full(value.shape, None, dtype=object)
    yield "complex", value + 1j
    yield "dates", np.zeros(value.shape, dtype="M8[s]")
    yield "truths", value > 0
    yield "ragged", [[1.0], [1.0, 2.0]]
    yield "a list", value.tolist()
    yield "every other", np.repeat(value, 2, axis=-1)[..., ::2]
    yield "whole numbers", value.astype(np.int32)


def _mappings(value: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    yield "empty", {}
    yield "a list", list(value.items())
    yield "another name", {**value, "no such\n": next(iter(value.values()), 1.0)}
    yield "a name that is no text", {3: 1.0}
    for key, own in list(value.items())[:2]:
        for label, other in wrong(own):
            yield f"{label} for {key}", {**value, key: other}


def _lists(value: Any) -> Iterator[tuple[str, Any]]:
    kind = type(value)
    yield "empty", kind()
    yield "twice", value + value
    yield "fewer", value[:-1]
    yield "reversed", value[::-1]
    yield "nested", kind([value])
    yield "a set", {3}
    yield "an iterator", iter(value)
    for label, other in wrong(value[-1]) if value else ():
        yield f"{label} at the end", kind([*value[:-1], other])


def smallest(value: Any) -> Iterator[tuple[str, Any]]:
    """The value with numbers in it whose inverses or squares are not finite."""
    for number in (1e-100, 1e-160, 5e-324, 0.0):
        for place, other in _with_number(value, number):
            yield f"{number} {place}", other


def _with_number(value: Any, number: float) -> Iterator[tuple[str, Any]]:
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield "itself", number
    elif isinstance(value, np.ndarray) and value.size and value.dtype.kind in "fiu":
        last = np.array(value, dtype=np.float64)
        last.flat[-1] = number
        yield "at an end", last
        yield "everywhere", np.full(value.shape, number)
    elif isinstance(value, Mapping):
        for key, own in value.items():
            for place, other in _with_number(own, number):
                yield f"{place} of {key!r}", {**value, key: other}
    elif isinstance(value, list | tuple) and value:
        for place, other in _with_number(value[-1], number):
            yield f"{place} of the last", type(value)([*value[:-1], other])
