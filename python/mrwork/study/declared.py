"""Read tables of a study file into declared dataclasses.

The annotation of a field is the type of its value; `key` declares meaning, unit and range. The printed schema uses the
same declarations.
"""

from __future__ import annotations

import math
import types
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import Field, field, is_dataclass
from typing import Any, Literal, NoReturn, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from mrwork.errors import MrworkError, SettingError
from mrwork.keys import (
    Place,
    control_in,
    described,
    is_required,
    keys_of,
    out_of_range,
    repeated,
    shown,
    suggestion,
)
from mrwork.units import number_in

T = TypeVar("T")


@contextmanager
def located(place: Place) -> Iterator[None]:
    """Begin the message of an error in the block with the place in the file."""
    try:
        yield
    except MrworkError as error:
        if error.document == place.origin:
            raise SettingError(str(error)) from error
        raise place.about(error, SettingError) from error


def read_table(kind: type[T], table: Mapping[str, Any], place: Place) -> T:
    """Read a table into the dataclass `kind`."""
    values = given_values(kind, table, place)
    for entry in keys_of(kind):
        if entry.name not in values and is_required(entry):
            place.refuse(f"{place.table} has no {entry.name}; give {described(entry)}")
    if "place" in get_type_hints(kind):
        values["place"] = place
    return kind(**values)


def given_values(kind: type, table: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The values of the keys that a table gives, in the types of the dataclass `kind` and in SI."""
    known = {entry.name: entry for entry in keys_of(kind)}
    for name in table:
        if name not in known:
            near = suggestion(name, list(known), otherwise="it has")
            place.within(name).refuse(f"{place.table} has no key {name!r}{near}")
    hints = get_type_hints(kind)
    return {
        name: _value(hints[name], table[name], place.within(name), entry)
        for name, entry in known.items()
        if name in table
    }


def _value(kind: Any, value: Any, place: Place, entry: Field[Any]) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        kinds = [each for each in arguments if each is not type(None)]
        kind = next((each for each in kinds if _is_near(each, value)), kinds[0])
        return _value(kind, value, place, entry)
    if is_dataclass(kind):
        if not isinstance(value, dict):
            _refuse(place, value, f"a table [{place.path[-1]}]")
        return read_table(cast(type, kind), value, place)
    if origin is Literal:
        if value not in arguments:
            place.refuse(f"{_name(place)} is {value!r}{suggestion(value, arguments)}")
        return value
    if origin is tuple:
        if not isinstance(value, list):
            _refuse(place, value, 'an array, as ["name"]' if arguments[0] is str else "an array, as [1, 2]")
        if not value and place.path[-1] == entry.name and not is_dataclass(arguments[0]):
            leave = "" if is_required(entry) else ", or leave it out"
            place.refuse(f"{_name(place)} is empty; give {described(entry)}{leave}")
        if len(value) > entry.metadata["most_items"]:
            place.refuse(
                f"{_name(place)} has {len(value)} entries; give at most {entry.metadata['most_items']}"
            )
        names = arguments[0] is str or get_origin(arguments[0]) is Literal
        if names and (twice := repeated(_name(place), value)):
            place.refuse(twice)
        # Bounds are those of a number or of an array of numbers; entries beside the diagonal of a matrix have none.
        notes = {**entry.metadata, "least": -math.inf, "above": -math.inf} if _is_nested(kind) else {}
        inner = field(metadata=notes) if notes else entry
        return tuple(
            _value(arguments[0], each, place.within(number), inner) for number, each in enumerate(value)
        )
    if origin in (dict, Mapping):
        if not isinstance(value, dict):
            _refuse(place, value, "a table, as { name = 1 }")
        if not value and arguments and arguments[1] is not Any:
            place.refuse(f"{_name(place)} is empty; give {described(entry)}, or leave it out")
        return {
            name: _value(arguments[1], each, place.within(name), entry) if arguments else each
            for name, each in value.items()
        }
    return value if kind is Any else _plain(kind, value, place, entry)


def _plain(kind: Any, value: Any, place: Place, entry: Field[Any]) -> Any:
    unit = entry.metadata["unit"]
    if kind is float and isinstance(value, str) and unit:
        number = number_in(value, unit)
        if isinstance(number, str):
            place.refuse(f"{_name(place)} {number}")
        value = number
    if kind in (float, int):
        whole = isinstance(value, int) or (isinstance(value, float) and kind is float)
        if isinstance(value, bool) or not whole:
            _refuse(place, value, f"a {'whole ' if kind is int else ''}number{f' [{unit}]' if unit else ''}")
        return _ranged(kind(value), place, entry)
    if not isinstance(value, kind):
        _refuse(place, value, {str: "a text in quotes", bool: "true or false"}[kind])
    if kind is str and entry.metadata["label"] and (control := control_in(value)):
        place.refuse(f"{_name(place)} has the control character {control}; give printable text on one line")
    return value


def _ranged(value: float, place: Place, entry: Field[Any]) -> float:
    if refusal := out_of_range(_name(place), value, entry):
        place.refuse(refusal)
    return value


def _is_near(kind: Any, value: Any) -> bool:
    """Whether a value has the form of a type of a union; errors are then those of that type."""
    origin = get_origin(kind)
    if is_dataclass(kind) or origin in (dict, Mapping):
        return isinstance(value, dict)
    if origin is tuple:
        return isinstance(value, list) and _is_nested(kind) == any(isinstance(each, list) for each in value)
    if origin is Literal:
        return value in get_args(kind)
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(value, kind) and not (kind is int and isinstance(value, bool))


def _is_nested(kind: Any) -> bool:
    """Whether the type is that of a matrix, a tuple of tuples."""
    return get_origin(get_args(kind)[0]) is tuple


def _refuse(place: Place, value: Any, expected: str) -> NoReturn:
    place.refuse(f"{_name(place)} is {shown(value)}; give {expected}")


def _name(place: Place) -> str:
    """Name of a value in messages: the key, with the index of an element."""
    length = max(n for n, part in enumerate(place.path, start=1) if isinstance(part, str))
    return str(place.path[length - 1]) + "".join(f"[{number}]" for number in place.path[length:])
