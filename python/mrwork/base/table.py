"""Tables of text for every medium: the lines of a terminal, a page or notebook, and CSV.

The module is below all results, because these yield tables, which summaries, verbs, pages and studies show. Lines are
aligned here and not by `rich`, whose import takes longer than most results take to compute.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from itertools import zip_longest
from typing import Any

import markupsafe

from mrwork.base.numbers import NOTHING, in_plain, significant
from mrwork.errors import escape_text


@dataclass(frozen=True, slots=True)
class Column:
    """What every row of a result has, declared once for its tables, its JSON, its arrays and its page.

    `key` is the name in JSON and arrays, and the attribute of a row unless `of` takes the value. A column without a
    heading is in no table, one without `words`, which say what it is, in no arrays. `shown` is the text of a value, or
    how many significant digits a number has.
    """

    key: str = ""
    heading: str = ""
    unit: str = ""
    words: str = ""
    shown: Callable[[Any], str] | int = 4
    of: Callable[[Any], Any] | None = None

    def value(self, row: Any) -> Any:
        """The value of a row."""
        return self.of(row) if self.of else getattr(row, self.key)

    def cell(self, row: Any) -> str:
        """The value of a row as text."""
        value = self.value(row)
        if not isinstance(self.shown, int):
            return self.shown(value)
        return significant(value, self.shown) if isinstance(value, float | None) else str(value)


def as_json(columns: Iterable[Column], row: Any) -> dict[str, Any]:
    """The values of a row by the keys of the columns; records as dictionaries."""
    values = {column.key: column.value(row) for column in columns if column.key}
    return {
        key: asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
        for key, value in values.items()
    }


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Table:
    """Text or markup in rows; the first column names the row, others are of numbers or of words, as their cells are.

    The units of the columns, where they are given, stand behind the headings as the medium writes them. A table has a
    `title` above it, or a `label` for screen readers only; a `note` stands below. `over` are headings above the
    columns, each with the number of columns that it spans; `headings` are headings above rows, by the number of the
    row; `foot` is a last row. `strong` are the cells (row, column) in bold, `alarming` those in the colour of warnings.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    units: Sequence[str] = ()
    title: str = ""
    label: str = ""
    foot: tuple[str, ...] = ()
    note: str = ""
    over: tuple[tuple[str, int], ...] = ()
    strong: frozenset[tuple[int, int]] = frozenset()
    alarming: frozenset[tuple[int, int]] = frozenset()
    headings: Mapping[int, str] = field(default_factory=dict)

    @classmethod
    def of(cls, columns: Iterable[Column], rows: Iterable[Any], *, label: str = "", note: str = "") -> Table:
        """A table with a row for each item, of the columns that have a heading and an entry in some row."""
        shown = [column for column in columns if column.heading]
        return cls(
            columns=[column.heading for column in shown],
            units=[column.unit for column in shown],
            rows=[[column.cell(row) for column in shown] for row in rows],
            label=label,
            note=note,
        ).filled

    @property
    def filled(self) -> Table:
        """The table without the columns that are empty in every row; as it is where marks or headings count columns."""
        if self.over or self.strong or self.alarming:
            return self
        cells = enumerate(zip(*self.rows, strict=True))
        numbers = [number for number, column in cells if {*column} - {"", NOTHING}]
        return replace(
            self,
            columns=tuple(self.columns[number] for number in numbers),
            units=tuple(self.units[number] for number in numbers) if self.units else (),
            rows=tuple(tuple(row[number] for number in numbers) for row in self.rows),
            foot=tuple(self.foot[number] for number in numbers) if self.foot else (),
        )

    def lines(self, indent: str = "", *, width: int | None = None) -> list[str]:
        """Columns, rows with their headings, and foot as aligned lines, each after `indent`.

        The last columns are left out, and named in a last line, where the lines would be longer than `width`.
        """
        inset = "  " if self.headings else ""
        rows = [(f"{inset}{row[0]}", *row[1:]) for row in self.rows]
        heads = self._heads(" [{}]")
        cells = [heads, *rows, *([self.foot] if self.foot else [])]
        count = len(self.columns)
        lines = _align_rows(cells)
        while width is not None and count > 2 and max(map(len, lines)) > width:
            count -= 1
            lines = _align_rows([row[:count] for row in cells])
        for row, heading in sorted(self.headings.items(), reverse=True):
            lines.insert(1 + row, heading)
        over, column = "", 0
        for text, span in self.over:
            if text and column < count:
                # Each above the first column that it spans.
                start = sum(2 + max(len(row[index]) for row in cells) for index in range(column))
                over = f"{over:<{start}}{text if column else ''}  "
            column += span
        left_out = ", ".join(heads[count:])
        notes = [f"Too wide for a terminal, and on the page: {left_out}"] if left_out else []
        return [
            f"{indent}{line}".replace("²", "2")
            for line in (*filter(str.strip, [over.rstrip()]), *lines, *notes)
        ]

    def _heads(self, with_unit: str) -> list[str]:
        pairs = zip_longest(self.columns, self.units, fillvalue="")
        return [f"{heading}{with_unit.format(unit) if unit else ''}" for heading, unit in pairs]

    def __repr__(self) -> str:
        return "\n".join(filter(None, (self.title, *self.lines("  "), self.note)))

    def html(self) -> str:
        """The table for a page, in a region that scrolls."""
        words = _columns_in_words(self.rows)

        def capital(text: str) -> str:
            """A heading that was declared in small letters, as it begins a column."""
            return f"{text[:1].upper()}{text[1:]}" if self.units else text

        def kind(column: int, row: int | None = None, text: str = "") -> str:
            """Attribute of a cell in a column, and in a row unless it is a heading or of the foot."""
            in_words = "reason" if len(text) > 40 and row is not None else ""
            names = (
                in_words if column in words else "number",
                "strong" if (row, column) in self.strong else "",
                "remark" if (row, column) in self.alarming else "",
            )
            classes = " ".join(filter(None, names))
            return f' class="{classes}"' if classes else ""

        def line(name: str, cells: Sequence[str], row: int | None = None) -> str:
            rest = (
                f"<td{kind(column, row, text)}>{escape(text)}</td>"
                for column, text in enumerate(cells[1:], start=1)
            )
            return f'<tr><th scope="row" class="name">{name}</th>{"".join(rest)}</tr>'

        lines = [f"<h3>{escape(self.title)}</h3>"] if self.title else []
        region = f'tabindex="0" role="region" aria-label="{escape(self.label or self.title)}"'
        lines += [f'<div class="scroll" {region}>', "<table>", "<thead>"]
        if self.over:
            spans = (f'<th scope="colgroup" colspan="{n}">{_heading(text)}</th>' for text, n in self.over)
            lines.append(f'<tr class="over">{"".join(spans)}</tr>')
        heads = (
            f'<th scope="col"{kind(column) if column else ""}>{_heading(capital(text))}</th>'
            for column, text in enumerate(self._heads(" ({})"))
        )
        lines += [f"<tr>{''.join(heads)}</tr></thead>", "<tbody>"]
        for row, cells in enumerate(self.rows):
            if row in self.headings:
                heading = f'<th scope="rowgroup" colspan="{len(cells)}">{escape(self.headings[row])}</th>'
                lines.append(f'<tr class="rank">{heading}</tr>')
            lines.append(line(breakable(cells[0]), cells, row))
        lines.append("</tbody>")
        if self.foot:
            lines += ["<tfoot>", line(escape(self.foot[0]), self.foot), "</tfoot>"]
        lines += ["</table>", "</div>"]
        if self.note:
            lines.append(f'<p class="note">{format_code(self.note)}</p>')
        return "\n".join(lines)

    # A template shows a table by its name, and so does a notebook.
    __html__ = html
    _repr_html_ = html


