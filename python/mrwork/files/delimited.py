"""Text tables of rigs and programs: NumPy reads the rows, block by block, once the layout is known.

Decimal commas become points, and missing numbers NaN, where a block has them. A block that NumPy still refuses is read
cell by cell, so that the first wrong cell is named.
"""

from __future__ import annotations

import hashlib
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import copy
from datetime import date
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import counted
from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.labview import is_labview, labview_layout
from mrwork.files.layout import (
    DECIMAL_COMMA,
    MISSING,
    NUMBER,
    SURELY_DECIMAL,
    Layout,
    distinct_names,
    is_number,
    layout_of,
    split,
    without_remark,
)
from mrwork.files.named_columns import ASIAN_WORDS, ColumnTable, unused_parts
from mrwork.store.input_file import RECORD, bytes_of

# Characters of a time of the day with its date.
_LONGEST_STAMP: Final = 60
# Rows that are read at once.
_BLOCK: Final = 4096
# NumPy reads decimal points only. It refuses the comma that a decimal point among decimal commas becomes.
_EXCHANGED: Final = str.maketrans(",.", ".,")
_NAN: Final = "nan"
# Types with which NumPy reads numbers, times of the day, which may be too long, and other texts, of which it keeps the
# first characters: enough to tell whether they are `_NAN`.
_NUMBER: Final = "f8"
_STAMP: Final = f"U{_LONGEST_STAMP + 1}"
_TEXT: Final = f"U{len(_NAN) + 1}"


def open_delimited(path: Path) -> ColumnTable:
    """Open a text file: columns separated by tabs, semicolons, blanks or commas, below names and any further header.

    Lines that start with ``#`` are comments; if no header follows them, the last one is the header, as written by
    `numpy.savetxt`. Decimal commas are read where they do not separate the columns. See `encoding_of` for text that is
    not UTF-8.
    """
    data = read_text_bytes(path)
    digest = hashlib.sha256(data).hexdigest()
    table = DelimitedTable(source=str(path), sha256=digest, lines=split_lines(data))
    table.encoding = _ENCODINGS.get(encoding_of(data), "")
    return table


def _gap(delimiter: str | None) -> re.Pattern[str]:
    """Fields without a number: empty ones between delimiters, and words for a missing number."""
    words = "|".join(sorted(map(re.escape, MISSING - {""})))
    if delimiter is None:
        return re.compile(rf"(?<!\S)(?:{words})(?!\S)", re.IGNORECASE)
    return re.compile(rf"(?<![^{delimiter}\n]) *(?:{words})? *(?![^{delimiter}\n])", re.IGNORECASE)


