"""Documents of declared tables: how one is read, and the schema that is printed.

A table becomes the dataclass that declares its keys, or the `Arguments` of functions, and all mistakes of a document
are told together. A value is checked as an argument of a function is; a number may be a text with a unit.
"""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from functools import cache, partial
from typing import Any, TypeVar, cast

from mrwork.base.arguments import Refusal, accept, hint_in_words
from mrwork.base.docstrings import before_sections
from mrwork.base.hints import Hint, InUnit, Within
from mrwork.base.keys import (
    Arguments,
    Key,
    Table,
    as_document,
    inner_table,
    keys_of,
    meant,
    own_keys,
    quote_value,
    refuse_missing,
    suggestion,
)
from mrwork.base.places import Place, all_mistakes, read_each
from mrwork.base.units import unusual_number
from mrwork.errors import SettingError

T = TypeVar("T")


def read_table(kind: type[T], table: Mapping[str, Any], place: Place) -> T:
    """Read a table into the dataclass `kind`, or into the `Arguments` of a tuple of functions.

    All mistakes of the table, and of the tables in it, are raised together.
    """
    values = given_values(kind, table, place, complete=True)
    with place.prefix_errors(SettingError):
        if isinstance(kind, tuple):
            made = cast(T, Arguments(functions=kind, given=values, place=replace(place, on_table=None)))
        else:
            made = kind(**values)
    place.look_up(made)
    return made


def given_values(
    kind: Table, table: Mapping[str, Any], place: Place, *, complete: bool = False
) -> dict[str, Any]:
    """The values of the keys that a table gives, in the types of their annotations and in SI.

    Names are fields of a dataclass; for functions, keys of the document. A `complete` table has all that are required.
    """
    keys, declared = {entry.name_in_file: entry for entry in keys_of(kind)}, _nodes_in_file(kind)
    unknown = {name: meant(name, [*keys]) for name in table if name not in keys}
    misspelt = {near for names in unknown.values() for near in names}
    values = {}
    with all_mistakes() as part:
        for name, entry in keys.items():
            with part():
                if name in table:
                    where = place.within(name)
                    value = _read_value(declared[name], table[name], where, entry)
                    values[name if isinstance(kind, tuple) else entry.name] = value
                    _note_unusual(value, table[name], where, entry)
                elif complete and entry.is_required and name not in misspelt:
                    refuse_missing(entry, place)
        for name, near in unknown.items():
            with part():
                # A class may know better what was meant.
                meant_by = getattr(kind, "_meant_by", lambda *_: "")
                has = f"{place.table} has no key {name!r}{suggestion(name, [*keys], otherwise='it has')}"
                place.within(name).refuse(meant_by(name, table) or has)
            # What stands below a misspelt name is read as the table that is meant.
            if len(near) == 1 and inner_table(keys[near[0]])[0] is not None:
                with part():
                    _read_value(declared[near[0]], table[name], place.within(name), keys[near[0]])
    return values


def _note_unusual(read: Any, value: Any, place: Place, entry: Key) -> None:
    """Keep a remark on an unusual number of a key, or on the largest one of an array."""
    if not (usual := entry.says.usual):
        return
    numbers = [entry for entry in (read if isinstance(read, tuple) else (read,)) if isinstance(entry, float)]
    largest = max(map(abs, numbers), default=0.0)
    stated = any(isinstance(item, str) for item in (value if isinstance(value, list) else (value,)))
    # A number whose unit is stated has room.
    room, unit = 10.0 if stated else 1.0, entry.says.unit or "1"
    if 0.0 < largest < math.inf:
        name = str(place.path[-1])
        place.remarks.extend(unusual_number(name, largest, usual, unit, where=f"{place}: ", room=room))


@cache
def _nodes_in_file(kind: Table) -> Mapping[str, Hint]:
    """What each key of a table takes in a file, by its name there: numbers with units, and counts from one."""
    return {key.name_in_file: _node_in_file(_without_arrays(key.node), key) for key in keys_of(kind)}


def _without_arrays(node: Hint) -> Hint:
    """What a document has: lists of numbers in the place of arrays."""
    if node.form == "array":
        return Hint("items", tuple, (Hint("scalar", float, (), node.notes),), node.notes)
    return replace(node, parts=tuple(map(_without_arrays, node.parts)))


def _node_in_file(node: Hint, entry: Key, *, alone: bool = True) -> Hint:
    shifted = (entry.within if isinstance(note, Within) else note for note in node.notes)
    notes = tuple(shifted) if entry.says.from_one else node.notes
    if node.kind is float:
        # A text that stands for something else is no number with its unit.
        notes += (InUnit((entry.says.unit or "1") if alone else ""),)
    alone = not any(part.kind is str for part in node.parts)
    parts = tuple(_node_in_file(part, entry, alone=alone) for part in node.parts)
    kind = tuple if node.form == "items" else node.kind
    return replace(node, kind=kind, notes=notes, parts=parts)


