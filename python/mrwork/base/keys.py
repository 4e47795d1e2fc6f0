"""Declared tables: the meaning, unit and range of each key, and the reader of a table of a document.

A table is a dataclass. The annotation of a field is the type of its value; `key` declares the rest. Readers of files,
the printed schema and scripts that build the same values all use these notes.
"""

from __future__ import annotations

import json
import math
import re
import textwrap
import unicodedata
from abc import ABCMeta
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from datetime import date, time
from difflib import get_close_matches
from functools import cache, partial
from typing import Any, NoReturn, TypeVar, cast

from mrwork.base import hints as nodes
from mrwork.base.hints import LARGEST, NOTES, May, Node, Notes, Record, Scalar, Within, fields_of
from mrwork.base.places import Place, Unread
from mrwork.base.summary import list_names
from mrwork.base.synonyms import synonyms, without_style
from mrwork.base.units import number_in, question_on
from mrwork.errors import InvalidSettingError, MrworkError, SettingError, UnknownNameError

T = TypeVar("T")

_REQUIRED: Any = MISSING
LARGEST_SEED = 2**53 - 1
"""Largest seed, an integer that every reader of JSON keeps."""
# Whole numbers that a computer word holds.
_LARGEST_WHOLE = 2**63 - 1
# Characters of a line of the printed schema, and words in it.
_WIDTH = 110
_WORDS = {str: "text", float: "number", int: "whole number", bool: "true or false"}
# Controls, separators of lines and paragraphs.
_CONTROLS = frozenset({"Cc", "Zl", "Zp"})


def quote_value(value: object) -> str:
    """Text of a table's value in a message."""
    if isinstance(value, date | time):
        return f"the date or time {value}"
    if value is None or isinstance(value, str | int | float):
        return repr(value)
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else "an array"
    kind = getattr(value, "dtype", None)
    return f"an array of {kind}" if kind is not None else f"a value of the type {type(value).__name__}"


def suggestion(name: object, known: Sequence[str], *, otherwise: str = "choose one of") -> str:
    """End of a message on an unknown name: the similar known names, or all where none is close."""
    near = " or ".join(meant(name, known))
    return f", did you mean {near}" if near else f"; {otherwise} {', '.join(known) or 'none'}"


def check_known(
    name: object,
    known: Collection[str],
    sentence: str,
    *,
    otherwise: str = "choose one of",
    kind: type[MrworkError] = UnknownNameError,
) -> None:
    """Refuse a name that is none of those known, by this sentence with a `suggestion` behind it."""
    if name not in known:
        raise kind(f"{sentence}{suggestion(name, [*known], otherwise=otherwise)}")


# Characters from which on a name in another style is compared with others that are only similar.
_LONG = 6
# Likeness of a misspelt key from which on its value is read as that of the other.
_MISSPELT = 0.75


def closest(name: object, known: Sequence[str]) -> str:
    """Most similar known name; empty if none is close."""
    return next(iter(meant(name, known)), "")


def meant(name: object, known: Sequence[str]) -> list[str]:
    """Known names similar to an unknown one: the same in another style, a synonym, or a similar spelling."""
    if not isinstance(name, str):
        return []
    plain = {without_style(other): other for other in reversed(known)}
    if same := plain.get(without_style(name)):
        return [same]
    for alike in synonyms(name):
        if near := [plain[word] for synonym in alike if (word := without_style(synonym)) in plain]:
            return near
    if near := get_close_matches(name, known, n=1):
        return near
    # Short names, as of units, are like too many others then.
    alike = get_close_matches(without_style(name), plain, n=1) if len(name) >= _LONG else []
    return [plain[word] for word in alike]


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
    file: bool = False,
    usual: tuple[float, float] | None = None,
) -> Any:
    """Declare a key of a table: what it means in a few words, and its range, as of `Within`.

    A number with a `unit`, which is that of SI, may be a text with another unit in a file. A key without a default is
    required. `matrix` permits a matrix, in a file also the name of a text file with it; a `label` is a name in tables
    and figures, which has no control characters. `span` is the range in which a search looks for it. A number that
    counts `from_one` in a file counts from 0 in Python; `named` is the name in a file, where it is another one. A text
    that may name a `file` is relative to the folder of the document. A number other than 0 that is beyond the `usual`,
    of an array the largest, is asked about in `Place.questions`.
    """
    within = Within(least=least, above=above, most=most, below=below)
    notes = {
        "says": says,
        "unit": unit,
        "within": within,
        NOTES: (within, *((May.BE_NAN,) if may_be_nan else ())),
        "most_items": most_items,
        "matrix": matrix,
        "label": label,
        "span": span,
        "from_one": from_one,
        "named": named,
        "file": file,
        "usual": usual,
    }
    return field(metadata=notes) if default is MISSING else field(default=default, metadata=notes)