class DelimitedTable(ColumnTable):
    """A text table stored as lines, parsed on request, with its `layout` where that is known."""

    def __init__(self, *, source: str, sha256: str, lines: list[str], layout: Layout | None = None) -> None:
        if layout is None and is_labview(lines):
            lines, layout = labview_layout(lines, source)
        layout = layout or layout_of(lines, source)
        if not layout.data:
            raise RecordError(f"{source}: there is a header but no data line after it; check the export")
        self.sha256 = sha256
        self.headings, self.names = layout.names, distinct_names(layout.names)
        self._source = source
        self._lines = lines
        self._delimiter = layout.delimiter
        self._data = layout.data
        # Between blanks a quotation mark is a character.
        self._quote = None if layout.delimiter is None else '"'
        self._first = self._split(self._data[0])
        # Fields at the end of a row may have no name.
        raw = split(without_remark(lines[self._data[0]]), layout.delimiter)
        self._width = max(len(self.names), len(raw))
        pairs = zip(self.names, self._first, strict=False)
        self.stamps = frozenset(
            name for name, text in pairs if ":" in text and _nanoseconds(text) is not None
        )
        # Times of the day are read as seconds.
        self.units = dict(zip(self.names, layout.units, strict=False)) | dict.fromkeys(self.stamps, "s")

    def read(self, wanted: Sequence[str]) -> dict[str, Floats]:
        """Parse the requested columns, each of shape (n_time,)."""
        places = {name: self.names.index(name) for name in wanted}
        kinds = {index: _STAMP if name in self.stamps else _NUMBER for name, index in places.items()}
        columns = {index: np.empty(len(self._data)) for index, kind in kinds.items() if kind == _NUMBER}
        times: dict[int, list[int | None]] = {index: [] for index in kinds if index not in columns}
        with_commas = self._has_decimal_commas(list(columns))
        for start in range(0, len(self._data), _BLOCK):
            rows = self._data[start : start + _BLOCK]
            block = self._by_numpy(rows, kinds, with_commas=with_commas)
            if block is None:
                block = self._cell_by_cell(rows, kinds, with_commas=with_commas)
            for index, column in columns.items():
                column[start : start + len(rows)] = block[index]
            for index, since in times.items():
                since += [self._time(row, index, text) for row, text in zip(rows, block[index], strict=True)]
        for index, since in times.items():
            columns[index] = _seconds_since_first(since)
        return {name: columns[index] for name, index in places.items()}

    def texts(self, name: str) -> list[str]:
        """A column as it is written."""
        column = self.names.index(name)
        return [[*self._split(row), *[""] * column][column] for row in self._data]

    def instant(self, name: str) -> float:
        """The first time of a column of times of the day [s], since midnight, or the year 1 if it has a date."""
        return next(
            (1e-9 * time for text in self.texts(name) if (time := _nanoseconds(text)) is not None), 0.0
        )

    def size_of(self, name: str) -> int:
        """Number of rows, of every column."""
        return len(self._data)

    def locate(self, row: int) -> str:
        """Line of a row; blank lines, comments and headers count as lines but not as rows."""
        return f"line {self._data[row] + 1}" if row < len(self._data) else f"row {row + 1}"

    def without_markers(self) -> tuple[ColumnTable, Sequence[str]]:
        """The table without lines that have words and fewer than two numbers, or words in front of them."""
        begins_with_number = is_number(self._first[0])
        marked: dict[int, str] = {}
        for index in self._data:
            fields = self._split(index)
            texts = ["" if is_number(field) or field.casefold() in MISSING else field for field in fields]
            words = [any(map(str.isalpha, text)) for text in texts]
            is_row = len(fields) == len(self.names) and sum(map(is_number, fields)) > 1
            if any(words) and (not is_row or (words[0] and begins_with_number)):
                marked[index] = f"line {index + 1} '{self._lines[index].strip()[:40]}'"
        # Where most lines are so, the file is no table of numbers.
        if 2 * len(marked) >= len(self._data):
            return self, ()
        table, shown = copy(self), list(marked.values())
        table._data = [index for index in self._data if index not in marked]
        table.unused = (*self.unused, *unused_parts("marker", shown, "skipped"))
        return table, shown

    def _by_numpy(
        self, rows: Sequence[int], kinds: Mapping[int, str], *, with_commas: bool
    ) -> Mapping[int, Any] | None:
        """Cells of rows by column, as NumPy reads them; `None` where it does not read all of them."""
        lines = [*map(self._lines.__getitem__, rows)]
        if with_commas:
            if self._delimiter == ",":
                return None
            lines = "\n".join(lines).translate(_EXCHANGED).split("\n")
        block = self._block(lines, kinds)
        if block is None:
            block = self._block(_gap(self._delimiter).sub(_NAN, "\n".join(lines)).split("\n"), kinds)
        if block is None or block.size != len(rows):
            return None
        cells: dict[int, Any] = {}
        for column, kind in kinds.items():
            cells[column] = block[str(column)]
            if kind == _STAMP and with_commas:
                cells[column] = [text.translate(_EXCHANGED) for text in cells[column].tolist()]
        return cells

    def _block(self, lines: Sequence[str], kinds: Mapping[int, str]) -> NDArray[np.void] | None:
        """Rows with a field for each column; `None` where NumPy refuses one, or where a nameless field has a text."""
        fields = [(str(index), kinds.get(index, _TEXT)) for index in range(self._width)]
        try:
            block = np.loadtxt(lines, fields, delimiter=self._delimiter, quotechar=self._quote, ndmin=1)
        except ValueError:
            return None
        nameless = [block[name] for name, _ in fields[len(self.names) :]]
        return block if all(np.isin(column, ("", _NAN)).all() for column in nameless) else None

    def _cell_by_cell(
        self, rows: Sequence[int], kinds: Mapping[int, str], *, with_commas: bool
    ) -> Mapping[int, Any]:
        """Cells of rows by column; the first row of another width and the first wrong number are refused."""
        cells: dict[int, list[Any]] = {column: [] for column in kinds}
        for row in rows:
            fields = self._split(row)
            if len(fields) != len(self.names):
                self._refuse_width(row, len(fields))
            for column, kind in kinds.items():
                text = fields[column]
                cells[column].append(
                    self._number(row, column, text, with_commas=with_commas) if kind == _NUMBER else text
                )
        return cells

    def _split(self, row: int) -> list[str]:
        """Fields of a row without its remark, and without empty ones at its end that have no name."""
        fields = [field.strip() for field in split(without_remark(self._lines[row]), self._delimiter)]
        while len(fields) > len(self.names) and not fields[-1]:
            fields.pop()
        return fields

    def _refuse_width(self, row: int, width: int) -> NoReturn:
        hint = "complete or delete the line"
        if self._delimiter == "," and width > len(self.names):
            hint = (
                "these may be decimal commas between commas: export with decimal points, or with semicolons between "
                "the columns"
            )
        raise RecordError(
            f"{self._source}: line {row + 1} has {counted(width, 'field')} where the header "
            f"names {counted(len(self.names), 'column')}; {hint}"
        )

    def _number(self, row: int, column: int, text: str, *, with_commas: bool) -> float:
        if text.casefold() in MISSING:
            return float("nan")
        with_points = text.translate(_EXCHANGED) if with_commas else text
        if NUMBER.fullmatch(with_points):
            return float(with_points)
        if is_number(text):
            mark, others = ("point", "commas") if with_commas else ("comma", "points")
            raise RecordError(
                f"{self._holds(row, column, text)} with a decimal {mark} where others have decimal {others}; export "
                "all numbers with decimal points"
            )
        if _THOUSANDS.fullmatch(text):
            raise RecordError(
                f"{self._holds(row, column, text)} with marks between thousands; export numbers without these"
            )
        raise self._unexpected(row, column, text, "a number")

    def _time(self, row: int, column: int, text: str) -> int | None:
        time = _nanoseconds(text)
        if time is None and text.strip().casefold() not in MISSING:
            raise self._unexpected(row, column, text, "a time such as 2024-05-01 12:00:00.010")
        return time

    def _has_decimal_commas(self, numbers: Sequence[int]) -> bool:
        """Whether numbers have decimal commas; refused where all of their commas may separate thousands."""
        comma = '"' if self._delimiter == "," else ","
        doubt = ""
        for row in self._data:
            line = self._lines[row]
            if comma not in line and "." not in line:
                continue
            fields = self._split(row)
            # Rows of another width are refused where they are read.
            for column in numbers if len(fields) == len(self.names) else ():
                text = fields[column]
                if SURELY_DECIMAL.fullmatch(text):
                    return True
                if "." in text and NUMBER.fullmatch(text):
                    return False
                if not doubt and DECIMAL_COMMA.fullmatch(text):
                    doubt = self._holds(row, column, text)
        if not doubt or any(
            SURELY_DECIMAL.fullmatch(text) for row in self._data for text in self._split(row)
        ):
            return bool(doubt)
        raise RecordError(
            f"{doubt} with a decimal comma or a comma between thousands, and no number of the file tells which; "
            "export without commas in numbers"
        )

    def _holds(self, row: int, column: int, text: str) -> str:
        shown = text if len(text) <= 40 else text[:40] + "..."
        return f"{self._source}: line {row + 1}, column '{self.names[column]}' holds '{shown}'"

    def _unexpected(self, row: int, column: int, text: str, expected: str) -> RecordError:
        where = self._holds(row, column, text)
        return RecordError(f"{where} where {expected} was expected; correct or delete the line")


