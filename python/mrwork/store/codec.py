"""Typed values as JSON and back, and fingerprints of the inputs of a run with the differences between two.

Exact form, for journals (`plain`, `rebuilt`): reading restores the same bits. JSON has no infinity and no NaN, so these
are written as the strings "inf", "-inf" and "nan"; every other float as the shortest text that reads back as the same
number. Two-dimensional arrays are written as the bytes of their numbers in hexadecimal, in a tenth of the time.

Readable form, for the files of a run folder (`json_document`): indented, strict JSON. A number that is not finite is
written as `null`. It is read back (`record_of`) as values that the annotation of each field permits:
`Annotated[float, Within(least=0.0)]` is a range, `OrNan` and `OrInfinite` are what `null` stands for. A number without
such a note must be there and be finite. A dataclass whose fields must agree with each other inherits `Related`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache
from pathlib import Path, PurePath
from types import NoneType
from typing import Annotated, Any, TypeVar, cast

import numpy as np

from mrwork.base import hints as nodes
from mrwork.base.hints import LARGEST, May, Node, Notes, Within, fields_of, node_of
from mrwork.errors import MrworkError, RecordError, escape_text
from mrwork.store.input_file import is_there, make_stored_kind, text_of
from mrwork.store.parse import json_value

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
    known = fields_of(kind)
    return kind(**{name: _entry(known[name], value) for name, value in record.items()})


def array_of(numbers: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Inverse of `plain` for an array of float64."""
    if isinstance(numbers, Mapping):
        table = np.frombuffer(bytes.fromhex(numbers[_HEX]), dtype=_LITTLE_ENDIAN)
        return table.astype(np.float64).reshape(numbers["shape"])
    return np.array(_floats(numbers), dtype=np.float64)


def _entry(node: Node, value: Any) -> Any:
    match node:
        case nodes.Array(scalar):
            return array_of(value) if scalar is np.float64 else np.array(value, dtype=scalar)
        case nodes.Scalar(kind) if kind is float:
            return float(value)
        case nodes.Scalar(kind) if kind in _ARTICLES and type(value) is not kind:
            raise TypeError(f"{str(value)[:40]!r} where {kind.__name__} was expected")
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
# Characters of a value in a message.
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
    if listed := _list_installed().get(name):
        return listed
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


@cache
def _list_installed() -> Mapping[str, str]:
    """Versions of the installed packages, from the names of their `dist-info` folders.

    `importlib.metadata` parses whole package descriptions instead, a tenth of a second for five packages.
    """
    versions: dict[str, str] = {}
    for folder in sys.path:
        for path in Path(folder).glob("*-*.dist-info"):
            name, _, version = path.stem.partition("-")
            versions.setdefault(name, version)
    return versions


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
    return _cut_text("none" if value is None else str(value))


@dataclass(frozen=True, slots=True)
class Null:
    """What `null` stands for in a field."""

    number: float


@dataclass(frozen=True, slots=True)
class OneOf:
    """Names that a text may be, where a list elsewhere has them."""

    names: tuple[str, ...]


OrNan = Annotated[float, May.BE_NAN, May.BE_INFINITE, Null(math.nan)]
OrInfinite = Annotated[float, May.BE_INFINITE, Null(math.inf)]
LowerBound = Annotated[float, May.BE_INFINITE, Null(-math.inf)]
UpperBound = OrInfinite


class Related(ABC):
    """A record whose fields must agree with each other."""

    __slots__ = ()

    @abstractmethod
    def disagreement(self) -> str:
        """What contradicts what, such as "it has 2 scores for 3 tests"; empty where all agree."""


_ARTICLES = {int: "an integer", str: "a string", bool: "true or false"}


def record_from_json(kind: type[T], text: str, *, origin: str, name: str, verb: str) -> T:
    """Read a dataclass of type `kind` from a document that `json_document` has written.

    For messages: `origin` is the path of the document, `name` that of such a record, and `verb` of `mrwork` writes it.
    """
    record: T = record_of(
        kind, parse_document(text, origin=origin, verb=verb), origin=origin, name=name, verb=verb
    )
    return record


def parse_document(text: str, *, origin: str, verb: str) -> Any:
    """The value of a JSON document; `origin` and `verb` as for `record_from_json`."""
    try:
        return json_value(text)
    except ValueError as reason:
        raise RecordError(f"{origin} is not JSON ({reason}); run `mrwork {verb}` again") from None


def record_of(kind: Any, document: Any, *, origin: str, name: str, verb: str) -> Any:
    """A value of the annotation `kind` from the value of a JSON document, as `record_from_json`."""
    try:
        return build_value(kind, document, name)
    except MismatchError as reason:
        sentence = f"{origin} is not a {name}: {reason}; run `mrwork {verb}` again"
        raise RecordError(escape_text(sentence)) from None