optional = partial(key, default=None)
"""Declare a key that may be left out, and is `None` then."""
positive = partial(optional, above=0.0)
"""Declare a key of a number above zero that may be left out, and is `None` then or its default."""


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
            sentence = f"{cls.__name__} has no setting {name!r}"
            check_known(name, known, sentence, otherwise="it has", kind=SettingError)
        for name, entry in known.items():
            if name not in given and is_required(entry):
                raise SettingError(f"{cls.__name__} has no {name}; give {describe_key(entry)}")
        return super().__call__(*args, **given)


def given_in(table: Any) -> dict[str, Any]:
    """The keys of a table that are not as by default, as a document has them: what `read_table` reads back."""
    given = {}
    for entry in keys_of(type(table)):
        value = getattr(table, entry.name)
        if type(value) is not type(entry.default) or value != entry.default:
            given[name_in_file(entry)] = as_document(value, from_one=entry.metadata["from_one"])
    return given


def as_document(value: Any, *, from_one: bool = False) -> Any:
    """A value of a key as a document has it: tables and arrays of plain values."""
    if isinstance(value, Mapping):
        return {name: as_document(item, from_one=from_one) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_document(item, from_one=from_one) for item in value]
    if is_dataclass(value) and keys_of(type(value)):
        return given_in(value)
    return value + 1 if from_one else value


def is_required(entry: Field[Any]) -> bool:
    """Whether the key must be given."""
    return entry.default is MISSING and entry.default_factory is MISSING


def describe_key(entry: Field[Any]) -> str:
    """Meaning of a key and its unit."""
    unit = entry.metadata["unit"]
    return f"{entry.metadata['says']}{f' [{unit}]' if unit else ''}"


def describe_repeat(name: str, values: Sequence[object]) -> str:
    """Message on the first repeated text of an array; empty if there is none."""
    texts = [value for value in values if isinstance(value, str)]
    twice = next((text for text, count in Counter(texts).items() if count > 1), None)
    return "" if twice is None else f"{name} has {twice!r} twice; give each once"


def range_in_words(entry: Field[Any]) -> str:
    """The range of a key as the schema states it; empty without bounds."""
    items = entry.metadata["most_items"]
    parts = [_range_of(entry).in_words, f"at most {items} of them" if math.isfinite(items) else ""]
    return ", ".join(filter(None, parts))


def _range_of(entry: Field[Any]) -> Within:
    """Permitted range of a key's number in a file, where counts may start from one."""
    within: Within = entry.metadata["within"]
    if not entry.metadata["from_one"]:
        return within
    return replace(within, least=within.least + 1, most=within.most + 1)


def control_in(label: str) -> str:
    """The first control character or end of a line in a label, as an escape; empty where there is none."""
    control = next((character for character in label if unicodedata.category(character) in _CONTROLS), "")
    return control.encode("unicode_escape").decode("ascii")


def plain_values(table: Any) -> None:
    """Turn arrays and lists of a table that a script has built into tuples, so that the table is immutable."""
    for entry in fields(table):
        given = getattr(table, entry.name)
        plain = _plain_value(given)
        if plain is not given:
            object.__setattr__(table, entry.name, plain)


def _plain_value(given: Any) -> Any:
    listed = given.tolist() if hasattr(given, "tolist") else given
    return tuple(map(_plain_value, listed)) if isinstance(listed, list | tuple) else listed


def refuse_repeated(table: Any) -> None:
    """Refuse a name that stands twice in an array of a table that a script has built."""
    for entry in fields(table):
        given = getattr(table, entry.name)
        if isinstance(given, tuple) and (refusal := describe_repeat(entry.name, given)):
            raise InvalidSettingError(entry.name, refusal)