_THOUSANDS: Final = re.compile(r"[+-]?\d{1,3}([.,' ]\d{3})+([.,]\d*)?")
# Codecs of texts that are not UTF-8, as sentences call them.
_ENCODINGS: Final = {
    "utf-16": "UTF-16", "cp932": "Shift-JIS", "gb18030": "GBK", "cp1252": "Windows-1252", "latin-1": "Latin-1",
}  # fmt: skip
_WIDE: Final = (BOM_UTF16_LE, BOM_UTF16_BE)
# Bytes of the start of a file, of which no line is longer.
_HEAD: Final = 65536
# Control characters that no text export writes; NUL also indicates UTF-16.
_BINARY: Final = re.compile(rb"[\x00-\x08\x0e-\x1a\x7f]")


def encoding_of(data: bytes) -> str:
    """Codec of a text: UTF-8, UTF-16 by its mark, Shift-JIS or GBK by words for quantities, else Windows-1252.

    Latin-1, in which every byte is a character, is left for bytes that Windows-1252 does not have.
    """
    if data.startswith(_WIDE):
        return "utf-16"
    with suppress(UnicodeDecodeError):
        data.decode("utf-8")
        return "utf-8-sig"
    head = data[:_HEAD]
    texts = {name: head.decode(name, errors="ignore") for name in ("cp932", "gb18030")}
    counts = {name: sum(map(text.count, ASIAN_WORDS)) for name, text in texts.items()}
    likely = max(counts, key=lambda name: counts[name])
    not_in_1252 = any(byte in head for byte in b"\x81\x8d\x8f\x90\x9d")
    return likely if counts[likely] else "latin-1" if not_in_1252 else "cp1252"


