"""Conversion of typed values to JSON and back, in two forms.

Exact form, for journals (`plain`, `rebuilt`): reading restores the same bits. JSON has no infinity and no NaN, so these
are written as the strings "inf", "-inf" and "nan"; every other float as the shortest text that reads back as the same
number. Two-dimensional arrays are written as the bytes of their numbers in hexadecimal, in a tenth of the time.

Readable form, for the files of a run folder (`json_document`, `record_from_json`): indented, strict JSON. A number that
is not finite is written as `null`. It is read as infinity in the fields where only that can have been meant (an absent
bound, the misfit of a diverged population), and as NaN elsewhere.
"""

from __future__ import annotations

import dataclasses
import json
import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path, PurePath
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from mrwork.errors import RecordError
from mrwork.store.input_file import is_there, stored, text_of
from mrwork.store.parse import json_value

T = TypeVar("T")

_HEX = "hex"
_LITTLE_ENDIAN = "<f8"
_ARTICLES = {int: "an integer", str: "a string"}
_WHERE_NULL = {"lower": -math.inf, "upper": math.inf, "best": math.inf, "median": math.inf, "ends": math.inf}

# Words of earlier versions, by the name of their field.
_FORMER_WORDS = {"verdict": {"weakly": "weakly identifiable", "not": "not identifiable"}}


def plain(value: object) -> Any:
    """Exact JSON form of a value: dataclasses and mappings as objects, arrays and sequences as lists."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        if value.ndim > 1:
            return {"shape": value.shape, _HEX: value.astype(_LITTLE_ENDIAN).tobytes().hex()}
        if np.isfinite(value).all():
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
    """Inverse of `plain` for a dataclass of numbers, flags and arrays of them."""
    hints = get_type_hints(kind)
    return kind(**{name: _entry(hints[name], value) for name, value in record.items()})


def array_of(numbers: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Inverse of `plain` for an array of float64."""
    if isinstance(numbers, Mapping):
        table = np.frombuffer(bytes.fromhex(numbers[_HEX]), dtype=_LITTLE_ENDIAN)
        return table.astype(np.float64).reshape(numbers["shape"])
    return np.array(_floats(numbers), dtype=np.float64)


def _entry(hint: Any, value: Any) -> Any:
    if get_origin(hint) is np.ndarray:
        # NDArray[T] is ndarray[shape, dtype[T]].
        (kind,) = get_args(get_args(hint)[1])
        return array_of(value) if kind is np.float64 else np.array(value, dtype=kind)
    if hint is float:
        return float(value)
    if hint in (bool, int, str) and type(value) is not hint:
        raise TypeError(f"{str(value)[:40]!r} where {hint.__name__} was expected")
    return value


def _floats(value: Any) -> Any:
    return [_floats(entry) for entry in value] if isinstance(value, list) else float(value)


def json_document(value: object) -> str:
    """Readable JSON form of a value, indented; numbers that are not finite become `null`."""
    return json.dumps(finite(value), allow_nan=False, ensure_ascii=False, indent=2) + "\n"


def record_from_json(kind: type[T], text: str, *, origin: str, name: str, verb: str) -> T:
    """Read a dataclass of type `kind` that `json_document` has written.

    Parameters
    ----------
    kind
        Type of the record.
    text
        The document.
    origin, name, verb
        For messages: path of the document, name of such a record, and the verb of `mrwork` that writes it.

    Raises
    ------
    RecordError
        If the text is not JSON or not such a record; the message names the field.
    """
    try:
        document = json_value(text)
    except ValueError as reason:
        raise RecordError(f"{origin} is not JSON ({reason}); run `mrwork {verb}` again") from None
    try:
        return cast(T, _built(kind, document, name))
    except _MismatchError as reason:
        raise RecordError(f"{origin} is not a {name}: {reason}; run `mrwork {verb}` again") from None


def read_document(kind: type[T], path: Path, *, name: str, verb: str) -> T | None:
    """Read the record in the file at `path` as `record_from_json` does; `None` if there is no such file."""
    file = stored(verb, name=f"a {name}")
    if not is_there(path, file):
        return None
    return record_from_json(kind, text_of(path, file), origin=str(path), name=name, verb=verb)


class _MismatchError(Exception):
    """A value of another type than its field; the message names the field and the expected type."""


def finite(value: object) -> Any:
    """`value` with `None` in place of numbers that are not finite, which JSON cannot hold."""
    if isinstance(value, np.generic | np.ndarray):
        return finite(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    return str(value) if isinstance(value, PurePath) else value


def _built(kind: Any, value: Any, place: str) -> Any:
    """`value` as an instance of the annotation `kind`; `place` is its path in the document."""
    if is_dataclass(kind):
        return _built_record(cast(type, kind), value, place)
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin is Literal:
        if isinstance(value, str):
            value = _FORMER_WORDS.get(place.rpartition(".")[2], {}).get(value, value)
        return _accepted(value in arguments, value, place, " or ".join(map(repr, arguments)))
    if origin in (Union, types.UnionType):
        inner = next(argument for argument in arguments if argument is not type(None))
        return None if value is None else _built(inner, value, place)
    if origin is tuple:
        _accepted(isinstance(value, list), value, place, "a list")
        return tuple(_built(arguments[0], entry, f"{place}[{index}]") for index, entry in enumerate(value))
    if origin is np.ndarray:
        _accepted(isinstance(value, list), value, place, "a list of numbers")
        return np.array([_built_float(entry, f"{place}[{index}]") for index, entry in enumerate(value)])
    if origin is dict:
        _accepted(isinstance(value, dict), value, place, "an object")
        return {key: _built(arguments[1], entry, f"{place}.{key}") for key, entry in value.items()}
    if kind is float:
        return _built_float(value, place)
    # Python counts True among the integers, JSON does not.
    fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    return _accepted(fits, value, place, _ARTICLES.get(kind, kind.__name__))


def _built_record(kind: type, value: Any, place: str) -> Any:
    _accepted(isinstance(value, dict), value, place, "an object")
    hints = get_type_hints(kind)
    known = fields(kind)
    names = [field.name for field in known if field.name in value]
    # A field that has a default may be newer than the document.
    missing = [
        field.name
        for field in known
        if field.name not in value and field.default is MISSING and field.default_factory is MISSING
    ]
    if missing:
        raise _MismatchError(f"`{place}` lacks {', '.join(missing)}")
    return kind(**{name: _built(hints[name], value[name], f"{place}.{name}") for name in names})


def _built_float(value: Any, place: str) -> float:
    if value is None:
        field = place.rpartition(".")[2].partition("[")[0]
        return _WHERE_NULL.get(field, math.nan)
    _accepted(isinstance(value, int | float) and not isinstance(value, bool), value, place, "a number")
    _accepted(math.isfinite(value), value, place, "a finite number")
    return float(value)


def _accepted(condition: bool, value: Any, place: str, expected: str) -> Any:
    if not condition:
        shown = repr(value)
        raise _MismatchError(
            f"`{place}` should be {expected}, it is {shown[:40]}{'…' if len(shown) > 40 else ''}"
        )
    return value
