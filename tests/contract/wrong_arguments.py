"""Wrong arguments made from right ones: of another kind, shape, length, size, range or name."""

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


def call(function: Callable[..., object], /, **arguments: Any) -> ValidCall:
    """A valid call with these arguments."""
    return ValidCall(function, arguments)


def calls_with(values: Mapping[str, Any], *functions: Callable[..., object]) -> Calls:
    """A valid call of each function, with those of the values that its parameters name."""
    for function in functions:
        names = inspect.signature(function).parameters
        yield ValidCall(function, {name: values[name] for name in names if name in values})


class Nothing:
    """Of no kind that a function takes."""


def wrong(value: Any) -> Iterator[Any]:
    """Other values in the place of a right one; some of them may be right, too."""
    yield from (Nothing(), "x\x1b\n")
    if inspect.isfunction(value):
        yield 3
        return
    yield from (None, int, b"x")
    if isinstance(value, bool):
        yield np.array([True, False])
    elif isinstance(value, int | float):
        yield from (-value, 0, -1, 0.5, 1e308, 5e-324, np.nan, np.inf, 1j, True, 2**70, 10**400)
        yield from (np.array(value), np.array([[value, value]]), np.datetime64("2020-01-01"))
    elif isinstance(value, str):
        yield from ("", "x" * 300, 3, [value], value.upper())
    elif isinstance(value, np.ndarray) and value.ndim:
        yield from _arrays(value)
    elif isinstance(value, Mapping):
        yield from ({}, list(value.items()), {3: 1.0})
        yield {**value, "no such\n": next(iter(value.values()), 1.0)}
        for key, own in list(value.items())[:2]:
            yield from ({**value, key: other} for other in wrong(own))
    elif isinstance(value, list | tuple):
        kind = type(value)
        yield from (kind(), value + value, value[:-1], value[::-1], kind([value]), {3})
        yield from (kind([*value[:-1], other]) for other in (wrong(value[-1]) if value else ()))
    elif isinstance(value, os.PathLike):
        yield from (Path(value).parent, f"{value}.none", "")
    elif is_dataclass(value):
        yield from (type(value), [value, value], 3.0)


def _arrays(value: np.ndarray) -> Iterator[Any]:
    yield from (value[:0], np.array(value.flat[0]), float(value.flat[0]), value[:-1], value[:1])
    yield from (np.concatenate([value, value[-1:]]), value[None], value[..., None])
    if value.ndim > 1:
        yield from (value.T, value.ravel(), value[..., :-1])
        yield np.concatenate([value, value[..., -1:]], axis=-1)
    for number in (np.nan, np.inf, -1.0, 0.0, 1e308, 5e-324):
        one = np.array(value, dtype=np.float64)
        one.flat[-1] = number
        yield from (one, np.full(value.shape, number))
    yield np.ma.masked_array(value, np.arange(value.size).reshape(value.shape) == 0)
    yield from (value.astype(str), np.full(value.shape, None, dtype=object), value + 1j, value > 0)
    yield from (np.zeros(value.shape, dtype="M8[s]"), [[1.0], [1.0, 2.0]], value.tolist())
    yield from (np.repeat(value, 2, axis=-1)[..., ::2], value.astype(np.int32))
