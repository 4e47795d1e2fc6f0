"""Text separated by commas, semicolons or tabs: a fast reader for clean files, with exact lines in errors otherwise."""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records.table import ColumnTable

_LONGEST_LINE: Final = 65536
_MISSING: Final = frozenset({"", "na", "n/a", "nan", "null", "none"})
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?", re.IGNORECASE)
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
# Control characters that no text export writes; NUL also indicates UTF-16.
_BINARY: Final = re.compile(rb"[\x00-\x08\x0e-\x1a\x7f]")


def open_delimited(path: Path) -> ColumnTable:
    """Open a .csv or .tsv file and read its header line.

    Lines that start with ``#`` are comments; if no header follows them, the last one is the header, as written by
    `numpy.savetxt`. The delimiter of the header applies: a tab if it has one, else a semicolon, else a comma, because
    names such as ``Force, N`` may contain a comma.

    Raises
    ------
    RecordError
        The file is empty, not text or not UTF-8, or it has no valid header or no data line.
    """
    data = read_text_bytes(path)
    text = _decode(data, path).replace("\r\n", "\n").replace("\r", "\n")
    return DelimitedTable(source=str(path), sha256=hashlib.sha256(data).hexdigest(), lines=text.split("\n"))


class DelimitedTable(ColumnTable):
    """A text table stored as lines; numbers are parsed on request.

    `names` are the column names of a table without a header line.
    """

    def __init__(
        self, *, source: str, sha256: str, lines: list[str], names: tuple[str, ...] | None = None
    ) -> None:
        self.sha256 = sha256
        self._source = source
        self._lines = lines
        if names is None:
            header, self._first = _find_header(lines, source)
            self._delimiter = _delimiter(header)
            self.names = tuple(name.strip() for name in _split(header, self._delimiter))
        else:
            self._first = 0
            self._delimiter = _delimiter(next(filter(_is_data, lines), ""))
            self.names = names
        if not any(_is_data(line) for line in lines[self._first :]):
            raise RecordError(f"{source}: there is a header but no data line after it; check the export")

    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """Parse the requested columns, each of shape (n_time,)."""
        columns = [self.names.index(name) for name in wanted]
        try:
            block = np.loadtxt(self._lines[self._first :], delimiter=self._delimiter, quotechar='"', ndmin=2)
        except ValueError:
            # Text in a column that is not requested, an empty cell, or an error: the slow reader decides.
            return dict(zip(wanted, self._parse_line_by_line(columns), strict=True))
        if block.shape[1] != len(self.names):
            self._refuse_width(self._first_data_line() + 1, block.shape[1])
        return {name: np.ascontiguousarray(block[:, i]) for name, i in zip(wanted, columns, strict=True)}

    def locate(self, row: int) -> str:
        """Line of a row; blank lines and comments count as lines but not as rows."""
        for number, (index, _) in enumerate(self._rows()):
            if number == row:
                return f"line {index + 1}"
        return f"row {row + 1}"

    def _rows(self) -> Iterator[tuple[int, str]]:
        for index in range(self._first, len(self._lines)):
            if _is_data(self._lines[index]):
                yield index, self._lines[index]

    def _first_data_line(self) -> int:
        return next(index for index, _ in self._rows())

    def _parse_line_by_line(self, columns: Sequence[int]) -> NDArray[np.float64]:
        rows: list[list[float]] = []
        for index, line in self._rows():
            fields = _split(line.partition("#")[0], self._delimiter)
            while len(fields) > len(self.names) and not fields[-1].strip():
                fields.pop()
            if len(fields) != len(self.names):
                self._refuse_width(index + 1, len(fields))
            rows.append([self._number(fields[column], index + 1, column) for column in columns])
        return np.asarray(rows, dtype=np.float64).reshape(len(rows), len(columns)).T.copy()

    def _number(self, field: str, line: int, column: int) -> float:
        text = field.strip()
        if _NUMBER.fullmatch(text):
            return float(text)
        if text.casefold() in _MISSING:
            return float("nan")
        where = f"{self._source}: line {line}, column '{self.names[column]}'"
        if _DECIMAL_COMMA.fullmatch(text):
            raise RecordError(f"{where} holds '{text}' with a decimal comma; export with decimal points")
        shown = text if len(text) <= 40 else text[:40] + "..."
        raise RecordError(f"{where} holds '{shown}' where a number was expected; correct or delete the line")

    def _refuse_width(self, line: int, n_fields: int) -> None:
        hint = (
            "export with decimal points if these are decimal commas"
            if self._delimiter == "," and n_fields > len(self.names)
            else "complete or delete the line"
        )
        raise RecordError(
            f"{self._source}: line {line} has {_count(n_fields, 'field')} where the header "
            f"names {_count(len(self.names), 'column')}; {hint}"
        )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _is_data(line: str) -> bool:
    return bool(line) and not line.isspace() and not line.lstrip().startswith("#")


def _delimiter(header: str) -> str:
    return next((character for character in "\t;" if character in header), ",")


def _split(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [""])
    except csv.Error:
        # A field beyond the size limit of the csv module: returned as one field, which matches no number and no name.
        return [line]


def _find_header(lines: Sequence[str], source: str) -> tuple[str, int]:
    """Header text and the index of the line after it."""
    index = next((index for index, line in enumerate(lines) if _is_data(line)), None)
    if index is None:
        raise RecordError(f"{source}: the file holds no header and no data; check the export")
    line = lines[index]
    comment = next((above.strip().lstrip("# ") for above in reversed(lines[:index]) if above.strip()), "")
    delimiter = _delimiter(line)
    fields = _split(line, delimiter)
    if not all(_NUMBER.fullmatch(field.strip()) or not field.strip() for field in fields):
        return line, index + 1
    named = _split(comment, delimiter)
    if len(named) == len(fields) and not any(_NUMBER.fullmatch(name.strip()) for name in named):
        return comment, index
    raise RecordError(
        f"{source}: line {index + 1} holds numbers where column names were expected; "
        "add a header line such as t_s,displacement_m,force_n"
    )


def read_text_bytes(path: Path) -> bytes:
    """Read a whole text file after a check of its start, because a wrong file may be very large."""
    with path.open("rb") as stream:
        head = stream.read(_LONGEST_LINE)
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
        return head + stream.read()


def _decode(data: bytes, path: Path) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RecordError(
            f"{path}: line {line}, byte {error.start} of the file is {data[error.start]:#04x}, which is "
            "not UTF-8 text; save the file as UTF-8"
        ) from error