def read_table(kind: type[T], table: Mapping[str, Any], place: Place, *, whole: bool = False) -> T:
    """Read a table into the dataclass `kind`; its field `place`, if it has one, is the place.

    Within `Place.collecting` mistakes are kept, and the table lacks the keys that they are about, or is `Unread` if it
    must be `whole`.
    """
    with place.collecting() as place:
        values, unread = _read_keys(kind, table, place)
        for entry in keys_of(kind):
            if is_required(entry) and entry.name not in unread and entry.name not in values:
                unread.add(entry.name)
                with place.keeping():
                    refuse_missing(entry, values, place)
        if "place" in fields_of(kind):
            values["place"] = place
        if unread and whole:
            raise Unread
        if unread:
            return _incomplete(kind, values, unread)
        with place.prefix_errors(SettingError):
            return kind(**values)


def _incomplete(kind: type[T], values: Mapping[str, Any], unread: Collection[str]) -> T:
    """Incomplete table: access to a missing key raises `Unread`."""
    table: T = object.__new__(_lacking_class(cast(Any, kind)))
    for entry in fields(cast(Any, kind)):
        value = values.get(entry.name, entry.default)
        if entry.name not in unread and value is not MISSING:
            object.__setattr__(table, entry.name, value)
    return table


@cache
def _lacking_class(kind: Any) -> Any:
    metaclass: Any = type(kind)
    return metaclass(kind.__name__, (kind,), {"__slots__": (), "__getattr__": _raise_unread})


def _raise_unread(*_: object) -> NoReturn:
    raise Unread


def refuse_missing(entry: Field[Any], given: Collection[str], place: Place) -> None:
    """Refuse a table that does not give a key."""
    if entry.name not in given:
        place.refuse(f"{place.table} has no {name_in_file(entry)}; give {describe_key(entry)}")


def given_values(
    kind: type, table: Mapping[str, Any], place: Place, *, whole: bool = False
) -> dict[str, Any]:
    """The values of the keys that a table gives, in the types of the dataclass `kind` and in SI; see `read_table`."""
    with place.collecting() as place:
        values, unread = _read_keys(kind, table, place)
        if unread and whole:
            raise Unread
        return values


def _read_keys(kind: type, table: Mapping[str, Any], place: Place) -> tuple[dict[str, Any], set[str]]:
    """The values of the keys that a table gives, and the names of those that are given wrongly."""
    known, declared = {name_in_file(entry): entry for entry in keys_of(kind)}, fields_of(kind)
    values: dict[str, Any] = {}
    unread: set[str] = set()

    def read(name: str, entry: Field[Any], place: Place) -> None:
        unread.add(entry.name)
        with place.keeping():
            values[entry.name] = _read_value(declared[entry.name], table[name], place.within(name), entry)
            unread.discard(entry.name)
            if entry.metadata["usual"]:
                _ask(values[entry.name], table[name], place.within(name), entry)

    for name, entry in known.items():
        if name in table:
            read(name, entry, place)
    for name, value in table.items():
        if name in known or place.is_full:
            continue
        near = meant(name, [*known])
        free = {other: entry for other, entry in known.items() if other not in table}
        left = [other for other, entry in free.items() if _fits(declared[entry.name], value, entry)]
        taken = [other for other in left if other in near]
        may_be = taken or left
        lacks = list_names([other for other in may_be if is_required(known[other])])
        with place.keeping():
            place.within(name).refuse(
                f"{place.table} has no key {name!r}{suggestion(name, [*known], otherwise='it has')}"
                f"{f', and lacks {lacks}' if lacks and not near else ''}"
            )
        unread |= {known[other].name for other in may_be if known[other].name not in values}
        is_table = any(isinstance(one, dict) for one in (value, *(value if isinstance(value, list) else ())))
        given = [other for other in near if is_table and known[other].name in values]
        if not (given or is_table):
            taken = get_close_matches(name, taken, n=1, cutoff=_MISSPELT)
        for other in given or taken[:1]:
            place.take_for(name, other)
            read(name, known[other], place)
            # What stands below two headings of one table belongs together.
            unread |= {known[other].name} if other in given else set()
    return values, unread


# Room of a number whose unit is stated.
_STATED = 10.0


