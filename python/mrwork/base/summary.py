"""One summary of every result: its `repr`, what a verb prints, and HTML for a notebook or a section of a page.

A dataclass inherits `Summarised` and switches off its own `repr`; `_units` or `_summary` say what it shows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import partial
from textwrap import wrap
from typing import Any, ClassVar

from mrwork.base.numbers import format_rounded
from mrwork.base.remark import Remark
from mrwork.base.table import Table, escape

# Rows of a table and characters of a line that fit on one screen.
_MOST_ROWS = 16
_MOST_CHARACTERS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What a result says of itself: a title, facts by name, remarks, tables, and notes.

    Facts without a value and columns without an entry in any row are not shown.
    """

    title: str
    facts: Sequence[tuple[str, str]] = ()
    remarks: Sequence[Remark] = ()
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()

    @property
    def shown_facts(self) -> Sequence[tuple[str, str]]:
        """The facts that have a value."""
        return [(name, value) for name, value in self.facts if value]

    @property
    def shown_tables(self) -> Sequence[Table]:
        """The tables that have rows, of their columns with an entry."""
        return [
            replace(table.filled, label=table.label or table.title or self.title)
            for table in self.tables
            if table.rows
        ]

    @property
    def sentences(self) -> Sequence[str]:
        """Remarks, warnings first, and notes."""
        warnings_first = sorted(self.remarks, key=lambda remark: remark.severity != "warning")
        return [*(remark.in_words for remark in warnings_first), *filter(None, self.notes)]

    def text(self, *, whole: bool = False, width: int | None = None) -> str:
        """For one screen of a terminal; `whole` for all rows, and lines of any length, or of tables at most `width`."""
        lines = [self.title]
        longest = max((len(name) for name, _ in self.shown_facts), default=0)
        for name, value in self.shown_facts:
            line = f"  {name:<{longest}}  {value}"
            lines += (
                _lines_of(line, initial_indent="", subsequent_indent=" " * (longest + 4)) if whole else [line]
            )
        for table in self.shown_tables:
            shown, more = (table, "") if whole else _first_rows(table)
            lines += ["", *([f"  {table.title}"] if table.title else []), *shown.lines("  ", width=width)]
            lines += [f"  {more}"] if more else []
            lines += _lines_of(table.note)
        if not whole:
            most = _MOST_CHARACTERS
            lines = [line if len(line) <= most else f"{line[: most - 3]}..." for line in lines]
        elif self.sentences and self.shown_tables:
            lines.append("")
        # A remark must be read to its end.
        lines += [line for sentence in self.sentences for line in _lines_of(sentence)]
        return "\n".join(lines)

    def html(self) -> str:
        """HTML for a notebook: title, facts, first rows of the tables, remarks and notes."""
        facts = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(value)}</td></tr>"
            for name, value in self.shown_facts
        )
        parts = [f"<p><strong>{escape(self.title)}</strong></p>"]
        parts += [f"<table>{facts}</table>"] if facts else []
        for table, more in map(_first_rows, self.shown_tables):
            parts += [table.html(), *([f"<p>{more}</p>"] if more else [])]
        parts += [f"<p>{escape(sentence)}</p>" for sentence in self.sentences]
        return f"<div class='mrwork-summary'>{''.join(parts)}</div>"


# Names of files and options are not broken, so that they can be copied.
_lines_of = partial(
    wrap,
    width=_MOST_CHARACTERS,
    initial_indent="  ",
    subsequent_indent="    ",
    break_long_words=False,
    break_on_hyphens=False,
)


def _first_rows(table: Table) -> tuple[Table, str]:
    """As many rows of a table as are shown on one screen, and how many more there are, in words."""
    if len(table.rows) <= _MOST_ROWS:
        return table, ""
    shown = table.rows[: _MOST_ROWS - 1]
    return replace(table, rows=shown), f"... {len(table.rows) - len(shown)} more rows"


class Summarised:
    """A dataclass with a one-screen `repr`, and the same as HTML in a notebook.

    Its summary lists the fields, with the units that the class gives them; a class with more to say overrides it.
    """

    __slots__ = ()
    _units: ClassVar[Mapping[str, str]] = {}

    def _summary(self) -> Summary:
        names = [entry.name for entry in fields(self) if entry.repr]  # type: ignore[arg-type] # a dataclass
        values = [f"{_in_short(getattr(self, name))} {self._units.get(name, '')}".rstrip() for name in names]
        return Summary(title=type(self).__name__, facts=[*zip(names, values, strict=True)])

    def document(self) -> dict[str, Any]:
        """What `--json` of a verb prints of the result: by default its fields."""
        return asdict(self)  # type: ignore[call-overload,no-any-return] # a dataclass

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()


def named(value: object, *names: str) -> dict[str, Any]:
    """Attributes of a value by their names, as JSON has them."""
    return {name: getattr(value, name) for name in names}


def list_names(names: Sequence[str], most: int = 4) -> str:
    """Names in a row, the first few where there are many."""
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def _in_short(value: Any) -> str:
    """A value within a line: an array by its shape and range, a collection by its size, a result by its title."""
    if isinstance(value, Summarised):
        return value._summary().title
    if isinstance(value, float):
        return format_rounded(value, 6)
    if isinstance(value, str):
        return value.partition("\n")[0]
    if getattr(value, "shape", None):
        if 0 < value.size <= 4:
            return f"[{', '.join(f'{number:.4g}' for number in value.ravel().tolist())}]"
        size = f"shape {' x '.join(map(str, value.shape))}"
        if not value.size or value.dtype.kind not in "fiuc":
            return size
        magnitudes = abs(value) if value.dtype.kind == "c" else value
        words = "from" if magnitudes is value else "of magnitude"
        return f"{size}, {words} {magnitudes.min():.4g} to {magnitudes.max():.4g}"
    if isinstance(value, Mapping):
        return list_names([f"{name} {_in_short(entry)}" for name, entry in value.items()]) or "none"
    if isinstance(value, list | tuple):
        return list_names([_in_short(entry) for entry in value]) or "none"
    return type(value).__name__ if is_dataclass(value) or callable(value) else str(value)
