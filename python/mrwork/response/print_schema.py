"""The schema of a study as people read it, from the declarations that the reader goes by."""

from __future__ import annotations

import math
import types
from collections.abc import Iterator, Mapping
from dataclasses import Field, fields, is_dataclass
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from mrwork.response.declared import is_required
from mrwork.response.schema import StudyTable

_WORDS = {str: "text", float: "number", int: "whole number", bool: "true or false", Any: "any"}


def schema_text() -> str:
    """Every table with its keys, what they are, their units and defaults."""
    blocks = []
    for heading, kind in tables():
        says = " ".join((kind.__doc__ or "").split())
        blocks.append("\n".join([heading or "at the top", f"  {says}", *_key_lines(kind)]))
    return "\n\n".join(blocks)


def tables(kind: type = StudyTable, path: str = "") -> Iterator[tuple[str, type]]:
    """Headings and declarations of all tables, outer ones first."""
    yield path, kind
    for entry, hint in _keys(kind):
        inner, repeated = _inner(hint)
        if inner is not None:
            name = f"{path.strip('[]')}.{entry.name}" if path else entry.name
            yield from tables(inner, f"[[{name}]]" if repeated else f"[{name}]")


def _keys(kind: type) -> list[tuple[Field[Any], Any]]:
    hints = get_type_hints(kind)
    return [(entry, hints[entry.name]) for entry in fields(cast(Any, kind)) if entry.name != "place"]


def _inner(hint: Any) -> tuple[type | None, bool]:
    """The table that a key holds, and whether it may hold several."""
    if is_dataclass(hint):
        return cast(type, hint), False
    for each in get_args(hint):
        if is_dataclass(each):
            return cast(type, each), get_origin(hint) is tuple
    return None, False


def _key_lines(kind: type) -> list[str]:
    rows = []
    for entry, hint in _keys(kind):
        unit = entry.metadata["unit"]
        rows.append(
            (
                entry.name,
                in_words(hint) + (f" [{unit}]" if unit else ""),
                _default(entry),
                entry.metadata["says"],
            )
        )
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    return [
        "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, [*widths, 0], strict=True)).rstrip()
        for row in rows
    ]


def _default(entry: Field[Any]) -> str:
    if is_required(entry):
        return "required"
    value = entry.default
    if value is None or value in ("", ()) or is_dataclass(value):
        return "-"
    if isinstance(value, bool):
        return str(value).lower()
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
    if origin is tuple:
        return "tables" if is_dataclass(arguments[0]) else f"array of {in_words(arguments[0])}s"
    if origin in (dict, Mapping) or hint is Mapping:
        inner = in_words(arguments[1])
        return "table" if inner == "any" else f"table of {inner}"
    return _WORDS[hint]