def _ask(read: Any, given: Any, place: Place, entry: Field[Any]) -> None:
    """Keep a question on an unusual number of a key, or on the largest one of an array."""
    numbers = [each for each in (read if isinstance(read, tuple) else (read,)) if isinstance(each, float)]
    largest = max(map(abs, numbers), default=0.0)
    stated = any(isinstance(each, str) for each in (given if isinstance(given, list) else (given,)))
    room, unit = _STATED if stated else 1.0, entry.metadata["unit"] or "1"
    if 0.0 < largest < math.inf and (
        question := question_on(str(place.path[-1]), largest, entry.metadata["usual"], unit, room=room)
    ):
        place.questions.append(f"{place}: {question}.")


def _fits(node: Node, value: Any, entry: Field[Any]) -> bool:
    """Whether this key could hold a value given under an unknown name."""
    members = node.parts if isinstance(node, nodes.Either) else (node,)
    return any(_is_near(member, value) for member in members) or (
        isinstance(value, str) and bool(entry.metadata["unit"])
    )


def choose_way(table: Any, ways: Sequence[Sequence[str]], place: Place) -> int:
    """Index of the alternative set of keys, of several `ways` to give a table, whose keys are given.

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


def _read_value(node: Node, value: Any, place: Place, entry: Field[Any]) -> Any:
    match node:
        case nodes.Either(_, members):
            near = next((member for member in members if _is_near(member, value)), None)
            if near is None and [getattr(member, "kind", None) for member in members] == [int, str]:
                _refuse(place, value, "a whole number or a text in quotes")
            return _read_value(near or members[0], value, place, entry)
        case nodes.Record(kind) if keys_of(kind):
            if not isinstance(value, dict):
                _refuse(place, value, f"a table [{place.path[-1]}]")
            return read_table(cast(type[Any], kind), value, place)
        case nodes.Enumerated(choices):
            if value not in choices:
                place.refuse(f"{_name(place)} is {value!r}{suggestion(value, choices)}")
            return value
        case nodes.Fixed():
            return _read_items(node, value, place, entry)
        case nodes.ByName(_, (_, inner)):
            if not isinstance(value, dict):
                _refuse(place, value, "a table, as { name = 1 }")
            if not value and inner != Node(notes=inner.notes):
                place.refuse(f"{_name(place)} is empty; give {describe_key(entry)}, or leave it out")
            read = {
                name: place.attempt(_read_value, inner, item, place.within(name), entry)
                for name, item in value.items()
            }
            return {name: result() for name, result in read.items()}
        case nodes.Scalar(kind, _, notes):
            return _read_scalar(kind, notes, value, place, entry)
    return value


def _read_items(node: nodes.Fixed, value: Any, place: Place, entry: Field[Any]) -> tuple[Any, ...]:
    item = node.parts[0]
    tables = isinstance(item, Record)
    names = isinstance(item, nodes.Enumerated) or (isinstance(item, Scalar) and item.kind is str)
    if not isinstance(value, list):
        example = '["name"]' if names and isinstance(item, Scalar) else "[1, 2]"
        _refuse(place, value, f"tables, as [[{place.path[-1]}]]" if tables else f"an array, as {example}")
    if not value and place.path[-1] == name_in_file(entry) and not tables:
        leave = "" if is_required(entry) else ", or leave it out"
        place.refuse(f"{_name(place)} is empty; give {describe_key(entry)}{leave}")
    most = entry.metadata["most_items"]
    if len(value) > most:
        place.refuse(f"{_name(place)} has {len(value)} entries; give at most {most}")
    if names and (twice := describe_repeat(_name(place), value)):
        place.refuse(twice)
    kinds = node.of(len(value))
    if len(value) != len(kinds):
        place.refuse(f"{_name(place)} has {len(value)} entries; give {len(kinds)}, {describe_key(entry)}")
    if node.is_matrix:
        _check_rows(value, place)
    # Many numbers are soon read where all are right.
    if isinstance(item, Scalar) and item.kind is float and _are_right(value, item.notes, entry):
        return tuple(map(float, value))
    read = [
        place.attempt(_read_value, kind, one, place.within(number), entry)
        for number, (kind, one) in enumerate(zip(kinds, value, strict=True))
    ]
    return tuple(result() for result in read)


def _are_right(values: Sequence[Any], notes: Notes, entry: Field[Any]) -> bool:
    """Whether all values are numbers that a key can have."""
    return all(type(each) in (float, int) and not _wanted_instead_of(each, notes, entry) for each in values)


def _read_scalar(kind: type, notes: Notes, value: Any, place: Place, entry: Field[Any]) -> Any:
    unit = entry.metadata["unit"]
    if kind is float and isinstance(value, str) and (unit or value.rstrip().endswith("%")):
        number = number_in(value, unit or "1")
        if isinstance(number, str):
            place.refuse(f"{_name(place)} {number}")
        value = number
    if kind in (float, int):
        whole = isinstance(value, int) or (isinstance(value, float) and kind is float)
        if isinstance(value, bool) or not whole:
            _refuse(place, value, f"a {'whole ' if kind is int else ''}number{f' [{unit}]' if unit else ''}")
        # Whole numbers of Python, which no file has, may be larger than any float.
        huge = isinstance(value, int) and kind is float and abs(value) > LARGEST
        read = (math.inf if value > 0 else -math.inf) if huge else kind(value)
        if wanted := _wanted_instead_of(read, notes, entry):
            number = f"{value:g}" if isinstance(value, float) or abs(value) < LARGEST else "too large"
            place.refuse(f"{_name(place)} is {number}; give {wanted}")
        return read - entry.metadata["from_one"]
    if not isinstance(value, kind):
        _refuse(place, value, {str: "a text in quotes", bool: "true or false"}[kind])
    if isinstance(value, str) and entry.metadata["label"] and (control := control_in(value)):
        place.refuse(f"{_name(place)} has the control character {control}; give printable text on one line")
    return value


def _wanted_instead_of(value: float, notes: Notes, entry: Field[Any]) -> str:
    """Permitted range, in words, for a number that a key cannot have; empty if it can have it."""
    if isinstance(value, int) and abs(value) > _LARGEST_WHOLE:
        return "a whole number of at most 18 digits"
    # A number whose default is infinite may be so, too: it means no limit.
    if (math.isnan(value) and May.BE_NAN not in notes) or (math.isinf(value) and entry.default != math.inf):
        return "a finite number"
    # Entries of a matrix have no range.
    within = _range_of(entry) if any(isinstance(note, Within) for note in notes) else Within()
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


def _is_near(node: Node, value: Any) -> bool:
    """Whether a value has the form of this member of a union, whose errors then apply."""
    match node:
        case nodes.Record(kind) if not keys_of(kind):
            return isinstance(value, kind)
        case nodes.Function():
            return callable(value)
        case nodes.Record() | nodes.ByName():
            return isinstance(value, dict)
        case nodes.Fixed():
            return isinstance(value, list) and node.is_matrix == any(isinstance(item, list) for item in value)
        case nodes.Enumerated(choices):
            return value in choices
        case nodes.Scalar(kind):
            wanted = (int, float) if kind is float else kind
            return isinstance(value, wanted) and (kind is bool or not isinstance(value, bool))
    return False


def _refuse(place: Place, value: Any, expected: str) -> NoReturn:
    place.refuse(f"{_name(place)} is {quote_value(value)}; give {expected}")


def _name(place: Place) -> str:
    """Name of a value in messages: the key, with the index of an element."""
    length = max(n for n, part in enumerate(place.path, start=1) if isinstance(part, str))
    return str(place.path[length - 1]) + "".join(f"[{number}]" for number in place.path[length:])


def tables(kind: type, path: str = "") -> Iterator[tuple[str, type]]:
    """Headings and declarations of a table and all tables in it, outer tables first, each declaration once."""
    by_heading = {path: kind}
    for entry in keys_of(kind):
        inner, describe_repeat = _inner_table(fields_of(kind)[entry.name])
        if inner is not None:
            name = ".".join(filter(None, (path.strip("[]"), name_in_file(entry))))
            for heading, table in tables(inner, f"[[{name}]]" if describe_repeat else f"[{name}]"):
                if table not in by_heading.values():
                    by_heading[heading] = table
    yield from by_heading.items()


def _inner_table(node: Node) -> tuple[type | None, bool]:
    """Class of the table that a key holds, if any, and whether the key may hold several."""
    if isinstance(node, Record):
        return (node.kind if keys_of(node.kind) else None), False
    inner = [_inner_table(part) for part in node.parts]
    kind = next((table for table, _ in inner if table is not None), None)
    return kind, isinstance(node, nodes.Fixed) or any(describe_repeat for _, describe_repeat in inner)


# A section of a docstring, as Raises: its name, and dashes below it.
_SECTION = re.compile(r"\n\s*\w+\n\s*-{3,}\s*\n")


def before_sections(docstring: str) -> str:
    """Text of a docstring before its first section."""
    return _SECTION.split(docstring)[0].rstrip()


def toml_value(value: Any) -> str:
    """TOML text of a setting's value."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # The escapes of JSON are those of TOML.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_lines_of(value)) + " }" if value else "{}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return repr(value)


