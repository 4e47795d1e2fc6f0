"""The schema of a study file and the control laws as text, from their declarations."""

from __future__ import annotations

import inspect
import math
import textwrap
import types
from collections.abc import Iterator, Mapping
from dataclasses import Field, is_dataclass
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from mrwork.buildings import from_file
from mrwork.control.law_design import SETTINGS
from mrwork.control.laws import control_laws
from mrwork.control.weights import WeightWishes
from mrwork.keys import is_required, keys_of, range_in_words
from mrwork.study.arrangements import CONSTANT_LAWS
from mrwork.study.schema import StudyTable

_WIDTH = 110
_WORDS = {str: "text", float: "number", int: "whole number", bool: "true or false", Any: "any"}


def schema_text() -> str:
    """Every table with its keys, their meanings, units and defaults, for `mrwork respond --schema`."""
    blocks = []
    for heading, kind in tables():
        prose = textwrap.wrap(
            " ".join((kind.__doc__ or "").split()), width=_WIDTH, initial_indent="  ", subsequent_indent="  "
        )
        blocks.append("\n".join([heading or "at the top", *prose, *key_lines(kind)]))
        if kind is StudyTable:
            blocks.append("\n".join(["[building]", *_building_lines()]))
    return "\n\n".join(blocks)


def laws_text() -> str:
    """Every control law with its equation, source and settings, for `mrwork respond --laws`."""
    blocks = []
    for spec in control_laws():
        prose = [
            line
            for text in (spec.description, spec.source)
            for line in textwrap.wrap(text, width=_WIDTH, initial_indent="  ", subsequent_indent="  ")
        ]
        lines = [f"{spec.name}: {spec.title}", *(f"  {line}" for line in spec.equation.splitlines()), *prose]
        settings = [f"  {line}" for line in key_lines(SETTINGS[spec.name])]
        blocks.append("\n".join([*lines, *(["  settings", *settings] if settings else [])]))
    prose = textwrap.wrap(
        " ".join((WeightWishes.__doc__ or "").split()), _WIDTH, initial_indent="  ", subsequent_indent="  "
    )
    lines = [f"  {line}" for line in key_lines(WeightWishes)]
    blocks.append("\n".join(["designed: table among the settings of a law with weights", *prose, *lines]))
    blocks += [f"{name}: {law.description}; no settings" for name, law in CONSTANT_LAWS.items()]
    return "\n\n".join(blocks)


def _building_lines() -> list[str]:
    """The keys of a building, from the docstring of the module that reads them."""
    lines = (inspect.getdoc(from_file) or "").splitlines()
    rules = [number for number, line in enumerate(lines) if line.startswith("==")]
    return [f"  {line}" for line in lines[rules[1] + 1 : rules[-1]]]


def tables(kind: type = StudyTable, path: str = "") -> Iterator[tuple[str, type]]:
    """Headings and declarations of all tables, outer tables first."""
    yield path, kind
    for entry, hint in _keys(kind):
        inner, repeated = _inner(hint)
        if inner is not None:
            name = f"{path.strip('[]')}.{entry.name}" if path else entry.name
            yield from tables(inner, f"[[{name}]]" if repeated else f"[{name}]")


def _keys(kind: type) -> list[tuple[Field[Any], Any]]:
    hints = get_type_hints(kind)
    return [(entry, hints[entry.name]) for entry in keys_of(kind)]


def _inner(hint: Any) -> tuple[type | None, bool]:
    """The table that a key holds, and whether it may hold several."""
    if is_dataclass(hint):
        return cast(type, hint), False
    for each in get_args(hint):
        if is_dataclass(each):
            return cast(type, each), get_origin(hint) is tuple
    return None, False


def key_lines(kind: type) -> list[str]:
    """The keys of a table, their meanings, defaults and types."""
    keys = _keys(kind)
    if not keys:
        return []
    names = max(len(entry.name) for entry, _ in keys)
    defaults = max(len(_default(entry)) for entry, _ in keys)
    lines = []
    for entry, hint in keys:
        unit = entry.metadata["unit"]
        form = f"{in_words(hint)}{' or name of a text file' if entry.metadata['matrix'] else ''}"
        bounds = f", {words}" if (words := range_in_words(entry)) else ""
        meaning = f"{entry.metadata['says']} ({form}{f' [{unit}]' if unit else ''}{bounds}){_searched(entry)}"
        head = f"  {entry.name:<{names}}  {_default(entry):<{defaults}}  "
        lines += textwrap.wrap(
            meaning,
            width=_WIDTH,
            initial_indent=head,
            subsequent_indent=" " * len(head),
            break_long_words=False,
        )
    return lines


def _searched(entry: Field[Any]) -> str:
    """Whether a search of settings changes the key by itself, or where it is asked to."""
    span = entry.metadata["span"]
    return (
        ""
        if span is None
        else "; searched by mrwork tune"
        if span.free
        else "; can be searched by mrwork tune"
    )


def _default(entry: Field[Any]) -> str:
    if is_required(entry):
        return "required"
    value = entry.default
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
