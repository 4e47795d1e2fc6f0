"""Records of a run folder, read back: every value is one that the annotation of its field permits.

A field of a dataclass says by its annotation what a file may hold: `Annotated[float, Within(least=0.0)]` a range,
`OrNan` and `OrInfinite` what `null` stands for. A number without such a note must be there and be finite. A dataclass
whose fields must agree with each other inherits `Related`.
"""

from __future__ import annotations

import math
import types
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from mrwork.arguments import May
from mrwork.errors import MrworkError, RecordError
from mrwork.escaping import escaped
from mrwork.keys import LARGEST, Within
from mrwork.store.input_file import is_there, stored, text_of
from mrwork.store.parse import json_value

T = TypeVar("T")


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


_SHOWN = 40
_ARTICLES = {int: "an integer", str: "a string", bool: "true or false"}

# Words of earlier versions, by the name of their field.
_FORMER_WORDS = {"verdict": {"weakly": "weakly identifiable", "not": "not identifiable"}}


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
    found: T = record_of(kind, parsed(text, origin=origin, verb=verb), origin=origin, name=name, verb=verb)
    return found


def parsed(text: str, *, origin: str, verb: str) -> Any:
    """The value of a JSON document; `origin` and `verb` as for `record_from_json`.

    Raises
    ------
    RecordError
        If the text is not JSON.
    """
    try:
        return json_value(text)
    except ValueError as reason:
        raise RecordError(f"{origin} is not JSON ({reason}); run `mrwork {verb}` again") from None


def record_of(kind: Any, document: Any, *, origin: str, name: str, verb: str) -> Any:
    """A value of the annotation `kind` from the value of a JSON document, as `record_from_json`.

    Raises
    ------
    RecordError
        If it is not such a value.
    """
    try:
        return built(kind, document, name)
    except MismatchError as reason:
        sentence = f"{origin} is not a {name}: {reason}; run `mrwork {verb}` again"
        raise RecordError(escaped(sentence)) from None


def read_document(kind: type[T], path: Path, *, name: str, verb: str) -> T | None:
    """Read the record in the file at `path` as `record_from_json` does; `None` if there is no such file."""
    file = stored(verb, name=f"a {name}")
    if not is_there(path, file):
        return None
    return record_from_json(kind, text_of(path, file), origin=str(path), name=name, verb=verb)


class MismatchError(ValueError):
    """A value that its field cannot have; the message names the field and what was expected."""


def built(kind: Any, value: Any, place: str) -> Any:
    """`value` as an instance of the annotation `kind`; `place` is its path in the document.

    Raises
    ------
    MismatchError
        If it cannot be one.
    """
    return _built(kind, value, place, ())


def _built(kind: Any, value: Any, place: str, notes: tuple[Any, ...]) -> Any:
    if is_dataclass(kind):
        return _built_record(cast(type, kind), value, place)
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin is Annotated:
        return _built(inner[0], value, place, (*notes, *inner[1:]))
    if origin is Literal:
        if isinstance(value, str):
            value = _FORMER_WORDS.get(place.rpartition(".")[2], {}).get(value, value)
        return _accepted(value in inner, value, place, " or ".join(map(repr, inner)))
    if origin in (Union, types.UnionType):
        return _built_member(inner, value, place, notes)
    if origin is tuple:
        return _built_tuple(inner, value, place, notes)
    if origin is np.ndarray:
        _accepted(isinstance(value, list | tuple), value, place, "a list of numbers")
        return np.array([_number(entry, f"{place}[{index}]", notes) for index, entry in enumerate(value)])
    if isinstance(origin, type) and issubclass(origin, Mapping):
        _accepted(isinstance(value, Mapping), value, place, "an object")
        return {
            _built(inner[0], key, f"{place}, a key", ()): _built(
                inner[1], entry, f"{place}.{_cut(key)}", notes
            )
            for key, entry in value.items()
        }
    if kind is float:
        return _number(value, place, notes)
    # Python counts True among the integers, JSON does not.
    fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
    _accepted(fits, value, place, _ARTICLES.get(kind, kind.__name__))
    for note in notes:
        if isinstance(note, Within):
            _accepted(not note.excludes(value), value, place, note.instead_of(value, "whole number"))
        if isinstance(note, OneOf):
            _accepted(value in note.names, value, place, " or ".join(map(repr, note.names)))
    return value


def _built_record(kind: type, value: Any, place: str) -> Any:
    _accepted(isinstance(value, Mapping), value, place, "an object")
    hints = get_type_hints(kind, include_extras=True)
    known = fields(kind)
    names = [field.name for field in known if field.name in value]
    # A field that has a default may be newer than the document.
    missing = [
        field.name
        for field in known
        if field.name not in value and field.default is MISSING and field.default_factory is MISSING
    ]
    if missing:
        raise MismatchError(f"`{place}` lacks {', '.join(missing)}")
    values = {name: _built(hints[name], value[name], f"{place}.{name}", ()) for name in names}
    try:
        record = kind(**values)
        damage = record.disagreement() if isinstance(record, Related) else ""
    except (MrworkError, ValueError) as reason:
        raise MismatchError(f"`{place}` is impossible: {_first_clause(reason)}") from None
    if damage:
        raise MismatchError(f"`{place}` contradicts itself: {damage}")
    return record


def _built_member(inner: tuple[Any, ...], value: Any, place: str, notes: tuple[Any, ...]) -> Any:
    """A value of one of the members of a union."""
    if value is None and types.NoneType in inner:
        return None
    members = [member for member in inner if member is not types.NoneType]
    for member in members[:-1]:
        try:
            return _built(member, value, place, notes)
        except MismatchError:
            continue
    return _built(members[-1], value, place, notes)


def _built_tuple(inner: tuple[Any, ...], value: Any, place: str, notes: tuple[Any, ...]) -> tuple[Any, ...]:
    _accepted(isinstance(value, list | tuple), value, place, "a list")
    kinds = [inner[0]] * len(value) if inner[1:] == (...,) else list(inner)
    _accepted(len(kinds) == len(value), value, place, f"a list of {len(kinds)}")
    pairs = zip(kinds, value, strict=True)
    return tuple(_built(kind, entry, f"{place}[{index}]", notes) for index, (kind, entry) in enumerate(pairs))


def _number(value: Any, place: str, notes: tuple[Any, ...]) -> float:
    if value is None:
        for note in notes:
            if isinstance(note, Null):
                return note.number
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    _accepted(is_number, value, place, "a number")
    may_be_larger = May.BE_NAN in notes if value != value else May.BE_INFINITE in notes
    _accepted(abs(value) <= LARGEST or may_be_larger, value, place, f"a number below {LARGEST:g} in size")
    for note in notes:
        if isinstance(note, Within):
            _accepted(not note.excludes(value), value, place, note.instead_of(value))
    # An integer of hundreds of digits is beyond any float.
    return (
        float(value) if abs(value) <= LARGEST or isinstance(value, float) else math.copysign(math.inf, value)
    )


def _accepted(condition: bool, value: Any, place: str, expected: str) -> Any:
    if not condition:
        raise MismatchError(f"`{place}` should be {expected}, it is {_cut(repr(value))}")
    return value


def _cut(text: str) -> str:
    return f"{text[:_SHOWN]}…" if len(text) > _SHOWN else text


def _first_clause(reason: Exception) -> str:
    """What is wrong, without the remedy, which is another one for a file that a verb has written."""
    return str(reason).partition(";")[0]
