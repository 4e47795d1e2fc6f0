"""Tables whose rows are alike, read by NumPy; `delimited.py` reads every other table line by line.

The layout is found in the first lines and in some from the middle of the file. That it is the layout of all lines
follows from what is read below them: rows that NumPy takes, and others of which none is a rule or a repeated header.
"""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.formats.cells import Cells
from mrwork.records.formats.labview import is_labview
from mrwork.records.formats.layout import (
    MISSING,
    SURELY_DECIMAL,
    Layout,
    is_data,
    is_number,
    sampled_layout,
    split,
)
from mrwork.records.formats.rows import Form, Rows, read_rows, without_empty_lines
from mrwork.records.formats.stamps import stamps_of
from mrwork.records.table import ColumnTable

_HEAD: Final = 65536
# Lines from the middle of the file that are looked at.
_WINDOW: Final = 20


class RegularTable(ColumnTable):
    """A text table whose rows have been read.

    `sure` are the columns in whose sampled rows commas can only be decimal ones. Requests without any of them, and for
    columns that have not been read, among them `stamps`, are left to the table that `careful` opens; it is `None` where
    there can be no such request. `lines` gives the index of the line of a row.
    """

    def __init__(
        self,
        *,
        layout: Layout,
        cells: Cells,
        sha256: str,
        rows: Rows,
        lines: Callable[[int], int],
        sure: frozenset[int],
        stamps: frozenset[str],
        careful: Callable[[], ColumnTable] | None,
    ) -> None:
        self.names = layout.names
        self.units = dict(zip(layout.names, layout.units, strict=False))
        self.sha256 = sha256
        self._cells = cells
        self._rows = rows
        self._lines = lines
        self._sure = sure
        self._careful = careful
        self.stamps = stamps
        self.units = {**self.units, **dict.fromkeys(self.stamps, "s")}

    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """The requested columns, each of shape (n_time,)."""
        places = [self.names.index(name) for name in wanted]
        rows = self._rows
        known = rows.width is not None or all(
            place in rows.columns or place in rows.no_numbers for place in places
        )
        if self._careful is not None and (
            self.stamps.intersection(wanted) or not (known and self._sure.intersection(places))
        ):
            return self._careful().read(wanted)
        if rows.width is not None:
            row, n_fields = rows.width
            self._cells.refuse_width(self._lines(row) + 1, n_fields)
        wrong = [(rows.no_numbers[place], place) for place in places if place in rows.no_numbers]
        if wrong:
            (row, text), place = min(wrong, key=lambda each: each[0][0])
            self._cells.refuse_text(self._lines(row) + 1, place, text)
        return {name: rows.columns[place] for name, place in zip(wanted, places, strict=True)}

    def locate(self, row: int) -> str:
        """Line of a row."""
        return f"line {self._lines(row) + 1}" if row < self._rows.n_rows else f"row {row + 1}"


def regular_table(
    data: bytes, encoding: str, *, source: str, sha256: str, careful: Callable[[], ColumnTable]
) -> RegularTable | None:
    """Read the bytes of a table; `None` where its lines must be looked at one by one, as `careful` does."""
    if encoding == "utf-8":
        data = data.removeprefix(BOM_UTF8)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    head = data[: data.rfind(b"\n", 0, _HEAD) + 1] if len(data) > _HEAD else data
    lines = head.decode(encoding).split("\n")
    if is_labview(lines):
        return None
    data, dropped = without_empty_lines(data)
    sampled = sampled_layout(lines, _middle(data, encoding))
    if sampled is None:
        return None
    layout, with_texts = sampled
    first = sum(map(is_data, lines[: layout.data[0]]))
    if first + np.count_nonzero(dropped < layout.data[0]) != layout.data[0]:
        # A blank line of other characters than those of ASCII.
        return None
    rows = data[_after_lines(data, first) :]
    del data
    in_doubt = layout.delimiter != "," and b"," in rows
    # Without texts and commas in doubt the first row tells what all others have.
    sampled_rows = layout.data if with_texts or in_doubt else layout.data[:1]
    fields = [split(lines[index], layout.delimiter) for index in sampled_rows]
    cells = Cells(source=source, names=layout.names, delimiter=layout.delimiter)
    form = Form(
        cells=cells,
        encoding=encoding,
        texts=_texts(fields, len(layout.names)) if with_texts else {},
        n_empty=len(fields[0]) - len(layout.names),
        header=None if layout.header is None else lines[layout.header].strip().encode(encoding),
    )
    read = read_rows(rows, form)
    if read is None:
        return None
    sure = frozenset(
        place
        for each in fields
        for place, text in enumerate(each)
        if not in_doubt or SURELY_DECIMAL.fullmatch(text.strip())
    )
    # Line less row, with the lines that are no rows; where these are is counted in rows.
    skipped = dropped - np.arange(dropped.size)
    return RegularTable(
        layout=layout,
        cells=cells,
        sha256=sha256,
        rows=read,
        lines=lambda row: first + row + int(np.searchsorted(skipped, first + row, side="right")),
        sure=sure,
        stamps=stamps_of(layout.names, [text.strip() for text in fields[0]]),
        careful=careful if form.texts or in_doubt else None,
    )


def _middle(data: bytes, encoding: str) -> list[str]:
    """Lines from the middle one on, of a text without blank lines and comments."""
    start = _after_lines(data, (data.count(b"\n") + 1) // 2)
    return data[start : start + _HEAD].decode(encoding, errors="replace").split("\n")[:_WINDOW]


def _after_lines(data: bytes, count: int) -> int:
    """Where the text after so many ends of lines begins, by bisection."""
    start, stop = 0, len(data)
    while stop - start > _HEAD:
        half = (start + stop) // 2
        n_ends = data.count(b"\n", start, half)
        if n_ends >= count:
            stop = half
        else:
            start, count = half, count - n_ends
    for _ in range(count):
        start = data.index(b"\n", start) + 1
    return start


def _texts(fields: Sequence[Sequence[str]], n_columns: int) -> dict[int, tuple[int, str]]:
    """The first row, and its text, of each column in which rows have a text."""
    texts: dict[int, tuple[int, str]] = {}
    for row, each in enumerate(fields):
        for place, field in enumerate(each[:n_columns]):
            text = field.strip()
            if not is_number(text) and text.casefold() not in MISSING:
                texts.setdefault(place, (row, text))
    return texts
