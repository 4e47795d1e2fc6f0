"""Text tables of rigs and programs: a fast reader for clean files, with exact lines in errors otherwise."""

from __future__ import annotations

import hashlib
import re
from codecs import BOM_UTF8
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records.formats.cells import Cells, number_in
from mrwork.records.formats.labview import is_labview, labview_layout
from mrwork.records.formats.layout import (
    DECIMAL_COMMA,
    MISSING,
    NUMBER,
    SURELY_DECIMAL,
    Layout,
    delimiter_of,
    is_data,
    layout_of,
)
from mrwork.records.formats.regular import regular_table
from mrwork.records.formats.stamps import has_date, nanoseconds, seconds_since_first, stamps_of
from mrwork.records.table import ColumnTable
from mrwork.store.input_file import RECORD, bytes_of, start_of

_LONGEST_LINE: Final = 65536
# Control characters that no text export writes; NUL also indicates UTF-16.
_BINARY: Final = re.compile(rb"[\x00-\x08\x0e-\x1a\x7f]")
_SURELY_DECIMAL_WITHIN: Final = re.compile(r"(?<!\d)0,\d|\d,(?:\d{1,2}|\d{4,})(?!\d)")


def open_delimited(path: Path) -> ColumnTable:
    """Open a text file: columns separated by tabs, semicolons, blanks or commas, below names and any further header.

    Lines that start with ``#`` are comments; if no header follows them, the last one is the header, as written by
    `numpy.savetxt`. Decimal commas are read where the delimiter is no comma. Text that is not UTF-8 is taken as
    Latin-1, which concerns units such as \N{MICRO SIGN}m and remarks only.

    Raises
    ------
    RecordError
        The file is empty, not text, too large, or it has no data line.
    """
    data = read_text_bytes(path)
    return table_of_text(data, source=str(path), sha256=hashlib.sha256(data).hexdigest())


def table_of_text(data: bytes, *, source: str, sha256: str) -> ColumnTable:
    """As `open_delimited`, of the bytes of a text.

    Raises
    ------
    RecordError
        It has no data line.
    """

    def line_by_line() -> DelimitedTable:
        lines = decoded(data).replace("\r\n", "\n").replace("\r", "\n").split("\n")
        layout: Layout | None = None
        if is_labview(lines):
            lines, layout = labview_layout(lines, source)
        return DelimitedTable(source=source, sha256=sha256, lines=lines, layout=layout)

    return (
        regular_table(data, encoding_of(data), source=source, sha256=sha256, careful=line_by_line)
        or line_by_line()
    )


