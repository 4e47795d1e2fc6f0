"""Declared tables: the meaning, unit and range of each key, and the reader of a table of a document.

A table is a dataclass. The annotation of a field is the type of its value; `key` declares the rest. Readers of files,
the printed schema and scripts that build the same values all use these notes.
"""

from __future__ import annotations

import math
import textwrap
import types
import unicodedata
from abc import ABCMeta
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from typing import Any, Literal, NoReturn, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from mrwork.errors import InvalidSettingError, MrworkError, SettingError
from mrwork.units import number_in

T = TypeVar("T")

_REQUIRED: Any = MISSING
# Products of three numbers up to this size are finite, and so are those of their inverses.
LARGEST = 1e100
SMALLEST = 1.0 / LARGEST
"""Least positive number of a quantity that is divided by, or of which the logarithm or the square is taken."""
LARGEST_SEED = 2**53 - 1
"""Largest seed, an integer that every reader of JSON keeps."""
# Whole numbers that a computer word holds.
_LARGEST_WHOLE = 2**63 - 1
# Characters of a line of the printed schema, and words in it.
_WIDTH = 110
_WORDS = {str: "text", float: "number", int: "whole number", bool: "true or false", Any: "any"}
# Controls, separators of lines and paragraphs.
_CONTROLS = frozenset({"Cc", "Zl", "Zp"})

KeyPath = tuple[str | int, ...]
"""Keys and array indices that lead to a value, as ("damper", 0, "storey")."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a table or value stands in a document; begins a message.

    With `lines`, the line of each path, a place reads "study.toml, line 12"; without them it names the keys, as in
    "frame.toml, rayleigh.ratios". `title` is what messages call the document.
    """

    origin: str
    path: KeyPath = ()
    lines: Mapping[KeyPath, int] = field(default_factory=dict)
    title: str = "the study"

    def within(self, *keys: str | int) -> Place:
        """The place of something inside."""
        return replace(self, path=(*self.path, *keys))

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
            return self.title
        return f"[[{'.'.join(keys)}]]" if isinstance(self.path[-1], int) else f"[{'.'.join(keys)}]"

    def refuse(self, sentence: str) -> NoReturn:
        """Raise a SettingError that begins with this place."""
        raise self.error(SettingError, sentence)

    @contextmanager
    def prefixed(self, kind: type[MrworkError] | None = None) -> Iterator[None]:
        """Begin the message of an error in the block with this place; the type is `kind`, or stays."""
        try:
            yield
        except MrworkError as error:
            known = error.document == self.origin
            if known and (kind is None or isinstance(error, kind)):
                raise
            changed = kind or type(error)
            raise (self._as(changed, str(error)) if known else self.about(error, changed)) from error

    def about(self, error: MrworkError, kind: type[MrworkError]) -> MrworkError:
        """The error of a value of this table as one whose message begins with the line of that value."""
        own = isinstance(error, InvalidSettingError) or (*self.path, error.key) in self.lines
        place = self.within(error.key) if own else self
        return place.error(kind, error.in_a_file or str(error))

    def error(self, kind: type[MrworkError], sentence: str) -> MrworkError:
        """An error whose message begins with this place."""
        return self._as(kind, f"{self}: {sentence}")

    def _as(self, kind: type[MrworkError], text: str) -> MrworkError:
        # A place says more than the key of an InvalidSettingError.
        error = (SettingError if kind is InvalidSettingError else kind)(text)
        error.document = self.origin
        return error


def shown(value: object) -> str:
    """A value of a table as a message quotes it."""
    return "a table" if isinstance(value, dict) else "an array" if isinstance(value, list) else repr(value)


def suggestion(name: object, known: Sequence[str], *, otherwise: str = "choose one of") -> str:
    """End of a message on an unknown name: the closest known name, or all known names if none is close."""
    near = get_close_matches(name, known, n=1) if isinstance(name, str) else []
    return f", did you mean {near[0]}" if near else f"; {otherwise} {', '.join(known) or 'none'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Within:
    """Range of a number, or of every number of an array."""

    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf
    below: float = math.inf

    @property
    def in_words(self) -> str:
        """The range as a message states it."""
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f"from {_end(self.least)} to {_end(self.most)}"
        ends = (
            ("at least", self.least),
            ("above", self.above),
            ("at most", self.most),
            ("below", self.below),
        )
        return " and ".join(f"{word} {_end(end)}" for word, end in ends if math.isfinite(end))

    def excludes(self, values: Any) -> Any:
        """Which numbers lie outside; NaN does not. What must be positive may be divided by, and squared."""
        return (
            (values < self.least)
            | (values <= self.above) & (self.above > -math.inf)
            | (values < SMALLEST) & (self.above == 0.0)
            | (values > self.most) | (values >= self.below) & (self.below < math.inf)
        )  # fmt: skip

    def instead_of(self, value: float, kind: str = "number") -> str:
        """What to give instead of a number out of the range, as "a number above 0"; `kind` may be a plural."""
        words = f"of at least {SMALLEST:g}" if self.above == 0.0 < value < SMALLEST else self.in_words
        return f"{'' if kind.endswith('s') else 'a '}{kind} {words}"


