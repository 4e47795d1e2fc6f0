"""Typed values as JSON and back, and fingerprints of the inputs of a run with the differences between two.

Exact form, for journals (`plain`, `rebuilt`): reading restores the same bits. JSON has no infinity and no NaN, so these
are written as the strings "inf", "-inf" and "nan"; every other float as the shortest text that reads back as the same
number. Two-dimensional arrays are written as the bytes of their numbers in hexadecimal, in a tenth of the time.

Readable form, for the files of a run folder (`json_document`; `store/record.py` reads it): indented, strict JSON. A
number that is not finite is written as `null`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path, PurePath
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

T = TypeVar("T")

_HEX = "hex"
_LITTLE_ENDIAN = "<f8"


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


# Half of a SHA-256: two different inputs have the same digest with a probability of 1e-38.
_LENGTH = 32
_ABSENT = "absent"
_LONGEST = 40


def digest_of(*inputs: object) -> str:
    """Digest of values: of an array by its bytes, of others by their `repr`, which states every bit of a number."""
    digest = hashlib.sha256()
    for value in inputs:
        if isinstance(value, np.ndarray):
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        else:
            digest.update(repr(value).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:_LENGTH]


def package_version(name: str) -> str:
    """Version of an installed package; "unknown" if it is not installed."""
    return _installed().get(name) or _described(name)


@cache
def _installed() -> Mapping[str, str]:
    """Versions of the installed packages, from the names of their `dist-info` folders.

    `importlib.metadata` parses whole package descriptions instead, a tenth of a second for five packages.
    """
    found: dict[str, str] = {}
    for folder in sys.path:
        for path in Path(folder).glob("*-*.dist-info"):
            name, _, version = path.stem.partition("-")
            found.setdefault(name, version)
    return found


def _described(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def differences(recorded: Any, stated: Any, name: str = "") -> list[str]:
    """One phrase for each fact that differs, such as "seed is 1 there and 2 here"; nested names are joined by dots."""
    if isinstance(recorded, Mapping) and isinstance(stated, Mapping):
        names = [*recorded, *(key for key in stated if key not in recorded)]
        pairs = [(key, recorded.get(key, _ABSENT), stated.get(key, _ABSENT)) for key in names]
    elif isinstance(recorded, list) and isinstance(stated, list) and len(recorded) == len(stated):
        pairs = [(str(n), one, other) for n, (one, other) in enumerate(zip(recorded, stated, strict=True), 1)]
    else:
        return [] if recorded == stated else [f"{name} is {_shown(recorded)} there and {_shown(stated)} here"]
    return [
        phrase
        for key, one, other in pairs
        for phrase in differences(one, other, f"{name}.{key}" if name else key)
    ]


def _shown(value: Any) -> str:
    text = "none" if value is None else str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
