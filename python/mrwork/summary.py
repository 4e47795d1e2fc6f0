"""One-screen summaries of results: text for a terminal, HTML for a notebook.

A class inherits `Summarised`, switches off the `repr` of its dataclass and says in `_summary` what it shows. Tables of
text are aligned here and not by `rich`, whose import takes longer than most results take to compute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

# Rows of a table and characters of a line that fit on one screen.
_MOST_ROWS = 16
_MOST_CHARACTERS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What a result says of itself: a title, facts by name, a table, and notes below it."""

    title: str
    facts: Sequence[tuple[str, str]] = ()
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()

    @property
    def shown(self) -> Sequence[Sequence[str]]:
        """The rows that fit on a screen."""
        return self.rows if len(self.rows) <= _MOST_ROWS else self.rows[: _MOST_ROWS - 1]

    @property
    def left_out(self) -> str:
        """How many rows are not shown, in words; empty where all are."""
        more = len(self.rows) - len(self.shown)
        return f"... {more} more rows" if more else ""

    def text(self) -> str:
        """For a terminal."""
        lines = [self.title]
        width = max((len(name) for name, _ in self.facts), default=0)
        lines += [f"  {name:<{width}}  {value}" for name, value in self.facts]
        if self.rows:
            lines += ["", *(f"  {line}" for line in aligned([self.columns, *self.shown]))]
        lines += [f"  {note}" for note in (self.left_out, *self.notes) if note]
        return "\n".join(_cut(line) for line in lines)

    def html(self) -> str:
        """For a notebook."""
        from html import escape  # loads the table of all entities, which a script does not need

        facts = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(value)}</td></tr>"
            for name, value in self.facts
        )
        parts = [f"<p><strong>{escape(self.title)}</strong></p>"]
        if facts:
            parts.append(f"<table>{facts}</table>")
        if self.rows:
            head = "".join(f"<th>{escape(column)}</th>" for column in self.columns)
            body = "".join(
                f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in self.shown
            )
            parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")
        parts += [f"<p>{escape(note)}</p>" for note in (self.left_out, *self.notes) if note]
        return f"<div class='mrwork-summary'>{''.join(parts)}</div>"


class Summarised:
    """A result with a one-screen `repr`, and the same as HTML in a notebook."""

    __slots__ = ()

    def _summary(self) -> Summary:
        raise NotImplementedError

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells as lines: the first column to the left, others to the right where all their cells are numbers."""
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


def rounded(value: float | None, digits: int = 4) -> str:
    """A number with `digits` significant digits; a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


def with_decimals(value: float, decimals: int) -> str:
    """A number with `decimals` decimals; a dash where it is not known."""
    return "-" if isnan(value) else f"{value:.{decimals}f}"


def of_unit(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with its unit."""
    return f"{rounded(value, digits)} {unit}".rstrip()


def listed(names: Sequence[str], most: int = 4) -> str:
    """Names in a row, the first few where there are many."""
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def _is_numeric(cell: str) -> bool:
    return cell in ("", "-", "–", "open", "∞") or cell.lstrip("+-−.")[:1].isdigit()


def _cut(line: str) -> str:
    return line if len(line) <= _MOST_CHARACTERS else f"{line[: _MOST_CHARACTERS - 3]}..."