def _end(value: float) -> str:
    return str(value) if isinstance(value, int) or float(f"{value:g}") != value else f"{value:g}"


def key(
    says: str,
    *,
    unit: str = "",
    default: Any = _REQUIRED,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
    most_items: float = math.inf,
    may_be_nan: bool = False,
    matrix: bool = False,
    label: bool = False,
    span: object = None,
    from_one: bool = False,
    named: str = "",
) -> Any:
    """Declare a key of a table: what it means in a few words, and its range, as of `Within`.

    A number with a `unit`, which is that of SI, may be a text with another unit in a file. A key without a default is
    required. `matrix` permits a matrix, in a file also the name of a text file with it; a `label` is a name in tables
    and figures, which has no control characters. `span` is the range in which a search looks for it. A number that
    counts `from_one` in a file counts from 0 in Python; `named` is the name in a file, where it is another one.
    """
    notes = {
        "says": says,
        "unit": unit,
        "within": Within(least=least, above=above, most=most, below=below),
        "most_items": most_items,
        "may_be_nan": may_be_nan,
        "matrix": matrix,
        "label": label,
        "span": span,
        "from_one": from_one,
        "named": named,
    }
    return field(metadata=notes) if default is MISSING else field(default=default, metadata=notes)


def keys_of(table: type) -> tuple[Field[Any], ...]:
    """The keys of a table: its fields declared by `key`."""
    return tuple(entry for entry in fields(cast(Any, table)) if "says" in entry.metadata)


def name_in_file(entry: Field[Any]) -> str:
    """Name of a key in a file."""
    return entry.metadata["named"] or entry.name


class DeclaredTable(ABCMeta):
    """Class of tables that a script builds: keywords that are unknown or missing are refused as in a file."""

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


def repeated(name: str, values: Sequence[object]) -> str:
    """Message for a text that stands in an array twice; empty if there is none."""
    texts = [value for value in values if isinstance(value, str)]
    twice = next((text for text, count in Counter(texts).items() if count > 1), None)
    return "" if twice is None else f"{name} has {twice!r} twice; give each once"


def range_in_words(entry: Field[Any]) -> str:
    """The range of a key as the schema states it; empty without bounds."""
    items = entry.metadata["most_items"]
    parts = [_range_of(entry).in_words, f"at most {items} of them" if math.isfinite(items) else ""]
    return ", ".join(filter(None, parts))


def _range_of(entry: Field[Any]) -> Within:
    """The range of the number of a key in a file."""
    within: Within = entry.metadata["within"]
    return (
        replace(within, least=within.least + 1, most=within.most + 1)
        if entry.metadata["from_one"]
        else within
    )


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


def refuse_repeated(table: Any) -> None:
    """Refuse a name that stands twice in an array of a table that a script has built."""
    for entry in fields(table):
        given = getattr(table, entry.name)
        if isinstance(given, tuple) and (refusal := repeated(entry.name, given)):
            raise InvalidSettingError(entry.name, refusal)


def read_table(kind: type[T], table: Mapping[str, Any], place: Place) -> T:
    """Read a table into the dataclass `kind`; its field `place`, if it has one, is the place."""
    values = given_values(kind, table, place)
    for entry in keys_of(kind):
        if is_required(entry):
            refuse_missing(entry, values, place)
    if "place" in get_type_hints(kind):
        values["place"] = place
    with place.prefixed(SettingError):
        return kind(**values)


def refuse_missing(entry: Field[Any], given: Collection[str], place: Place) -> None:
    """Refuse a table that does not give a key."""
    if entry.name not in given:
        place.refuse(f"{place.table} has no {name_in_file(entry)}; give {described(entry)}")