def split_lines(data: bytes) -> list[str]:
    """Lines of the bytes of a text, which end as on any system, or in CR CR LF as in some archives."""
    text = data.decode(encoding_of(data), errors="replace")
    text = text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n")
    return text.removesuffix("\n").split("\n")


def read_text_bytes(path: Path) -> bytes:
    """Read a whole text file after a check of its start, because a wrong file may be very large."""
    head = bytes_of(path, RECORD, _HEAD)
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; a header line and data lines were expected")
    is_wide = head.startswith(_WIDE)
    if not is_wide and (byte := _BINARY.search(head)) is not None:
        raise RecordError(
            f"{path}: byte {byte.start()} is {byte[0][0]:#04x}, so this is a binary file under the "
            "name of a text file; export the record as text"
        )
    if len(head) == _HEAD and b"\n" not in head and b"\r" not in head:
        raise RecordError(
            f"{path}: the first line is longer than {_HEAD // 1024} KiB, so it cannot be a "
            "header; check that this is a table with one row per line"
        )
    data = bytes_of(path, RECORD)
    if not is_wide and (zero := data.find(b"\0")) >= 0:
        raise RecordError(
            f"{path}: byte {zero} is 0x00, which no text has; the file is damaged, export the record again"
        )
    return data


# Times of the day: 2024-05-01 12:00:00.010, with T, / or a zone; 01.05.2024 12:00:00; 12:00:00,010.
_STAMP_FORM: Final = re.compile(
    r"(?:(?:(?P<year>[0-9]{4})([-/])(?P<month>[0-9]{1,2})\2(?P<day>[0-9]{1,2})"
    r"|(?P<day_first>[0-9]{1,2})\.(?P<month_then>[0-9]{1,2})\.(?P<year_last>[0-9]{4}))(?:[T ]\s*|$))?"
    r"(?:(?P<hour>[0-9]{1,4}):(?P<minute>[0-5][0-9]):(?P<second>[0-5][0-9]|60)(?:[.,](?P<fraction>[0-9]{1,9}))?"
    r"\s*(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?)?"
)
_DAY: Final = 86_400 * 10**9
_HOUR: Final = 3600 * 10**9


def _nanoseconds(text: str) -> int | None:
    """Time of a stamp [ns], since the year 1 if it has a date, which alone is its midnight; `None` of another text."""
    match = _STAMP_FORM.fullmatch(text.strip()) if 0 < len(text) <= _LONGEST_STAMP else None
    if match is None or not match[0]:
        return None
    clock = 3600 * int(match["hour"] or 0) + 60 * int(match["minute"] or 0) + int(match["second"] or 0)
    time = clock * 10**9 + int((match["fraction"] or "").ljust(9, "0"))
    if match["zone"] not in (None, "Z"):
        sign, digits = match["zone"][0], match["zone"][1:].replace(":", "")
        offset = 60 * int(digits[:2]) + int(digits[2:])
        time -= (offset if sign == "+" else -offset) * 60 * 10**9
    year = match["year"] or match["year_last"]
    if year is None:
        return time
    month, day = match["month"] or match["month_then"], match["day"] or match["day_first"]
    try:
        return time + date(int(year), int(month), int(day)).toordinal() * _DAY
    except ValueError:
        return None


def _seconds_since_first(times: Sequence[int | None]) -> Floats:
    """Seconds since the first of times [ns], NaN where one is missing; without dates, a new day begins at midnight."""
    seconds = np.full(len(times), np.nan)
    rows = [row for row, time in enumerate(times) if time is not None]
    first = next((time for time in times if time is not None), 0)
    clock = np.array([time - first for time in times if time is not None], dtype=np.int64)
    # Hours have four digits at most; a date is later.
    days = np.cumsum(np.diff(clock, prepend=clock[:1]) < -12 * _HOUR) * (first < 10_000 * _HOUR)
    seconds[rows] = (clock + days * _DAY) * 1e-9
    return seconds
