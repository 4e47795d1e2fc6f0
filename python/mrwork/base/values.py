"""Data classes that hold arrays, with equality by value.

The equality that Python gives a data class asks an array whether it is true, which NumPy refuses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.numbers import counted
from mrwork.errors import InvalidSettingError

T = TypeVar("T")

Floats = NDArray[np.float64]
"""An array of numbers in double precision."""


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def array_dataclass(*, repr: bool = True) -> Callable[[type[T]], type[T]]:
    """Class decorator for a frozen, slotted, keyword-only dataclass that holds arrays.

    Two objects are equal if they have one class and their fields, those with `compare=False` excepted, are equal:
    arrays of one dtype and shape with equal numbers, where NaN equals NaN. The objects have no hash. Without `repr` the
    class has the one of its base.
    """

    def make_dataclass(kind: type[T]) -> type[T]:
        made = dataclass(frozen=True, slots=True, kw_only=True, repr=repr)(kind)
        for name, method in {"__eq__": _equal, "__hash__": None}.items():
            setattr(made, name, method)
        return made

    return make_dataclass


def keep_arrays(made: object, *names: str) -> None:
    """Replace arrays of these fields of a frozen data class by read-only copies, which the caller cannot change.

    An array that is read-only already is kept as it is.
    """
    for name in names:
        value = getattr(made, name)
        if isinstance(value, np.ndarray) and value.flags.writeable:
            copied = value.copy()
            copied.setflags(write=False)
            object.__setattr__(made, name, copied)


def _equal(self: Any, other: Any) -> Any:
    if type(other) is not type(self):
        return NotImplemented
    compared = (entry.name for entry in fields(self) if entry.compare)
    return all(_same(getattr(self, name), getattr(other, name)) for name in compared)


def _same(one: Any, other: Any) -> bool:
    if one is other:
        return True
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_same(one[name], other[name]) for name in one)
    if isinstance(one, list | tuple) and type(one) is type(other):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, float) and isinstance(other, float) and math.isnan(one):
        return math.isnan(other)
    equal = one == other
    # Arrays of JAX compare by their elements.
    return equal if isinstance(equal, bool) else bool(np.array_equal(one, other))


def freeze_samples(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Contiguous read-only copy of an array."""
    copy = np.array(samples, dtype=np.float64, order="C")
    copy.setflags(write=False)
    return copy


def one_for_each(name: str, given: ArrayLike | None, count: int, noun: str) -> Floats:
    """Numbers of several places, shape (count,): one for each, or one that holds for all."""
    numbers = np.asarray(given, dtype=np.float64)
    if numbers.shape not in ((), (count,)):
        raise InvalidSettingError(
            name,
            f"{name} has {counted(numbers.size, 'number')} for {counted(count, noun)}; give one for each, or one for "
            "all",
        )
    return np.broadcast_to(numbers, (count,)).copy()