def given_values(kind: type, table: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The values of the keys that a table gives, in the types of the dataclass `kind` and in SI."""
    known = {name_in_file(entry): entry for entry in keys_of(kind)}
    for name in table:
        if name not in known:
            near = suggestion(name, list(known), otherwise="it has")
            place.within(name).refuse(f"{place.table} has no key {name!r}{near}")
    hints = get_type_hints(kind)
    return {
        entry.name: _value(hints[entry.name], table[name], place.within(name), entry)
        for name, entry in known.items()
        if name in table
    }


def choose_way(table: Any, ways: Sequence[Sequence[str]], place: Place) -> int:
    """Number of the one of several ways to give a table, each with keys of its own, of which keys are given.

    Keys that all ways have tell nothing. A table with keys of two ways is refused, or with none.
    """
    own = [[name for name in way if any(name not in other for other in ways)] for way in ways]
    given = [[name for name in names if getattr(table, name) is not None] for names in own]
    used = [number for number, names in enumerate(given) if names]
    choice = " or by ".join(" and ".join(filter(None, (", ".join(way[:-1]), way[-1]))) for way in own)
    if not used:
        place.refuse(f"{place.table} is given by {choice}; here by none of them")
    if len(used) > 1:
        # The way of which fewer keys are given is the one that was not meant.
        odd = min(used, key=lambda number: (len(given[number]), -number))
        place.within(given[odd][0]).refuse(f"{place.table} is given by {choice}; keep one")
    return used[0]


def _value(kind: Any, value: Any, place: Place, entry: Field[Any]) -> Any:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        kinds = [each for each in arguments if each is not type(None)]
        near = next((each for each in kinds if _is_near(each, value)), None)
        if near is None and set(kinds) == {int, str}:
            _refuse(place, value, "a whole number or a text in quotes")
        return _value(near or kinds[0], value, place, entry)
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
            example = 'an array, as ["name"]' if arguments[0] is str else "an array, as [1, 2]"
            _refuse(
                place, value, f"tables, as [[{place.path[-1]}]]" if is_dataclass(arguments[0]) else example
            )
        if not value and place.path[-1] == name_in_file(entry) and not is_dataclass(arguments[0]):
            leave = "" if is_required(entry) else ", or leave it out"
            place.refuse(f"{_name(place)} is empty; give {described(entry)}{leave}")
        if len(value) > entry.metadata["most_items"]:
            place.refuse(
                f"{_name(place)} has {len(value)} entries; give at most {entry.metadata['most_items']}"
            )
        names = arguments[0] is str or get_origin(arguments[0]) is Literal
        if names and (twice := repeated(_name(place), value)):
            place.refuse(twice)
        if arguments[1:] != (...,) and len(value) != len(arguments):
            place.refuse(
                f"{_name(place)} has {len(value)} entries; give {len(arguments)}, {described(entry)}"
            )
        if _is_nested(kind):
            _check_rows(value, place)
            # A range is that of a number or of an array of numbers; entries beside the diagonal of a matrix have none.
            entry = field(metadata={**entry.metadata, "within": Within()})
        return tuple(
            _value(arguments[0], each, place.within(number), entry) for number, each in enumerate(value)
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
        if wanted := _wanted_instead_of(kind(value), entry):
            number = f"{value:g}" if isinstance(value, float) or abs(value) < LARGEST else "too large"
            place.refuse(f"{_name(place)} is {number}; give {wanted}")
        return kind(value) - entry.metadata["from_one"]
    if not isinstance(value, kind):
        _refuse(place, value, {str: "a text in quotes", bool: "true or false"}[kind])
    if kind is str and entry.metadata["label"] and (control := control_in(value)):
        place.refuse(f"{_name(place)} has the control character {control}; give printable text on one line")
    return value


def _wanted_instead_of(value: float, entry: Field[Any]) -> str:
    """What to give instead of a number that a key cannot have; empty if it can have it."""
    within = _range_of(entry)
    # A number whose default is infinite may be so, too: it means no limit.
    if (math.isnan(value) and not entry.metadata["may_be_nan"]) or (
        math.isinf(value) and entry.default != math.inf
    ):
        return "a finite number"
    if isinstance(value, int) and abs(value) > _LARGEST_WHOLE:
        return "a whole number of at most 18 digits"
    if within.excludes(value):
        return within.instead_of(value, "whole number" if isinstance(value, int) else "number")
    return f"a number of at most {LARGEST:g}" if LARGEST < abs(value) < math.inf else ""


def _check_rows(rows: Sequence[Any], place: Place) -> None:
    if not all(isinstance(row, list) for row in rows):
        _refuse(place, rows, "rows of numbers, as [[2, -1], [-1, 1]]")
    for number, row in enumerate(rows):
        if len(row) != len(rows[0]):
            lengths = f"{len(rows[0])} and {len(row)}"
            sentence = f"{_name(place)} has rows of different lengths, {lengths}; complete row {number + 1}"
            place.within(number).refuse(sentence)


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
    return get_origin(get_args(kind)[0]) is tuple


def _refuse(place: Place, value: Any, expected: str) -> NoReturn:
    place.refuse(f"{_name(place)} is {shown(value)}; give {expected}")


def _name(place: Place) -> str:
    """Name of a value in messages: the key, with the index of an element."""
    length = max(n for n, part in enumerate(place.path, start=1) if isinstance(part, str))
    return str(place.path[length - 1]) + "".join(f"[{number}]" for number in place.path[length:])


def tables(kind: type, path: str = "") -> Iterator[tuple[str, type]]:
    """Headings and declarations of a table and all tables in it, outer tables first, each declaration once."""
    found = {path: kind}
    for entry in keys_of(kind):
        inner, repeated = _inner(get_type_hints(kind)[entry.name])
        if inner is not None:
            name = ".".join(filter(None, (path.strip("[]"), name_in_file(entry))))
            for heading, each in tables(inner, f"[[{name}]]" if repeated else f"[{name}]"):
                if each not in found.values():
                    found[heading] = each
    yield from found.items()


def _inner(hint: Any) -> tuple[type | None, bool]:
    """The table that a key holds, and whether it may hold several."""
    if is_dataclass(hint):
        return cast(type, hint), False
    inner = [_inner(each) for each in get_args(hint)]
    kind = next((each for each, _ in inner if each is not None), None)
    return kind, get_origin(hint) is tuple or any(repeated for _, repeated in inner)


def heading_lines(heading: str, prose: str) -> list[str]:
    """A heading of the printed schema and the prose below it."""
    words = textwrap.wrap(" ".join(prose.split()), _WIDTH, initial_indent="  ", subsequent_indent="  ")
    return [heading, *words]


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyInWords:
    """A key as a schema lists it; texts that do not apply are empty.

    `searched` says whether a search of settings changes the key by itself, or where it is asked to.
    """

    name: str
    default: str
    meaning: str
    form: str
    unit: str
    limits: str
    searched: str


def keys_in_words(kind: type) -> list[KeyInWords]:
    """The keys of a table, in order."""
    hints = get_type_hints(kind)
    return [
        KeyInWords(
            name=name_in_file(entry),
            default=_default(entry),
            meaning=entry.metadata["says"],
            form=f"{in_words(hints[entry.name])}{' or name of a text file' if entry.metadata['matrix'] else ''}",
            unit=entry.metadata["unit"],
            limits=range_in_words(entry),
            searched=_searched(entry),
        )
        for entry in keys_of(kind)
    ]


def key_lines(kind: type) -> list[str]:
    """The keys of a table, their meanings, defaults and types."""
    keys = keys_in_words(kind)
    names = max((len(each.name) for each in keys), default=0)
    defaults = max((len(each.default) for each in keys), default=0)
    lines = []
    for each in keys:
        unit = f" [{each.unit}]" if each.unit else ""
        limits = f", {each.limits}" if each.limits else ""
        searched = f"; {each.searched}" if each.searched else ""
        head = f"  {each.name:<{names}}  {each.default:<{defaults}}  "
        lines += textwrap.wrap(
            f"{each.meaning} ({each.form}{unit}{limits}){searched}",
            width=_WIDTH,
            initial_indent=head,
            subsequent_indent=" " * len(head),
            break_long_words=False,
        )
    return lines


def _searched(entry: Field[Any]) -> str:
    span = entry.metadata["span"]
    if span is None:
        return ""
    return "searched by mrwork tune" if span.free else "can be searched by mrwork tune"


def _default(entry: Field[Any]) -> str:
    if is_required(entry):
        return "required"
    value: Any = entry.default
    if entry.metadata["from_one"] and value is not None:
        value += 1
    if value is None or value in ("", ()) or is_dataclass(value):
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return ", ".join(map(str, value))
    if isinstance(value, float):
        return "inf" if math.isinf(value) else f"{value:g}"
    return str(value)


def in_words(hint: Any) -> str:
    """An annotation in words, as "text or number"."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return " or ".join(in_words(each) for each in arguments if each is not type(None))
    if is_dataclass(hint):
        return "table"
    if origin is Literal:
        return ", ".join(map(str, arguments))
    if origin is tuple and get_origin(arguments[0]) is tuple:
        return "rows of a matrix"
    if origin is tuple:
        if is_dataclass(arguments[0]):
            return "tables"
        plural = "" if get_origin(arguments[0]) is Literal else "s"
        return f"array of {in_words(arguments[0])}{plural}"
    if origin in (dict, Mapping) or hint is Mapping:
        inner = in_words(arguments[1])
        return "table" if inner == "any" else f"table of {inner}"
    return _WORDS[hint]
