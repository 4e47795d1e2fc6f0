"""Rows of numbers of a text table, read by NumPy block by block; line by line only the blocks that NumPy refuses.

Both ways must read the same in every cell that NumPy takes; rows of which this is not certain are left alone.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import counted
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import RecordError
from mrwork.files.layout import DECIMAL_COMMA, MISSING, NUMBER, RULE, split


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Cells of the table of a file: the file for messages, the names of the columns, and the delimiter."""

    source: str
    names: tuple[str, ...]
    delimiter: str | None

    def of_line(self, line: str) -> list[str]:
        """Fields of a row without its remark; empty ones at its end that have no name are left out."""
        fields = [field.strip() for field in split(line.partition("#")[0], self.delimiter)]
        while len(fields) > len(self.names) and not fields[-1]:
            fields.pop()
        return fields

    def refuse_width(self, line: int, n_fields: int) -> NoReturn:
        """Refuse a line, counted from 1, for its number of fields."""
        hint = (
            "these may be decimal commas between commas: export with decimal points, or with semicolons between "
            "the columns"
            if self.delimiter == "," and n_fields > len(self.names)
            else "complete or delete the line"
        )
        raise RecordError(
            f"{self.source}: line {line} has {counted(n_fields, 'field')} where the header "
            f"names {counted(len(self.names), 'column')}; {hint}"
        )

    def refuse_text(self, line: int, column: int, text: str, expected: str = "a number") -> NoReturn:
        """Refuse a cell that is not as `expected`, in a line counted from 1 and a column counted from 0."""
        where = f"{self.source}: line {line}, column '{self.names[column]}'"
        shown = text if len(text) <= 40 else text[:40] + "..."
        raise RecordError(
            f"{where} holds '{shown}' where {expected} was expected; correct or delete the line"
        )


def number_in(text: str, *, with_commas: bool) -> float | None:
    """Number of a cell, NaN where it is missing; `None` if it is neither."""
    if NUMBER.fullmatch(text):
        return float(text)
    if text.casefold() in MISSING:
        return float("nan")
    if with_commas and DECIMAL_COMMA.fullmatch(text):
        return float(text.replace(",", "."))
    return None


# Bytes of the rows that are read at once.
_BLOCK: Final = 1 << 17
# Blanks but the ends of lines, as in `str.isspace`.
_BLANKS: Final = rb"[ \t\v\f\x1c-\x1f]*"
_EMPTY_LINE: Final = re.compile(rb"\n" + _BLANKS + rb"(?:#[^\n]*)?(?=\n|\Z)")
# Characters of numbers, of words for a missing one, and between fields: a line that has others is no row of numbers,
# whatever separates its fields.
_OF_NUMBERS: Final = b"0123456789+-.,eE infityaulo/INFITYAULO\t;\"'"
# Read by NumPy, but not line by line.
_SIGNED_WORD: Final = re.compile(rb"[nN](?<=[+-][nN])[aA][nN]")
_WORDS: Final = b"|".join(re.escape(word).encode() for word in sorted(MISSING, reverse=True) if word)
_ASCII: Final = bytes(range(128))
# For NumPy, other characters are one that is in no number.
_AS_ASCII: Final = _ASCII + 128 * b"?"
# Characters beyond ASCII that numbers may have, or that may separate fields.
_LIKE_ASCII: Final = re.compile(r"[\s\d]")


@dataclass(frozen=True, slots=True, kw_only=True)
class RowForm:
    """Form of the rows of a table.

    `texts` are the columns that are not read, each with the first row, and its text, that is no number; `n_empty`
    nameless fields end every row; `header` is the stripped line of the names, `None` where it cannot be repeated.
    """

    cells: Cells
    texts: Mapping[int, tuple[int, str]]
    n_empty: int
    header: bytes | None

    @property
    def numbers(self) -> frozenset[int]:
        """Places of the columns that are read."""
        return frozenset(range(len(self.cells.names))).difference(self.texts)


@array_dataclass()
class Rows:
    """Parsed rows: columns of shape (n_rows,) by place, and the fault that must be refused.

    `width` are the first row with another number of fields and that number; where there is one, nothing else was read.
    `no_numbers` are the first row, and its text, of each column with a cell that is no number.
    """

    n_rows: int
    columns: Mapping[int, Floats] = field(default_factory=dict)
    width: tuple[int, int] | None = None
    no_numbers: Mapping[int, tuple[int, str]] = field(default_factory=dict)


def without_empty_lines(data: bytes) -> tuple[bytes, NDArray[np.int64]]:
    """Lines of a text that are neither blank nor a comment, and the indices of the others."""
    lines = b"\n" + data
    kept: list[bytes] = []
    dropped: list[int] = []
    stop = index = 0
    for line in _EMPTY_LINE.finditer(lines):
        kept.append(lines[max(stop, 1) : line.start()])
        index += lines.count(b"\n", stop, line.start())
        dropped.append(index)
        index += 1
        stop = line.end()
    if dropped:
        if stop < len(lines):
            kept.append(lines[stop:])
        data = b"".join(kept).removeprefix(b"\n")
    return data, np.array(dropped, dtype=np.int64)


