"""Tables of findings, each column stated once: its heading with the text of its cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from html import escape
from typing import Any

from markupsafe import Markup

from mrwork.report import Table, symbol

Cell = str | Callable[[Any], str]
"""Text of a cell: a function of what a row is about, or a format string of its keys, or of it if it is a number."""


def table_of(
    title: str,
    first: str,
    rows: Mapping[str, Any] | Iterable[tuple[str, Any]],
    columns: Mapping[str, Cell] | Iterable[tuple[str, Cell]],
    *,
    note: str = "",
) -> Table:
    """Table with a row for each name and what it is about; `first` heads the column of the names."""
    entries = rows.items() if isinstance(rows, Mapping) else rows
    headings, cells = zip(*(columns.items() if isinstance(columns, Mapping) else columns), strict=True)
    return Table(
        title=title,
        columns=(first, *headings),
        rows=tuple((name, *(_text(cell, about) for cell in cells)) for name, about in entries),
        note=note,
    )


def _text(cell: Cell, about: Any) -> str:
    if not isinstance(cell, str):
        return cell(about)
    return cell.format_map(about) if isinstance(about, Mapping) else cell.format(about)


def alike(form: str, keys: Mapping[str, str]) -> dict[str, Cell]:
    """Columns of numbers in one format, the key of each by its heading."""
    return {heading: f"{{{key}:{form}}}" for heading, key in keys.items()}


def with_symbols(tables: Iterable[Table]) -> list[Markup]:
    """Tables for a page, with the names of parameters as symbols."""
    return [Markup(table.html(_heading)) for table in tables]


def _heading(text: str) -> str:
    name, bracket, unit = text.partition(" [")
    return symbol(name) + escape(bracket + unit)