def _read_value(node: Hint, value: Any, place: Place, entry: Key) -> Any:
    members = node.parts if node.form == "either" else (node,)
    table, several = inner_table(entry)
    if table is not None:
        alone = any(member.form == "record" for member in members)
        return _read_inner(table, value, place, entry, alone=alone, several=several)
    if isinstance(value, list) and not value:
        leave = "" if entry.is_required else ", or leave it out"
        place.refuse(f"{_name(place)} is empty; give {entry.in_words}{leave}")
    by_name = next((member for member in members if member.form == "by_name"), None)
    if by_name is not None and isinstance(value, dict):
        inner = by_name.parts[1]
        read = read_each(lambda name: _accept(inner, value[name], place.within(name)), value)
        return dict(zip(value, read, strict=True))
    accepted = _accept(node, value, place)
    if isinstance(accepted, tuple):
        rows = [row for row in accepted if isinstance(row, tuple)]
        for number, row in enumerate(rows):
            if len(row) != len(rows[0]):
                place.within(number).refuse(
                    f"{_name(place)} has rows of different lengths, {len(rows[0])} and {len(row)}; "
                    f"complete row {number + 1}"
                )
        return tuple(item - 1 for item in accepted) if entry.says.from_one else accepted
    return accepted - 1 if entry.says.from_one else accepted


def _read_inner(table: Table, value: Any, place: Place, entry: Key, *, alone: bool, several: bool) -> Any:
    """A table `alone`, or `several` of them; also as the value that it makes."""
    if isinstance(value, Arguments if isinstance(table, tuple) else table):
        place.look_up(value)
        return value
    if isinstance(value, dict) and alone:
        return read_table(cast(type[Any], table), value, place)
    if not (isinstance(value, list) and several):
        key, came = entry.name_in_file, "a table" if isinstance(value, dict) else quote_value(value)
        place.refuse(
            f"{_name(place)} is {came}; give {f'tables, as [[{key}]]' if several else f'a table [{key}]'}"
        )
    read = partial(_read_inner, table, entry=entry, alone=True, several=False)
    return tuple(read_each(lambda n: read(value[n], place.within(n)), range(len(value))))


def _accept(node: Hint, value: Any, place: Place) -> Any:
    try:
        return accept(node, value)
    except Refusal as refusal:
        where = place.within(*refusal.path)
        where.refuse(f"{_name(where)} {refusal.in_words(in_file=True)}")


def _name(place: Place) -> str:
    length = max(n for n, part in enumerate(place.path, start=1) if isinstance(part, str))
    return str(place.path[length - 1]) + "".join(f"[{number}]" for number in place.path[length:])


# Characters of a line of the printed schema.
_WIDTH = 110


def heading_lines(heading: str, prose: str) -> list[str]:
    """A heading of the printed schema and the prose below it."""
    words = " ".join(before_sections(prose).split())
    return [heading, *textwrap.wrap(words, _WIDTH, initial_indent="  ", subsequent_indent="  ")]


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyInWords:
    """A key as a schema lists it: its default or "required", its meaning, what it takes, and its unit if it has one."""

    name: str
    default: str
    meaning: str
    form: str
    unit: str


def prose_of(table: Table) -> str:
    """What a table is: the docstring of a dataclass, or first lines of functions with the keys that each has alone."""
    if not isinstance(table, tuple):
        return before_sections(inspect.getdoc(table) or "")
    first = ((inspect.getdoc(function) or "").partition("\n")[0].rstrip(".") for function in table)
    keys = (f" ({', '.join(names)})" if names else "" for names in own_keys(table))
    return " ".join(f"{line}{listed}." for line, listed in zip(first, keys, strict=True))


def keys_in_words(kind: Table) -> list[KeyInWords]:
    """The keys of a table, in order."""
    listed = []
    for entry in keys_of(kind):
        says = entry.says
        can_be = "" if says.span is None or says.span.free else "can be "
        file = " or the name of a text file" if says.matrix else ""
        form = [f"{hint_in_words(_without_arrays(entry.node), in_file=True)}{file}", entry.within.in_words]
        meaning = says.words if says.span is None else f"{says.words}; {can_be}searched by mrwork tune"
        listed.append(
            KeyInWords(
                name=entry.name_in_file,
                default=_default(entry),
                meaning=meaning,
                form=", ".join(filter(None, form)),
                unit=says.unit,
            )
        )
    return listed


def _default(entry: Key) -> str:
    value = entry.default
    if entry.is_required:
        return "required"
    if value is None or value in ("", ()) or is_dataclass(value):
        return "-"
    if isinstance(value, tuple):
        return ", ".join(map(str, value))
    if isinstance(value, bool | float):
        return str(value).lower() if isinstance(value, bool) else f"{value:g}"
    return str(as_document(value, from_one=entry.says.from_one))


def key_lines(keys: Sequence[KeyInWords]) -> list[str]:
    """Keys of a table, their meanings, defaults and forms."""
    names = max((len(entry.name) for entry in keys), default=0)
    defaults = max((len(entry.default) for entry in keys), default=0)
    lines = []
    for entry in keys:
        unit = f" [{entry.unit}]" if entry.unit else ""
        head = f"  {entry.name:<{names}}  {entry.default:<{defaults}}  "
        words, indent = f"{entry.meaning}{unit} ({entry.form})", " " * len(head)
        lines += textwrap.wrap(
            words, _WIDTH, initial_indent=head, subsequent_indent=indent, break_long_words=False
        )
    return lines
