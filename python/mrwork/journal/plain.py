"""Values as JSON and back, to the same bits.

JSON has no infinity and no NaN, so these are written as strings, "inf", "-inf", "nan"; every other float as the
shortest text that reads back as the same number.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, TypeVar, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")


def plain(value: object) -> Any:
    """`value` in terms of JSON: dataclasses and mappings as objects, arrays and sequences as lists."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isfinite(value).all():
        return value.tolist()
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else repr(value)
    if isinstance(value, int | str | None):
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if dataclasses.is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return repr(value)


def rebuilt(kind: type[T], record: Mapping[str, Any]) -> T:
    """Undo `plain` for a dataclass of numbers, flags and arrays of float64."""
    hints = get_type_hints(kind)
    return kind(**{name: _entry(hints[name], value) for name, value in record.items()})


def array_of(numbers: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Undo `plain` for an array of float64."""
    return np.array(_floats(numbers), dtype=np.float64)


def _entry(hint: Any, value: Any) -> Any:
    if get_origin(hint) is np.ndarray:
        return array_of(value)
    return float(value) if hint is float else value


def _floats(value: Any) -> Any:
    return [_floats(entry) for entry in value] if isinstance(value, list) else float(value)
