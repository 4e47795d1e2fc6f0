"""One-screen summaries of results: text for a terminal, HTML for a notebook.

A dataclass inherits `Summarised` and switches off its own `repr`; `_units` or `_summary` say what it shows. Tables of
text are aligned here and not by `rich`, whose import takes longer than most results take to compute.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from textwrap import wrap
from typing import Any, ClassVar

from mrwork.base.numbers import format_rounded
from mrwork.errors import escape_text

# Rows of a table and characters of a line that fit on one screen.
_MOST_ROWS = 16
_MOST_CHARACTERS = 100
# Largest array that is shown by its numbers.
_FEW_NUMBERS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What a result says of itself: a title, facts by name, a table, and notes below it.

    Facts without a value and columns without an entry in any row are not shown.
    """

    title: str
    facts: Sequence[tuple[str, str]] = ()
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()

    @property
    def shown_rows(self) -> Sequence[Sequence[str]]:
        """The rows that fit on a screen."""
        return self.rows if len(self.rows) <= _MOST_ROWS else self.rows[: _MOST_ROWS - 1]

    @property
    def shown_facts(self) -> Sequence[tuple[str, str]]:
        """The facts that have a value."""
        return [(name, value) for name, value in self.facts if value]

    def filled_columns(self, rows: Sequence[Sequence[str]]) -> Sequence[Sequence[str]]:
        """The header and these rows, of the columns that have an entry in any row."""
        filled = [number for number in range(len(self.columns)) if any(row[number] for row in self.rows)]
        return [[row[number] for number in filled] for row in (self.columns, *rows)]

    @property
    def left_out_in_words(self) -> str:
        """How many rows are not shown, in words; empty where all are."""
        more = len(self.rows) - len(self.shown_rows)
        return f"... {more} more rows" if more else ""

    def text(self) -> str:
        """For a terminal."""
        lines = [self.title]
        width = max((len(name) for name, _ in self.shown_facts), default=0)
        lines += [f"  {name:<{width}}  {value}" for name, value in self.shown_facts]
        if self.rows:
            lines += ["", *(f"  {line}" for line in align_rows(self.filled_columns(self.shown_rows)))]
        lines += [f"  {self.left_out_in_words}"] if self.left_out_in_words else []
        lines = [
            line if len(line) <= _MOST_CHARACTERS else f"{line[: _MOST_CHARACTERS - 3]}..." for line in lines
        ]
        for note in self.notes:
            # A warning must be read to its end.
            lines += wrap(note, _MOST_CHARACTERS, initial_indent="  ", subsequent_indent="    ")
        return "\n".join(lines)

    def html(self) -> str:
        """For a notebook."""
        from html import escape  # loads the table of all entities, which a script does not need

        facts = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(value)}</td></tr>"
            for name, value in self.shown_facts
        )
        parts = [f"<p><strong>{escape(self.title)}</strong></p>"]
        if facts:
            parts.append(f"<table>{facts}</table>")
        if self.rows:
            columns, *rows = self.filled_columns(self.shown_rows)
            head = "".join(f"<th>{escape(column)}</th>" for column in columns)
            body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
            parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
        parts += [f"<p>{escape(note)}</p>" for note in (self.left_out_in_words, *self.notes) if note]
        return f"<div class='mrwork-summary'>{''.join(parts)}</div>"


class Summarised:
    """A dataclass with a one-screen `repr`, and the same as HTML in a notebook.

    Its summary lists the fields, with the units that the class gives them; a class with more to say overrides it.
    """

    __slots__ = ()
    _units: ClassVar[Mapping[str, str]] = {}

    def _summary(self) -> Summary:
        values = {each.name: getattr(self, each.name) for each in fields(self) if each.repr}  # type: ignore[arg-type] # a dataclass
        return Summary(
            title=type(self).__name__,
            facts=[
                (name, f"{_in_short(value)} {self._units.get(name, '')}".rstrip())
                for name, value in values.items()
            ],
        )

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()


def align_rows(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells as lines: the first column to the left, others to the right where all their cells are numbers."""
    rows = [[escape_text(cell) for cell in row] for row in rows]
    columns = list(zip(*rows, strict=True))
    numeric = [number > 0 and all(map(_is_numeric, column[1:])) for number, column in enumerate(columns)]
    widths = [max(map(len, column)) for column in columns]
    return [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        ).rstrip()
        for row in rows
    ]


def list_names(names: Sequence[str], most: int = 4) -> str:
    """Names in a row, the first few where there are many."""
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def _in_short(value: object) -> str:
    """A value within a line: an array by its shape and range, a collection by its size, a result by its title."""
    if isinstance(value, Summarised):
        return value._summary().title
    if isinstance(value, float):
        return format_rounded(value, 6)
    if isinstance(value, str):
        return value.partition("\n")[0]
    shape = getattr(value, "shape", None)
    if shape:
        return _array_in_short(value, shape)
    if isinstance(value, Mapping):
        return list_names([f"{name} {_in_short(entry)}" for name, entry in value.items()]) or "none"
    if isinstance(value, list | tuple):
        return list_names([_in_short(entry) for entry in value]) or "none"
    return type(value).__name__ if is_dataclass(value) or callable(value) else str(value)


def _array_in_short(values: Any, shape: tuple[int, ...]) -> str:
    size = " x ".join(map(str, shape))
    if not values.size:
        return f"shape {size}"
    if values.size <= _FEW_NUMBERS:
        return f"[{', '.join(f'{each:.4g}' for each in values.ravel().tolist())}]"
    if values.dtype.kind == "c":
        return f"shape {size}, of magnitude {abs(values).min():.4g} to {abs(values).max():.4g}"
    if values.dtype.kind not in "fiu":
        return f"shape {size}"
    return f"shape {size}, from {values.min():.4g} to {values.max():.4g}"


def _is_numeric(cell: str) -> bool:
    return cell in ("", "-", "–", "open", "∞") or cell.lstrip("+-−.")[:1].isdigit()
