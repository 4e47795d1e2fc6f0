"""Text tables of rigs and programs: a fast reader for clean files, with exact lines in errors otherwise."""

from __future__ import annotations

import hashlib
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.layout import (
    DECIMAL_COMMA,
    MISSING,
    NUMBER,
    SURELY_DECIMAL,
    Layout,
    is_data,
    is_labview,
    is_number,
    labview_layout,
    layout_of,
    sampled_layout,
    split,
)
from mrwork.files.named_columns import ASIAN_WORDS, ColumnTable, unused_parts
from mrwork.files.rows import Cells, RowForm, Rows, number_in, read_rows, without_empty_lines
from mrwork.store.input_file import RECORD, bytes_of, start_of

# 2024-05-01 12:00:00.010, with T, / or a zone; 01.05.2024 12:00:00; 12:00:00,010.
_STAMP: Final = re.compile(
    r"(?:(?:(?P<year>[0-9]{4})([-/])(?P<month>[0-9]{1,2})\2(?P<day>[0-9]{1,2})"
    r"|(?P<day_first>[0-9]{1,2})\.(?P<month_then>[0-9]{1,2})\.(?P<year_last>[0-9]{4}))(?:[T ]\s*|$))?"
    r"(?:(?P<hour>[0-9]{1,4}):(?P<minute>[0-5][0-9]):(?P<second>[0-5][0-9]|60)(?:[.,](?P<fraction>[0-9]{1,9}))?"
    r"\s*(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?)?"
)
_LONGEST: Final = 60
_DAY: Final = 86_400 * 10**9
_HOUR: Final = 3600 * 10**9


def stamps_of(names: Sequence[str], row: Sequence[str]) -> frozenset[str]:
    """The columns that have times of the day, by themselves or with dates, of which the first row is given."""
    pairs = zip(names, row, strict=False)
    return frozenset(name for name, text in pairs if ":" in text and nanoseconds(text) is not None)


def nanoseconds(text: str) -> int | None:
    """Time of a stamp [ns], since 1970 if it has a date, which alone is its midnight; `None` of another text."""
    match = _STAMP.fullmatch(text.strip()) if 0 < len(text) <= _LONGEST else None
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
        days = np.datetime64(f"{year}-{int(month):02d}-{int(day):02d}", "D").astype(np.int64)
    except ValueError:
        return None
    return int(days) * _DAY + time


def seconds_since_first(times: Sequence[int | None], *, with_dates: bool) -> Floats:
    """Seconds since the first of times [ns], NaN where one is missing; without dates, a new day begins at midnight."""
    seconds = np.full(len(times), np.nan)
    known = [row for row, time in enumerate(times) if time is not None]
    clock = np.array([times[row] for row in known], dtype=np.int64)
    days = np.cumsum(np.diff(clock, prepend=clock[:1]) < -12 * _HOUR) * (not with_dates)
    seconds[known] = (clock - clock[:1] + days * _DAY) * 1e-9
    return seconds


def has_date(text: str) -> bool:
    """Whether a stamp has a date."""
    match = _STAMP.fullmatch(text.strip())
    return match is not None and (match["year"] or match["year_last"]) is not None


_HEAD: Final = 65536
# Lines from the middle of the file that are looked at.
_WINDOW: Final = 20


@dataclass(kw_only=True, eq=False, repr=False)
class RegularTable(ColumnTable):
    """A text table whose rows have been read.

    In the columns `sure` commas can only be decimal ones. Where the rows are `in_doubt`, requests without any of them,
    and for columns that have not been read, are left to the table that `careful` opens. `lines` gives the index of the
    line of a row.
    """

    layout: Layout
    cells: Cells
    sha256: str
    rows: Rows
    lines: Callable[[int], int]
    sure: frozenset[int]
    stamps: frozenset[str]
    in_doubt: bool
    careful: Callable[[], ColumnTable]

    def __post_init__(self) -> None:
        self.names = self.layout.names
        self.units = dict(zip(self.names, self.layout.units, strict=False)) | dict.fromkeys(self.stamps, "s")

    def read(self, wanted: Sequence[str]) -> dict[str, Floats]:
        """The requested columns, each of shape (n_time,)."""
        places = [self.names.index(name) for name in wanted]
        rows = self.rows
        known = rows.width is not None or all(
            place in rows.columns or place in rows.no_numbers for place in places
        )
        if self.in_doubt and (
            self.stamps.intersection(wanted) or not (known and self.sure.intersection(places))
        ):
            return self.careful().read(wanted)
        if rows.width is not None:
            row, n_fields = rows.width
            self.cells.refuse_width(self.lines(row) + 1, n_fields)
        wrong = [(rows.no_numbers[place], place) for place in places if place in rows.no_numbers]
        if wrong:
            (row, text), place = min(wrong, key=lambda each: each[0][0])
            self.cells.refuse_text(self.lines(row) + 1, place, text)
        return {name: rows.columns[place] for name, place in zip(wanted, places, strict=True)}

    def locate(self, row: int) -> str:
        """Line of a row."""
        return f"line {self.lines(row) + 1}" if row < self.rows.n_rows else f"row {row + 1}"

    def without_markers(self) -> tuple[ColumnTable, Sequence[str]]:
        """As of the table that looks at every line."""
        return self.careful().without_markers()