def csv_text(rows: Iterable[Sequence[str]]) -> str:
    """Rows as the text of a CSV file; the first has the headings."""
    target = io.StringIO()
    csv.writer(target, lineterminator="\n").writerows(rows)
    return target.getvalue()


def _align_rows(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells as lines: the first column to the left, others to the right where all their cells are numbers."""
    rows = [[in_plain(escape_text(cell)) for cell in row] for row in rows]
    columns = list(zip(*rows, strict=True))
    words = _columns_in_words(rows[1:])
    widths = [max(map(len, column)) for column in columns]
    return [
        "  ".join(
            cell.ljust(width) if column in words or not column else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _columns_in_words(rows: Sequence[Sequence[str]]) -> tuple[int, ...]:
    columns = zip(*rows, strict=True)
    return tuple(index for index, column in enumerate(columns) if index and not all(map(_is_numeric, column)))


def _is_numeric(cell: str) -> bool:
    shown = markupsafe.Markup(cell).striptags() if hasattr(cell, "__html__") else cell
    return shown in ("", "-", NOTHING, "open", "∞") or shown.lstrip("+-−–.<> ")[:1].isdigit()


def escape(text: str) -> str:
    """HTML of a text; markup stays as it is."""
    return str(markupsafe.escape(text))


def breakable(name: str) -> str:
    """HTML of a name that may be broken after an underscore, but not between number and unit; of markup, itself."""
    if hasattr(name, "__html__"):
        return escape(name)
    return re.sub(r"(?<=\d) (?=[A-Za-z]{1,2}\b)", "\N{NO-BREAK SPACE}", escape(name)).replace("_", "_<wbr>")


def _heading(text: str) -> str:
    """HTML of a heading that may be broken, but not within its unit or an equation."""
    bound = re.compile(r"\([^()]*\)$|\w = \d")
    return bound.sub(lambda part: part.group().replace(" ", "\N{NO-BREAK SPACE}"), escape(text))


def format_code(sentence: str) -> str:
    """HTML of a sentence with `commands` between backticks; a per cent sign and `i = 0` are not broken apart."""
    bound = escape(sentence).replace(" %", "\N{NO-BREAK SPACE}%")
    bound = bound.replace("i = 0", "i\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}0")
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", bound)