class DelimitedTable(ColumnTable):
    """A text table stored as lines; numbers are parsed on request.

    `names` are the column names of a table without a header line; the `layout` is that of the lines where it is known.
    """

    def __init__(
        self,
        *,
        source: str,
        sha256: str,
        lines: list[str],
        names: tuple[str, ...] | None = None,
        layout: Layout | None = None,
    ) -> None:
        self.sha256 = sha256
        self._source = source
        self._lines = lines
        if layout is None:
            layout = layout_of(lines, source) if names is None else _without_header(lines, names)
        self.names = layout.names
        self.units = dict(zip(layout.names, layout.units, strict=False))
        self._delimiter = layout.delimiter
        self._cells = Cells(source=source, names=layout.names, delimiter=layout.delimiter)
        self._data = layout.data
        if not self._data:
            raise RecordError(f"{source}: there is a header but no data line after it; check the export")
        self.stamps = stamps_of(layout.names, self._cells.of_line(lines[self._data[0]]))
        # Times of the day are read as seconds.
        self.units = {**self.units, **dict.fromkeys(self.stamps, "s")}

    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """Parse the requested columns, each of shape (n_time,)."""
        columns = [self.names.index(name) for name in wanted]
        if self.stamps.intersection(wanted):
            return dict(zip(wanted, self._parse_line_by_line(columns), strict=True))
        try:
            block = np.loadtxt(self._rows_with_points(), delimiter=self._delimiter, quotechar='"', ndmin=2)
        except ValueError:
            # Text in a column that is not requested, an empty cell, decimal commas or an error: the slow reader tells.
            return dict(zip(wanted, self._parse_line_by_line(columns), strict=True))
        if block.shape[1] != len(self.names):
            self._cells.refuse_width(self._data[0] + 1, block.shape[1])
        return {name: np.ascontiguousarray(block[:, i]) for name, i in zip(wanted, columns, strict=True)}

    def _rows_with_points(self) -> list[str]:
        """Rows of the file, with points for decimal commas where all of them can only be that."""
        rows = [self._lines[index] for index in self._data]
        if self._delimiter == "," or not any("," in row for row in rows):
            return rows
        text = "\n".join(rows)
        sure = "." not in text and _SURELY_DECIMAL_WITHIN.search(text) is not None
        return text.replace(",", ".").split("\n") if sure else rows

    def locate(self, row: int) -> str:
        """Line of a row; blank lines, comments and headers count as lines but not as rows."""
        return f"line {self._data[row] + 1}" if row < len(self._data) else f"row {row + 1}"

    def _parse_line_by_line(self, columns: Sequence[int]) -> NDArray[np.float64]:
        texts: list[list[str]] = []
        for index in self._data:
            fields = self._cells.of_line(self._lines[index])
            if len(fields) != len(self.names):
                self._cells.refuse_width(index + 1, len(fields))
            texts.append([fields[column] for column in columns])
        of_numbers = [place for place, column in enumerate(columns) if self.names[column] not in self.stamps]
        numbers = [[row[place] for place in of_numbers] for row in texts]
        numeric = [columns[place] for place in of_numbers]
        with_commas = self._has_decimal_commas(numbers, numeric)
        rows = [
            [
                self._number(text, index + 1, column, with_commas)
                for text, column in zip(row, numeric, strict=True)
            ]
            for index, row in zip(self._data, numbers, strict=True)
        ]
        read = np.empty((len(columns), len(texts)))
        read[of_numbers] = np.asarray(rows, dtype=np.float64).reshape(len(rows), len(numeric)).T
        for place, column in enumerate(columns):
            if place not in of_numbers:
                read[place] = self._seconds([row[place] for row in texts], column)
        return read

    def _seconds(self, cells: Sequence[str], column: int) -> NDArray[np.float64]:
        """Seconds since the first time of a column of times."""
        times = [nanoseconds(text) for text in cells]
        for index, text, time in zip(self._data, cells, times, strict=True):
            if time is None and text.casefold() not in MISSING:
                self._cells.refuse_time(index + 1, column, text)
        return seconds_since_first(times, with_dates=any(map(has_date, cells[:1])))

    def _has_decimal_commas(self, texts: Sequence[Sequence[str]], columns: Sequence[int]) -> bool:
        """Whether the numbers have decimal commas.

        Raises
        ------
        RecordError
            Where some have commas and others points, or the commas may separate thousands.
        """
        place = dict[str, tuple[int, int, str]]()
        sure = False
        for index, row in zip(self._data, texts, strict=True):
            for column, text in zip(columns, row, strict=True):
                if "," in text and DECIMAL_COMMA.fullmatch(text):
                    place.setdefault(",", (index, column, text))
                    sure = sure or bool(SURELY_DECIMAL.fullmatch(text))
                elif "." in text and NUMBER.fullmatch(text):
                    place.setdefault(".", (index, column, text))
        if "," not in place:
            return False
        index, column, text = place[","]
        where = f"{self._source}: line {index + 1}, column '{self.names[column]}' holds '{text}' with a decimal comma"
        if "." in place:
            other, name, point = place["."][0] + 1, self.names[place["."][1]], place["."][2]
            raise RecordError(
                f"{where}, line {other}, column '{name}' '{point}' with a decimal point; "
                "export all numbers with decimal points"
            )
        if not sure:
            raise RecordError(
                f"{where} or a comma between thousands, and no number of the file tells which; "
                "export without commas in numbers"
            )
        return True

    def _number(self, text: str, line: int, column: int, with_commas: bool) -> float:
        number = number_in(text, with_commas=with_commas)
        if number is None:
            self._cells.refuse_text(line, column, text)
        return number


def _without_header(lines: Sequence[str], names: tuple[str, ...]) -> Layout:
    data = tuple(index for index, line in enumerate(lines) if is_data(line))
    delimiter = delimiter_of(lines[data[0]]) if data else ","
    return Layout(delimiter=delimiter, names=names, units=(), data=data)


def encoding_of(data: bytes) -> str:
    """Encoding of a text: UTF-8, or else Latin-1, in which every byte is a character."""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def decoded(data: bytes) -> str:
    """Text of the bytes of a file, without a byte-order mark."""
    encoding = encoding_of(data)
    return (data.removeprefix(BOM_UTF8) if encoding == "utf-8" else data).decode(encoding)


def read_text_bytes(path: Path) -> bytes:
    """Read a whole text file after a check of its start, because a wrong file may be very large."""
    head = start_of(path, RECORD, _LONGEST_LINE)
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; a header line and data lines were expected")
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise RecordError(f"{path}: the text is UTF-16; save it as UTF-8")
    byte = _BINARY.search(head)
    if byte is not None:
        raise RecordError(
            f"{path}: byte {byte.start()} is {byte[0][0]:#04x}, so this is a binary file under the "
            "name of a text file; export the record as text"
        )
    if len(head) == _LONGEST_LINE and b"\n" not in head and b"\r" not in head:
        raise RecordError(
            f"{path}: the first line is longer than {_LONGEST_LINE // 1024} KiB, so it cannot be a "
            "header; check that this is a table with one row per line"
        )
    return bytes_of(path, RECORD)