def toml_lines_of(table: Mapping[str, Any]) -> list[str]:
    """A line of TOML for each key of a table."""
    return [
        f"{name if re.fullmatch('[A-Za-z0-9_-]+', name) else toml_value(name)} = {toml_value(value)}"
        for name, value in table.items()
    ]


def toml_text(document: Mapping[str, Any]) -> str:
    """A document as TOML: its own keys, then its tables below their headings, and what is in these in their lines."""
    own, blocks = {}, []
    for name, value in document.items():
        several = isinstance(value, list) and all(isinstance(each, dict) for each in value)
        if not several and not isinstance(value, dict):
            own[name] = value
            continue
        heading = f"[[{name}]]" if several else f"[{name}]"
        blocks += [[heading, *toml_lines_of(each)] for each in (value if several else [value])]
    return "\n\n".join("\n".join(block) for block in [toml_lines_of(own), *blocks] if block) + "\n"


def heading_lines(heading: str, prose: str) -> list[str]:
    """A heading of the printed schema and the prose below it."""
    words = textwrap.wrap(
        " ".join(before_sections(prose).split()), _WIDTH, initial_indent="  ", subsequent_indent="  "
    )
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
    declared = fields_of(kind)
    return [
        KeyInWords(
            name=name_in_file(entry),
            default=_default(entry),
            meaning=entry.metadata["says"],
            form=f"{in_words(declared[entry.name])}{' or name of a text file' if entry.metadata['matrix'] else ''}",
            unit=entry.metadata["unit"],
            limits=range_in_words(entry),
            searched=_describe_search(entry),
        )
        for entry in keys_of(kind)
    ]


