"""Declared tables: the meaning, unit and range of each key, and the reader of a table of a document.

A table is a dataclass. The annotation of a field is the type of its value; `key` declares the rest. Readers of files,
the printed schema and scripts that build the same values all use these notes.
"""

from __future__ import annotations

import math
import types
import unicodedata
from abc import ABCMeta
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from typing import Any, Literal, NoReturn, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from mrwork.errors import InvalidSettingError, MrworkError, SettingError
from mrwork.units import number_in

_REQUIRED: Any = MISSING
# Products of three numbers up to this size are finite, and so are those of their inverses.
LARGEST = 1e100
SMALLEST = 1.0 / LARGEST
"""Least positive number of a quantity that is divided by, or of which the logarithm or the square is taken."""
LARGEST_SEED = 2**53 - 1
"""Largest seed, an integer that every reader of JSON keeps."""
# Whole numbers that a computer word holds.
_LARGEST_WHOLE = 2**63 - 1
# Controls, separators of lines and paragraphs.
_CONTROLS = frozenset({"Cc", "Zl", "Zp"})

KeyPath = tuple[str | int, ...]
"""Keys and array indices that lead to a value, as ("damper", 0, "storey")."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a table or value stands in a document; begins a message.

    With `lines`, the line of each path, a place reads "study.toml, line 12"; without them it names the keys, as in
    "frame.toml, rayleigh.ratios".
    """

    origin: str
    path: KeyPath = ()
    lines: Mapping[KeyPath, int] = field(default_factory=dict)

    def within(self, *keys: str | int) -> Place:
        """The place of something inside."""
        return Place(origin=self.origin, path=(*self.path, *keys), lines=self.lines)

    def __str__(self) -> str:
        return (
            f"{self.origin}, {where}"
            if (where := self._line() if self.lines else self._keys())
            else self.origin
        )

    def _line(self) -> str:
        known = (self.path[:n] for n in range(len(self.path), 0, -1))
        line = next((self.lines[path] for path in known if path in self.lines), 0)
        return f"line {line}" if line else ""

    def _keys(self) -> str:
        parts = (f"[{key + 1}]" if isinstance(key, int) else f".{key}" for key in self.path)
        return "".join(parts).removeprefix(".")

    @property
    def table(self) -> str:
        """What messages call the table: [hardware], [[damper]]."""
        keys = [str(part) for part in self.path if isinstance(part, str)]
        if not keys:
            return "the study"
        return f"[[{'.'.join(keys)}]]" if isinstance(self.path[-1], int) else f"[{'.'.join(keys)}]"

    def refuse(self, sentence: str) -> NoReturn:
        """Raise a SettingError that begins with this place."""
        raise self.error(SettingError, sentence)

    @contextmanager
    def prefixed(self) -> Iterator[None]:
        """Begin the message of an error in the block with this place; the type of the error stays."""
        try:
            yield
        except MrworkError as error:
            raise self.about(error, type(error)) from error

    def about(self, error: MrworkError, kind: type[MrworkError]) -> MrworkError:
        """The error of a value of this table as one whose message begins with the line of that value."""
        own = isinstance(error, InvalidSettingError) or (*self.path, error.key) in self.lines
        place = self.within(error.key) if own else self
        return place.error(kind, error.in_a_file or str(error))

    def error(self, kind: type[MrworkError], sentence: str) -> MrworkError:
        """An error whose message begins with this place."""
        # A place says more than the key of an InvalidSettingError.
        error = (SettingError if kind is InvalidSettingError else kind)(f"{self}: {sentence}")
        error.document = self.origin
        return error


def shown(value: object) -> str:
    """A value of a table as a message quotes it."""
    return "a table" if isinstance(value, dict) else "an array" if isinstance(value, list) else repr(value)


def suggestion(name: object, known: Sequence[str], *, otherwise: str = "choose one of") -> str:
    """End of a message on an unknown name: the closest known name, or all known names if none is close."""
    near = get_close_matches(name, known, n=1) if isinstance(name, str) else []
    return f", did you mean {near[0]}" if near else f"; {otherwise} {', '.join(known) or 'none'}"


def key(
    says: str,
    *,
    unit: str = "",
    default: Any = _REQUIRED,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    most_items: float = math.inf,
    may_be_nan: bool = False,
    matrix: bool = False,
    label: bool = False,
    span: object = None,
) -> Any:
    """Declare a key of a table.

    Parameters
    ----------
    says
        What it means, in a few words.
    unit
        SI unit of a number. A file may also give such a number as a text with another unit.
    default
        Value if the key is absent; a key without a default is required.
    least, above, most
        Bounds of a number: it must not be less than `least`, must exceed `above`, and must not be more than `most`.
    most_items
        Largest length of an array.
    may_be_nan
        Whether a number may be NaN, as the value of a broken sensor.
    matrix
        Whether the value may be a matrix, in a file also the name of a text file with it.
    label
        Whether a text is a name in tables and figures, which has no control characters.
    span
        Range in which a search looks for it, for those tables that are searched.
    """
    notes = {
        "says": says,
        "unit": unit,
        "least": least,
        "above": above,
        "most": most,
        "most_items": most_items,
        "may_be_nan": may_be_nan,
        "matrix": matrix,
        "label": label,
        "span": span,
    }
    return field(metadata=notes) if default is MISSING else field(default=default, metadata=notes)


