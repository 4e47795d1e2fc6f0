"""Tables whose rows are all alike, read by NumPy at once; `delimited.py` reads every other table line by line.

The layout is found in the first lines and in some from the middle of the file. That it is the layout of all lines
follows from what NumPy has read: as many rows as there are lines, with a number in every field of a column of numbers.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
from mrwork.records.table import ColumnTable

_HEAD: Final = 65536
# Lines from the middle of the file that are looked at.
_WINDOW: Final = 20
# Characters of numbers, of words for a missing one, and between fields: a line that has others is no row of numbers,
# whatever separates its fields.
_OF_NUMBERS: Final = b"0123456789+-.,eE infityaulo/INFITYAULO\t;\"'"
# Read by NumPy, but not line by line.
_SIGNED_WORDS: Final = (b"-n", b"-N", b"+n", b"+N")
_GAP: Final = b"nan"


class RegularTable(ColumnTable):
    """A text table whose rows have been read.

    `columns` are those of numbers, by their place among the names, and `line` is the index of the first row's line.
    Requests for other columns, and without any of the columns in `sure`, are left to the table that `careful` opens; it
    is `None` where there can be no such request.
    """

    def __init__(
        self,
        *,
        layout: Layout,
        sha256: str,
        columns: dict[int, NDArray[np.float64]],
        sure: frozenset[int],
        careful: Callable[[], ColumnTable] | None,
    ) -> None:
        self.names = layout.names
        self.units = dict(zip(layout.names, layout.units, strict=False))
        self.sha256 = sha256
        self._first = layout.data[0]
        self._columns = columns
        self._sure = sure
        self._careful = careful

    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """The requested columns, each of shape (n_time,)."""
        places = [self.names.index(name) for name in wanted]
        read = self._columns.keys() >= set(places) and self._sure.intersection(places)
        if self._careful is not None and not read:
            return self._careful().read(wanted)
        return {name: self._columns[place] for name, place in zip(wanted, places, strict=True)}

    def locate(self, row: int) -> str:
        """Line of a row."""
        n_rows = next(iter(self._columns.values())).size
        return f"line {self._first + row + 1}" if row < n_rows else f"row {row + 1}"


def regular_table(
    data: bytes, decoded: Callable[[bytes], str], *, sha256: str, careful: Callable[[], ColumnTable]
) -> RegularTable | None:
    """Read the bytes of a table; `None` where its lines must be looked at one by one, as `careful` does."""
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n")
    head = data[: data.rfind(b"\n", 0, _HEAD) + 1] if len(data) > _HEAD else data
    lines = decoded(head).split("\n")
    if b"\r" in data or is_labview(lines):
        return None
    tail = data[-_HEAD:].rstrip(b"\n")
    stop = max(len(data) - _HEAD, 0) + len(tail)
    sampled = sampled_layout(lines, _middle(lines, data, len(head), stop))
    if sampled is None:
        return None
    layout, with_texts = sampled
    fields = [split(lines[index], layout.delimiter) for index in layout.data]
    texts = {
        place
        for place in range(len(layout.names))
        if with_texts and not all(_may_be_number(each[place]) for each in fields if place < len(each))
    }
    start = sum(len(line) + 1 for line in head.split(b"\n", layout.data[0])[: layout.data[0]])
    rows = data[start:stop]
    in_doubt = layout.delimiter != "," and b"," in rows
    sure = frozenset(
        place
        for each in fields
        for place, text in enumerate(each)
        if not in_doubt or SURELY_DECIMAL.fullmatch(text.strip())
    )
    columns = _columns(rows, layout, texts, n_empty=len(fields[0]) - len(layout.names))
    if columns is None:
        return None
    needed = careful if texts or in_doubt else None
    return RegularTable(layout=layout, sha256=sha256, columns=columns, sure=sure, careful=needed)


def _middle(lines: Sequence[str], data: bytes, n_head: int, stop: int) -> list[str]:
    """Lines of data from the middle one on, of a file without blank lines and comments below its first `lines`."""
    filled = [line for line in lines if is_data(line)]
    n_below = data.count(b"\n", n_head, stop) + 1 if n_head < stop else 0
    place = (len(filled) + n_below) // 2
    if place < len(filled):
        return filled[place : place + _WINDOW]
    start = _after_lines(data, n_head, stop, place - len(filled))
    return data[start : min(start + _HEAD, stop)].decode("latin-1").split("\n")[:_WINDOW]


def _after_lines(data: bytes, start: int, stop: int, count: int) -> int:
    """Where the text after so many ends of lines begins, by bisection."""
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


def _columns(
    rows: bytes, layout: Layout, texts: set[int], *, n_empty: int
) -> dict[int, NDArray[np.float64]] | None:
    """Columns of numbers by their place; `None` if a row differs. `n_empty` fields that have no name end every row."""
    delimiter = layout.delimiter
    if b"#" in rows or not rows.isascii():
        return None
    if texts and (
        b"\n\n" in b"\n" + rows.translate(None, _OF_NUMBERS) + b"\n" or (delimiter is None and b'"' in rows)
    ):
        return None
    with_points = rows if delimiter == "," else rows.replace(b",", b".")
    if with_points != rows and b"." in rows:
        return None
    if (texts or with_points != rows) and _has_signed_words(rows):
        return None
    kinds = [(str(place), "S1" if place in texts else "f8") for place in range(len(layout.names))]
    block = None if n_empty > 0 else _block(with_points, kinds, delimiter)
    if block is None and delimiter is not None and not _has_signed_words(rows):
        block = _block(_without_gaps(with_points, delimiter.encode(), n_empty), kinds, delimiter)
    # A quoted field may contain the end of a line.
    if block is None or block.size != rows.count(b"\n") + 1:
        return None
    return {
        place: np.ascontiguousarray(block[name])
        for place, (name, _) in enumerate(kinds)
        if place not in texts
    }


def _block(rows: bytes, kinds: list[tuple[str, str]], delimiter: str | None) -> NDArray[np.void] | None:
    """Rows as NumPy reads them; `None` where they differ from each other."""
    stream = io.TextIOWrapper(io.BytesIO(rows), encoding="ascii")
    try:
        return np.loadtxt(stream, dtype=kinds, comments=None, delimiter=delimiter, quotechar='"', ndmin=1)
    except ValueError:
        return None


def _without_gaps(rows: bytes, delimiter: bytes, n_empty: int) -> bytes:
    """Rows with a word in every empty field, and without those that have no name."""
    end = b"\n"
    lines = end + rows + end
    if n_empty > 0:
        lines = lines.replace(n_empty * delimiter + end, end)
    between = (2 * delimiter, delimiter + _GAP + delimiter)
    for empty, word in (
        between,
        between,
        (end + delimiter, end + _GAP + delimiter),
        (delimiter + end, delimiter + _GAP + end),
    ):
        lines = lines.replace(empty, word)
    return lines[1:-1]


def _has_signed_words(rows: bytes) -> bool:
    return any(word in rows for word in _SIGNED_WORDS)


def _may_be_number(text: str) -> bool:
    return is_number(text) or text.strip().casefold() in MISSING
