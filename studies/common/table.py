"""Tables of findings, each column stated once: its heading with the text of its cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, Protocol

from markupsafe import Markup

from mrwork.report import ResultTable, symbol

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


class Renders(Protocol):
    """A table for a page."""

    def html(self) -> str:
        """The markup of the table."""
        ...


def as_markup(tables: Iterable[Renders]) -> list[Markup]:
    """Tables for a page."""
    return [Markup(table.html()) for table in tables]


def sections_as_markup(tables: Mapping[str, Iterable[Renders]]) -> dict[str, list[Markup]]:
    """Tables for a page, by section."""
    return {name: as_markup(each) for name, each in tables.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChapterTable:
    """Text in rows; the first column names the row, by the symbol of a parameter if `symbols`."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    symbols: bool = False

    def markdown(self) -> str:
        lines = [
            f"**{self.title}**",
            "",
            _line(self.header),
            _line(("---", *["---:"] * (len(self.header) - 1))),
        ]
        lines += [_line(row) for row in self.rows]
        return "\n".join([*lines, "", *([self.note, ""] if self.note else [])])

    def html(self) -> str:
        head = "".join(
            f'<th scope="col"{_number(place)}>{_heading(text)}</th>' for place, text in enumerate(self.header)
        )
        body = "".join(
            "<tr>"
            + "".join(
                f'<th scope="row">{symbol(text) if self.symbols else escape(text)}</th>'
                if place == 0
                else f"<td{_number(place)}>{_strong(text)}</td>"
                for place, text in enumerate(row)
            )
            + "</tr>"
            for row in self.rows
        )
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        return (
            f'<h3>{escape(self.title)}</h3><div class="scroll" tabindex="0" role="region" '
            f'aria-label="{escape(self.title)}"><table><thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>{note}"
        )


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"


def _number(place: int) -> str:
    return ' class="number"' if place else ""


def _heading(text: str) -> str:
    name, bracket, unit = text.partition(" [")
    # A parameter's name is one word, RMS aside.
    if not name or " " in name or "-" in name or name == "RMS":
        return escape(text)
    return f"{symbol(name)}{escape(bracket + unit)}"


def _strong(text: str) -> str:
    return f"<strong>{text[2:-2]}</strong>" if text.startswith("**") else escape(text)