def key_lines(kind: type) -> list[str]:
    """The keys of a table, their meanings, defaults and types."""
    keys = keys_in_words(kind)
    names = max((len(entry.name) for entry in keys), default=0)
    defaults = max((len(entry.default) for entry in keys), default=0)
    lines = []
    for entry in keys:
        unit = f" [{entry.unit}]" if entry.unit else ""
        limits = f", {entry.limits}" if entry.limits else ""
        searched = f"; {entry.searched}" if entry.searched else ""
        head = f"  {entry.name:<{names}}  {entry.default:<{defaults}}  "
        lines += textwrap.wrap(
            f"{entry.meaning} ({entry.form}{unit}{limits}){searched}",
            width=_WIDTH,
            initial_indent=head,
            subsequent_indent=" " * len(head),
            break_long_words=False,
        )
    return lines


def _describe_search(entry: Field[Any]) -> str:
    """Whether a search of settings changes the key by itself, or where it is asked to."""
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


def in_words(node: Node) -> str:
    """An annotation in words, as "text or number"; empty for a value that no file can hold."""
    match node:
        case nodes.Function():
            return ""
        case nodes.Record(kind) if not keys_of(kind):
            return ""
        case nodes.Either(_, members):
            return " or ".join(filter(None, map(in_words, members)))
        case nodes.Record():
            return "table"
        case nodes.Enumerated(choices):
            return ", ".join(map(str, choices))
        case nodes.Fixed(_, (item, *_)):
            if node.is_matrix or isinstance(item, Record):
                return "rows of a matrix" if node.is_matrix else "tables"
            return f"array of {in_words(item)}{'' if isinstance(item, nodes.Enumerated) else 's'}"
        case nodes.ByName(_, (_, inner)):
            return "table" if (of := in_words(inner)) == "any" else f"table of {of}"
        case nodes.Scalar(kind):
            return _WORDS[kind]
    return "any"
