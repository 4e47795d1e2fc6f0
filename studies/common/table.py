"""Tables of findings, each column stated once: its heading with the text of its cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from markupsafe import Markup

from mrwork.report import ResultTable

Cell = str | Callable[[Any], str]
"""Text of a cell: a function of what a row is about, or a format string of its keys."""


def table_of(
    title: str,
    first: str,
    rows: Mapping[str, Any] | Iterable[tuple[str, Any]],
    columns: Mapping[str, Cell],
    *,
    note: str = "",
) -> ResultTable:
    """Table with a row for each name and what it is about; `first` heads the column of the names."""
    entries = rows.items() if isinstance(rows, Mapping) else rows
    return ResultTable(
        title=title,
        header=(first, *columns),
        rows=tuple((name, *(_text(cell, each) for cell in columns.values())) for name, each in entries),
        note=note,
    )


def _text(cell: Cell, each: Any) -> str:
    return cell.format_map(each) if isinstance(cell, str) else cell(each)


def as_markup(tables: Iterable[ResultTable]) -> list[Markup]:
    """Tables for a page."""
    return [Markup(table.html()) for table in tables]


def sections_as_markup(tables: Mapping[str, Iterable[ResultTable]]) -> dict[str, list[Markup]]:
    """Tables for a page, by section."""
    return {name: as_markup(each) for name, each in tables.items()}
