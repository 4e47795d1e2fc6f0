"""Typed values as JSON and back, and fingerprints of the inputs of a run with the differences between two.

Reading (`built`) restores the same bits. JSON has no infinity and no NaN, so these are written as the strings "inf",
"-inf" and "nan"; every other float as the shortest text that reads back as the same number. Journals (`plain`) have
two-dimensional arrays as the bytes of their numbers in hexadecimal, in a tenth of the time; the files of a run folder
(`json_document`) are indented.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import sys
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from mrwork.base.hints import Hint, node_of, nodes_of

_HEX = "hex"
_LITTLE_ENDIAN = "<f8"


def plain(value: object, *, packs: bool = True, lacking: Callable[[float], object] = repr) -> Any:
    """Exact JSON form of a value: dataclasses and mappings as objects, arrays and sequences as lists.

    `packs`: whether an array of several dimensions is the text of its bytes. `lacking` is the form of a number that
    JSON does not have.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        if packs and value.ndim > 1:
            return {"shape": value.shape, _HEX: value.astype(_LITTLE_ENDIAN).tobytes().hex()}
        if np.isfinite(value).all():
            return value.tolist()
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else lacking(value)
    if isinstance(value, int | str | None):
        return value
    part = partial(plain, packs=packs, lacking=lacking)
    if isinstance(value, Mapping):
        return {str(key): part(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [part(entry) for entry in value]
    if dataclasses.is_dataclass(value):
        return {field.name: part(getattr(value, field.name)) for field in dataclasses.fields(value)}
    return str(value) if isinstance(value, PurePath) else repr(value)


def array_of(numbers: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Inverse of `plain` for an array of float64."""
    if isinstance(numbers, Mapping):
        table = np.frombuffer(bytes.fromhex(numbers[_HEX]), dtype=_LITTLE_ENDIAN)
        return table.astype(np.float64).reshape(numbers["shape"])
    # NumPy reads the texts of numbers that JSON lacks.
    return np.array(numbers, dtype=np.float64)


def built(kind: Any, value: Any) -> Any:
    """A value of the annotation `kind` from its JSON form, which this package has written: nothing is checked.

    Keys that a dataclass does not have are left out. Raises whatever a value of another form leads to.
    """
    match node := kind if isinstance(kind, Hint) else node_of(kind):
        case _ if value is None:
            return None
        case Hint("record", kind):
            fields = nodes_of(kind)
            return kind(
                **{name: built(fields[name], entry) for name, entry in value.items() if name in fields}
            )
        case Hint("either"):
            return built(next(part for part in node.parts if _takes(part, value)), value)
        case Hint("items", _, (item,)):
            return tuple(built(item, entry) for entry in value)
        case Hint("fixed"):
            return tuple(map(built, node.parts, value))
        case Hint("by_name", _, (name, inner)):
            return {built(name, key): built(inner, entry) for key, entry in value.items()}
        case Hint("array", scalar) if scalar in (None, np.float64):
            return array_of(value)
        case Hint("array", scalar):
            return np.array(value, dtype=scalar)
        case Hint("scalar", kind) if kind in (int, float):
            return kind(value)
    return value


def _takes(node: Hint, value: Any) -> bool:
    match node:
        case Hint("record", kind):
            return isinstance(value, Mapping) and value.keys() <= nodes_of(kind).keys()
        case Hint("by_name"):
            return isinstance(value, Mapping)
        case Hint("array" | "fixed" | "items"):
            return isinstance(value, list | tuple) or (isinstance(value, Mapping) and _HEX in value)
        case Hint("enumerated", choices):
            return value in choices
        case Hint("scalar", kind) if kind is float:
            return isinstance(value, int | float) or value in ("nan", "inf", "-inf")
        case Hint("scalar", kind):
            return isinstance(value, kind)
    return True


def json_document(value: object) -> str:
    """Readable JSON form of a value for a file, indented; numbers that JSON lacks are "nan", "inf" and "-inf"."""
    return json.dumps(plain(value, packs=False), allow_nan=False, ensure_ascii=False, indent=2) + "\n"


_ABSENT = "absent"
# Characters of a value in a message.
_LONGEST_SHOWN = 40


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
    # Half of it: two different inputs have the same digest with a probability of 1e-38.
    return digest.hexdigest()[:32]


@cache
def package_version(name: str) -> str:
    """Version of an installed package by the name of its folder; "unknown" if it is not installed."""
    # `importlib.metadata` takes 40 ms more.
    pattern = f"{name.replace('-', '_')}-*.dist-info"
    folders = (path.stem for entry in sys.path for path in Path(entry).glob(pattern))
    return next(folders, "-unknown").partition("-")[2]


def differences(recorded: Any, stated: Any, name: str = "") -> list[str]:
    """One phrase for each fact that differs, such as "seed is 1 there and 2 here"; nested names are joined by dots."""
    if isinstance(recorded, Mapping) and isinstance(stated, Mapping):
        names = [*recorded, *(key for key in stated if key not in recorded)]
        pairs = [(key, recorded.get(key, _ABSENT), stated.get(key, _ABSENT)) for key in names]
    elif isinstance(recorded, list) and isinstance(stated, list) and len(recorded) == len(stated):
        pairs = [(str(n), one, other) for n, (one, other) in enumerate(zip(recorded, stated, strict=True), 1)]
    elif recorded == stated:
        return []
    else:
        return [f"{name} is {_shorten_value(recorded)} there and {_shorten_value(stated)} here"]
    return [
        phrase
        for key, one, other in pairs
        for phrase in differences(one, other, f"{name}.{key}" if name else key)
    ]


def _shorten_value(value: Any) -> str:
    text = "none" if value is None else str(value)
    return f"{text[:_LONGEST_SHOWN]}…" if len(text) > _LONGEST_SHOWN else text