def regular_table(
    data: bytes, encoding: str, *, source: str, sha256: str, careful: Callable[[], ColumnTable]
) -> RegularTable | None:
    """Read the bytes of a table; `None` where its lines must be looked at one by one, as `careful` does."""
    data = data.removeprefix(BOM_UTF8) if encoding == "utf-8" else decode_text(data).encode()
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    head = data[: data.rfind(b"\n", 0, _HEAD) + 1] if len(data) > _HEAD else data
    lines = head.decode().split("\n")
    if is_labview(lines):
        return None
    data, dropped = without_empty_lines(data)
    middle = data[data.find(b"\n", len(data) // 2) + 1 :][:_HEAD].decode(errors="replace")
    sampled = sampled_layout(lines, middle.split("\n")[:_WINDOW])
    if sampled is None:
        return None
    layout, with_texts = sampled
    first = sum(map(is_data, lines[: layout.data[0]]))
    if first + np.count_nonzero(dropped < layout.data[0]) != layout.data[0]:
        # A blank line of other characters than those of ASCII.
        return None
    rows = data.split(b"\n", first)[first]
    del data
    in_doubt = layout.delimiter != "," and b"," in rows
    # Without texts and commas in doubt the first row tells what all others have.
    sampled_rows = layout.data if with_texts or in_doubt else layout.data[:1]
    fields = [split(lines[index], layout.delimiter) for index in sampled_rows]
    cells = Cells(source=source, names=layout.names, delimiter=layout.delimiter)
    form = RowForm(
        cells=cells,
        texts=_texts(fields, len(layout.names)) if with_texts else {},
        n_empty=len(fields[0]) - len(layout.names),
        header=None if layout.header is None else lines[layout.header].strip().encode(),
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
        in_doubt=bool(form.texts) or in_doubt,
        careful=careful,
    )


def _texts(fields: Sequence[Sequence[str]], n_columns: int) -> dict[int, tuple[int, str]]:
    """The first row, and its text, of each column in which rows have a text."""
    texts: dict[int, tuple[int, str]] = {}
    for row, each in enumerate(fields):
        for place, field in enumerate(each[:n_columns]):
            text = field.strip()
            if not is_number(text) and text.casefold() not in MISSING:
                texts.setdefault(place, (row, text))
    return texts


_LONGEST_LINE: Final = 65536
# Control characters that no text export writes; NUL also indicates UTF-16.
_BINARY: Final = re.compile(rb"[\x00-\x08\x0e-\x1a\x7f]")
_SURELY_DECIMAL_WITHIN: Final = re.compile(r"(?<!\d)0,\d|\d,(?:\d{1,2}|\d{4,})(?!\d)")


def open_delimited(path: Path) -> ColumnTable:
    """Open a text file: columns separated by tabs, semicolons, blanks or commas, below names and any further header.

    Lines that start with ``#`` are comments; if no header follows them, the last one is the header, as written by
    `numpy.savetxt`. Decimal commas are read where the delimiter is no comma. See `encoding_of` for text that is not
    UTF-8.
    """
    data = read_text_bytes(path)
    return table_of_text(data, source=str(path), sha256=hashlib.sha256(data).hexdigest())


def table_of_text(data: bytes, *, source: str, sha256: str) -> ColumnTable:
    """Table of the bytes of a text, as by `open_delimited`."""

    def line_by_line() -> DelimitedTable:
        lines = decode_text(data).replace("\r\n", "\n").replace("\r", "\n").split("\n")
        layout: Layout | None = None
        if is_labview(lines):
            lines, layout = labview_layout(lines, source)
        return DelimitedTable(source=source, sha256=sha256, lines=lines, layout=layout)

    encoding = encoding_of(data)
    table = (
        regular_table(data, encoding, source=source, sha256=sha256, careful=line_by_line) or line_by_line()
    )
    table.encoding = _ENCODINGS.get(encoding, "")
    return table


class DelimitedTable(ColumnTable):
    """A text table stored as lines, parsed on request, with its `layout` where that is known."""

    def __init__(self, *, source: str, sha256: str, lines: list[str], layout: Layout | None = None) -> None:
        self.sha256 = sha256
        self._source = source
        self._lines = lines
        layout = layout or layout_of(lines, source)
        self.names = layout.names
        self._delimiter = layout.delimiter
        self._cells = Cells(source=source, names=layout.names, delimiter=layout.delimiter)
        self._data = layout.data
        if not self._data:
            raise RecordError(f"{source}: there is a header but no data line after it; check the export")
        self.stamps = stamps_of(layout.names, self._cells.of_line(lines[self._data[0]]))
        # Times of the day are read as seconds.
        self.units = dict(zip(layout.names, layout.units, strict=False)) | dict.fromkeys(self.stamps, "s")

    def read(self, wanted: Sequence[str]) -> dict[str, Floats]:
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

    def without_markers(self) -> tuple[ColumnTable, Sequence[str]]:
        """The table without lines that have words and fewer than two numbers, or words in front of them."""
        begins_with_number = is_number(self._cells.of_line(self._lines[self._data[0]])[0])
        marked: dict[int, str] = {}
        for index in self._data:
            fields = self._cells.of_line(self._lines[index])
            texts = ["" if is_number(each) or each.casefold() in MISSING else each for each in fields]
            words = [any(map(str.isalpha, each)) for each in texts]
            is_row = len(fields) == len(self.names) and sum(map(is_number, fields)) > 1
            if any(words) and (not is_row or (words[0] and begins_with_number)):
                marked[index] = f"line {index + 1} '{self._lines[index].strip()[:40]}'"
        # Where most lines are so, the file is no table of numbers.
        if 2 * len(marked) >= len(self._data):
            return self, ()
        table, shown = copy(self), list(marked.values())
        table._data = tuple(index for index in self._data if index not in marked)
        table.unused = (*self.unused, *unused_parts("marker", shown, "skipped"))
        return table, shown

    def _parse_line_by_line(self, columns: Sequence[int]) -> Floats:
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
        read = np.empty((len(columns), len(texts)))
        for row, (index, cells) in enumerate(zip(self._data, numbers, strict=True)):
            for place, column, text in zip(of_numbers, numeric, cells, strict=True):
                number = number_in(text, with_commas=with_commas)
                if number is None:
                    self._cells.refuse_text(index + 1, column, text)
                read[place, row] = number
        for place, column in enumerate(columns):
            if place not in of_numbers:
                read[place] = self._seconds([row[place] for row in texts], column)
        return read

    def _seconds(self, cells: Sequence[str], column: int) -> Floats:
        times = [nanoseconds(text) for text in cells]
        for index, text, time in zip(self._data, cells, times, strict=True):
            if time is None and text.casefold() not in MISSING:
                self._cells.refuse_text(index + 1, column, text, "a time such as 2024-05-01 12:00:00.010")
        return seconds_since_first(times, with_dates=any(map(has_date, cells[:1])))

    def _has_decimal_commas(self, texts: Sequence[Sequence[str]], columns: Sequence[int]) -> bool:
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


# Codecs of texts that are not UTF-8, as sentences call them.
_ENCODINGS: Final = {
    "utf-16": "UTF-16", "cp932": "Shift-JIS", "gb18030": "GBK", "cp1252": "Windows-1252", "latin-1": "Latin-1",
}  # fmt: skip
_WIDE: Final = (BOM_UTF16_LE, BOM_UTF16_BE)


def encoding_of(data: bytes) -> str:
    """Codec of a text: UTF-8, UTF-16 by its mark, Shift-JIS or GBK by words for quantities, else Windows-1252.

    Latin-1, in which every byte is a character, is left for bytes that Windows-1252 does not have.
    """
    if data.startswith(_WIDE):
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        head = data[:_HEAD]
        texts = {name: head.decode(name, errors="ignore") for name in ("cp932", "gb18030")}
        found = {name: sum(map(text.count, ASIAN_WORDS)) for name, text in texts.items()}
        likely = max(found, key=lambda name: found[name])
        not_in_1252 = any(byte in head for byte in (0x81, 0x8D, 0x8F, 0x90, 0x9D))
        return likely if found[likely] else "latin-1" if not_in_1252 else "cp1252"
    return "utf-8"


def decode_text(data: bytes) -> str:
    """Text of the bytes of a file, without a byte-order mark."""
    encoding = encoding_of(data)
    return (data.removeprefix(BOM_UTF8) if encoding == "utf-8" else data).decode(encoding, errors="replace")


def read_text_bytes(path: Path) -> bytes:
    """Read a whole text file after a check of its start, because a wrong file may be very large."""
    head = start_of(path, RECORD, _LONGEST_LINE)
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; a header line and data lines were expected")
    is_wide = head.startswith(_WIDE)
    byte = None if is_wide else _BINARY.search(head)
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
    data = bytes_of(path, RECORD)
    if not is_wide and (zero := data.find(b"\0")) >= 0:
        raise RecordError(
            f"{path}: byte {zero} is 0x00, which no text has; the file is damaged, export the record again"
        )
    return data
