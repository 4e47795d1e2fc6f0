"""Tables of findings, each column stated once: its heading with the text of its cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from html import escape
from typing import Any

from markupsafe import Markup

from mrwork.report import Table, symbol

Cell = str | Callable[[Any], str]
"""Text of a cell: a function of what a row is about, or a format string of its keys."""


def table_of(
    title: str,
    first: str,
    rows: Mapping[str, Any] | Iterable[tuple[str, Any]],
    columns: Mapping[str, Cell],
    *,
    note: str = "",
) -> Table:
    """Table with a row for each name and what it is about; `first` heads the column of the names."""
    entries = rows.items() if isinstance(rows, Mapping) else rows
    return Table(
        title=title,
        columns=(first, *columns),
        rows=tuple((name, *(_text(cell, each) for cell in columns.values())) for name, each in entries),
        note=note,
    )


def _text(cell: Cell, each: Any) -> str:
    return cell.format_map(each) if isinstance(cell, str) else cell(each)


def with_symbols(tables: Iterable[Table]) -> list[Markup]:
    """Tables for a page, with the names of parameters as symbols."""
    return [Markup(table.html(_heading)) for table in tables]


def _heading(text: str) -> str:
    name, bracket, unit = text.partition(" [")
    return symbol(name) + escape(bracket + unit)