def read_document(kind: type[T], path: Path, *, name: str, verb: str) -> T | None:
    """Read the record in the file at `path` as `record_from_json` does; `None` if there is no such file."""
    file = make_stored_kind(verb, name=f"a {name}")
    if not is_there(path, file):
        return None
    return record_from_json(kind, text_of(path, file), origin=str(path), name=name, verb=verb)


class MismatchError(ValueError):
    """A value that its field cannot have; the message names the field and what was expected."""


def build_value(kind: Any, value: Any, place: str) -> Any:
    """`value` as an instance of the annotation `kind`; `place` is its path in the document."""
    return _build_value(node_of(kind), value, place)


def _build_value(node: Node, value: Any, place: str) -> Any:
    match node:
        case nodes.Record(kind):
            return _build_record(kind, value, place)
        case nodes.Enumerated(choices):
            return _require(value in choices, value, place, " or ".join(map(repr, choices)))
        case nodes.Either():
            return _build_member(node, value, place)
        case nodes.Fixed():
            return _build_tuple(node, value, place)
        case nodes.Array():
            _require(isinstance(value, list | tuple), value, place, "a list of numbers")
            pairs = enumerate(value)
            return np.array([_number(each, f"{place}[{index}]", node.notes) for index, each in pairs])
        case nodes.ByName(_, (name, inner)):
            _require(isinstance(value, Mapping), value, place, "an object")
            return {
                _build_value(name, key, f"{place}, a key"): _build_value(
                    inner, entry, f"{place}.{_cut_text(key)}"
                )
                for key, entry in value.items()
            }
        case nodes.Scalar(kind) if kind is float:
            return _number(value, place, node.notes)
        case nodes.Scalar(kind) | nodes.Instance(kind):
            return _plain_value(kind, node.notes, value, place)
    return value


def _plain_value(kind: type, notes: Notes, value: Any, place: str) -> Any:
    # Python counts True among the integers, JSON does not.
    fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    _require(fits, value, place, _ARTICLES.get(kind, kind.__name__))
    for note in notes:
        if isinstance(note, Within):
            _require(not note.excludes(value), value, place, note.instead_of(value, "whole number"))
        if isinstance(note, OneOf):
            _require(value in note.names, value, place, " or ".join(map(repr, note.names)))
    return value


def _build_record(kind: type, value: Any, place: str) -> Any:
    _require(isinstance(value, Mapping), value, place, "an object")
    declared, known = fields_of(kind), fields(cast(Any, kind))
    names = [field.name for field in known if field.name in value]
    # A field that has a default may be newer than the document.
    missing = [
        field.name
        for field in known
        if field.name not in value and field.default is MISSING and field.default_factory is MISSING
    ]
    if missing:
        raise MismatchError(f"`{place}` lacks {', '.join(missing)}")
    values = {name: _build_value(declared[name], value[name], f"{place}.{name}") for name in names}
    try:
        record = kind(**values)
        damage = record.disagreement() if isinstance(record, Related) else ""
    except (MrworkError, ValueError) as reason:
        # What is wrong, without the remedy, which is another one for a file that a verb has written.
        raise MismatchError(f"`{place}` is impossible: {str(reason).partition(';')[0]}") from None
    if damage:
        raise MismatchError(f"`{place}` contradicts itself: {damage}")
    return record


def _build_member(node: Node, value: Any, place: str) -> Any:
    if value is None and node.kind is NoneType:
        return None
    for member in node.parts[:-1]:
        try:
            return _build_value(member, value, place)
        except MismatchError:
            continue
    return _build_value(node.parts[-1], value, place)


def _build_tuple(node: nodes.Fixed, value: Any, place: str) -> tuple[Any, ...]:
    _require(isinstance(value, list | tuple), value, place, "a list")
    kinds = node.of(len(value))
    _require(len(kinds) == len(value), value, place, f"a list of {len(kinds)}")
    pairs = zip(kinds, value, strict=True)
    return tuple(_build_value(kind, entry, f"{place}[{index}]") for index, (kind, entry) in enumerate(pairs))


def _number(value: Any, place: str, notes: Notes) -> float:
    if value is None:
        for note in notes:
            if isinstance(note, Null):
                return note.number
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    _require(is_number, value, place, "a number")
    may_be_larger = May.BE_NAN in notes if value != value else May.BE_INFINITE in notes
    _require(abs(value) <= LARGEST or may_be_larger, value, place, f"a number below {LARGEST:g} in size")
    for note in notes:
        if isinstance(note, Within):
            _require(not note.excludes(value), value, place, note.instead_of(value))
    # An integer of hundreds of digits is beyond any float.
    return (
        float(value) if abs(value) <= LARGEST or isinstance(value, float) else math.copysign(math.inf, value)
    )


def _require(condition: bool, value: Any, place: str, expected: str) -> Any:
    if not condition:
        raise MismatchError(f"`{place}` should be {expected}, it is {_cut_text(repr(value))}")
    return value


def _cut_text(text: str) -> str:
    return f"{text[:_LONGEST]}…" if len(text) > _LONGEST else text