def read_rows(rows: bytes, form: RowForm) -> Rows | None:
    """Read rows without comments and blank lines; `None` where all lines must be looked at one by one."""
    delimiter = form.cells.delimiter
    with_quotes, with_remarks, with_commas = b'"' in rows, b"#" in rows, delimiter != "," and b"," in rows
    # Most files have no such letter, which is seen faster than the pattern is searched.
    with_signs = (b"n" in rows or b"N" in rows) and _SIGNED_WORD.search(rows) is not None
    alike = not with_signs and not (delimiter is None and with_quotes)
    if (
        form.n_empty < 0
        or (with_commas and b"." in rows)
        or (with_remarks and (with_quotes or form.texts))
        # For NumPy, a quote after a blank is a character.
        or (form.texts and b' "' in rows)
        or ((form.texts or with_commas) and not alike)
        or (form.texts and b"\n\n" in b"\n" + rows.translate(None, _OF_NUMBERS) + b"\n")
        # A character beyond ASCII that may be of a number, or between fields.
        or (not rows.isascii() and _LIKE_ASCII.search(rows.translate(None, _ASCII).decode()))
    ):
        return None
    # A quoted field may contain the end of a line, and a header that is repeated changes what is a row.
    one_by_one = alike and not with_quotes and (form.header is None or form.header not in rows)
    n_rows = rows.count(b"\n") + 1
    # Whether commas among texts are decimal ones is seen in all cells that are requested.
    no_numbers = {} if with_quotes or with_commas else dict(form.texts)
    columns = {place: np.empty(n_rows) for place in form.numbers}
    n_before = 0
    for block in [rows] if with_quotes else _blocks(rows):
        text = block.translate(_AS_ASCII)
        if with_commas:
            text = text.replace(b",", b".")
        part = None if form.n_empty else _by_numpy(text, form)
        if part is None and alike:
            part = _by_numpy(_without_gaps(text, form), form)
        if part is None and one_by_one:
            part = _line_by_line(block, form, with_commas=with_commas)
        if part is None:
            return None
        if part.width is not None:
            row, n_fields = part.width
            return Rows(n_rows=n_rows, width=(n_before + row, n_fields))
        for place, (row, word) in part.no_numbers.items():
            no_numbers.setdefault(place, (n_before + row, word))
        for place, column in columns.items():
            column[n_before : n_before + part.n_rows] = part.columns[place]
        n_before += part.n_rows
    return Rows(n_rows=n_rows, columns=columns, no_numbers=no_numbers)


def _blocks(rows: bytes) -> Iterator[bytes]:
    start = 0
    while start <= len(rows):
        stop = rows.find(b"\n", start + _BLOCK)
        stop = len(rows) if stop < 0 else stop
        yield rows[start:stop]
        start = stop + 1


def _by_numpy(text: bytes, form: RowForm) -> Rows | None:
    """Rows as NumPy reads them; `None` where one differs."""
    stream = io.TextIOWrapper(io.BytesIO(text), encoding="ascii")
    kinds = [(str(place), "S1" if place in form.texts else "f8") for place in range(len(form.cells.names))]
    comments = "#" if b"#" in text else None
    try:
        block = np.loadtxt(
            stream, dtype=kinds, comments=comments, delimiter=form.cells.delimiter, quotechar='"', ndmin=1
        )
    except ValueError:
        return None
    if block.size != text.count(b"\n") + 1:
        return None
    return Rows(n_rows=block.size, columns={place: block[str(place)] for place in form.numbers})


def _without_gaps(text: bytes, form: RowForm) -> bytes:
    """Rows with one word in every field without a number, and without the fields that have no name."""
    end = b"\n"
    lines = end + text + end
    delimiter, word = form.cells.delimiter, rb"(?:" + _WORDS + rb")"
    if delimiter is None:
        between, blanks = rb"[ \t]", rb""
    else:
        between, blanks, word = re.escape(delimiter.encode()), rb" *", word + rb"?"
        lines = lines.replace(form.n_empty * delimiter.encode() + end, end)
    gap = rb"(" + between + rb"|\n)" + blanks + word + blanks + rb"(?=" + between + rb"|\n)"
    return re.sub(gap, rb"\1nan", lines, flags=re.IGNORECASE)[1:-1]


def _line_by_line(block: bytes, form: RowForm, *, with_commas: bool) -> Rows | None:
    """Rows, with what must be refused in them; `None` where a line is no row."""
    texts: list[list[str]] = []
    lines = block.decode().split("\n")
    for line in lines:
        if RULE.fullmatch(line):
            return None
        fields = form.cells.of_line(line)
        if len(fields) != len(form.cells.names):
            return Rows(n_rows=len(lines), width=(len(texts), len(fields)))
        texts.append(fields)
    columns = {place: np.full(len(texts), np.nan) for place in form.numbers}
    no_numbers: dict[int, tuple[int, str]] = {}
    for place, column in columns.items():
        for row, fields in enumerate(texts):
            number = number_in(fields[place], with_commas=with_commas)
            if number is None:
                no_numbers.setdefault(place, (row, fields[place]))
            else:
                column[row] = number
    return Rows(n_rows=len(texts), columns=columns, no_numbers=no_numbers)