def keys_of(table: type) -> tuple[Field[Any], ...]:
    """The keys of a table: its fields declared by `key`."""
    return tuple(entry for entry in fields(cast(Any, table)) if "says" in entry.metadata)


class DeclaredTable(ABCMeta):
    """Class of tables that a script builds: keywords that are unknown or missing are refused as in a file.

    Raises
    ------
    SettingError
        If a key is unknown or missing.
    """

    def __call__(cls, *args: Any, **given: Any) -> Any:
        """Build the table."""
        known = {entry.name: entry for entry in keys_of(cls)}
        for name in given:
            if name not in known:
                near = suggestion(name, list(known), otherwise="it has")
                raise SettingError(f"{cls.__name__} has no setting {name!r}{near}")
        for name, entry in known.items():
            if name not in given and is_required(entry):
                raise SettingError(f"{cls.__name__} has no {name}; give {described(entry)}")
        return super().__call__(*args, **given)


def is_required(entry: Field[Any]) -> bool:
    """Whether the key must be given."""
    return entry.default is MISSING and entry.default_factory is MISSING


def described(entry: Field[Any]) -> str:
    """Meaning of a key and its unit."""
    unit = entry.metadata["unit"]
    return f"{entry.metadata['says']}{f' [{unit}]' if unit else ''}"


def out_of_range(name: str, value: float, entry: Field[Any]) -> str:
    """Message for a number out of the range of its key; empty if it is in range."""
    least, above, most = (entry.metadata[bound] for bound in ("least", "above", "most"))
    # A number whose default is infinite may be so, too: it means no limit.
    if (math.isnan(value) and not entry.metadata["may_be_nan"]) or (
        math.isinf(value) and entry.default != math.inf
    ):
        return f"{name} is {value}; give a finite number"
    if isinstance(value, int) and abs(value) > _LARGEST_WHOLE:
        return f"{name} is a whole number of {len(str(abs(value)))} digits; give one of at most 18"
    if value < least:
        return f"{name} is {value:g}; it can be no less than {least:g}"
    if value <= above:
        return f"{name} is {value:g}; it must be more than {above:g}"
    if value > most:
        return f"{name} is {value:g}; it can be no more than {most:.10g}"
    if abs(value) > LARGEST and not math.isinf(value):
        return f"{name} is {value:g}; give a number of at most {LARGEST:g}"
    if above == 0.0 and value < SMALLEST:
        return f"{name} is {value:g}; a positive number is at least {SMALLEST:g}"
    return ""


def repeated(name: str, values: Sequence[object]) -> str:
    """Message for a text that stands in an array twice; empty if there is none."""
    texts = [value for value in values if isinstance(value, str)]
    twice = next((text for text, count in Counter(texts).items() if count > 1), None)
    return "" if twice is None else f"{name} has {twice!r} twice; give each once"


def range_in_words(entry: Field[Any]) -> str:
    """The range of a key as the schema states it, as "at least 0, at most 1"; empty without bounds."""
    notes = entry.metadata
    bounds = (("at least", notes["least"]), ("above", notes["above"]), ("at most", notes["most"]))
    parts = [f"{words} {bound:.10g}" for words, bound in bounds if math.isfinite(bound)]
    if math.isfinite(notes["most_items"]):
        parts.append(f"at most {notes['most_items']} of them")
    return ", ".join(parts)


def control_in(label: str) -> str:
    """The first control character or end of a line in a label, as an escape; empty where there is none."""
    found = next((each for each in label if unicodedata.category(each) in _CONTROLS), "")
    return found.encode("unicode_escape").decode("ascii")


def plain_values(table: Any) -> None:
    """Turn arrays and lists of a table that a script has built into tuples, so that the table is immutable."""
    for entry in fields(table):
        given = getattr(table, entry.name)
        found = _plain_value(given)
        if found is not given:
            object.__setattr__(table, entry.name, found)


def _plain_value(given: Any) -> Any:
    listed = given.tolist() if hasattr(given, "tolist") else given
    return tuple(map(_plain_value, listed)) if isinstance(listed, list | tuple) else listed


def check_keys(table: Any) -> None:
    """Check the numbers of a table that a script has built.

    Raises
    ------
    InvalidSettingError
        If one is out of range, or a name stands twice in an array.
    """
    for entry in fields(table):
        given = getattr(table, entry.name)
        if isinstance(given, tuple) and (refusal := repeated(entry.name, given)):
            raise InvalidSettingError(entry.name, refusal)
        for value in given if isinstance(given, tuple) else (given,):
            if isinstance(value, int | float) and (refusal := out_of_range(entry.name, value, entry)):
                raise InvalidSettingError(entry.name, refusal)


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
