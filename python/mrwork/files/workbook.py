"""Sheets of .xlsx workbooks, read by python-calamine in a child process."""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mrwork.errors import RecordError
from mrwork.files.delimited import table_of_text
from mrwork.files.named_columns import ColumnTable
from mrwork.store.child_reader import TooLargeError, UnreadableError, read_members
from mrwork.store.input_file import RECORD, bytes_of


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sheet:
    """A sheet that has a table: its name, the length of its text, and whether it is what the caller looks for."""

    name: str
    length: int
    table: ColumnTable
    is_record: bool


def open_workbook(path: Path, is_record: Callable[[ColumnTable], bool]) -> ColumnTable:
    """Open an .xlsx workbook: its first sheet that `is_record`, else the longest one.

    A sheet is read as a text table is, so that header blocks, rows of units and times of the day are found. Formulas
    have the values that were saved with them.
    """
    if importlib.util.find_spec("python_calamine") is None:
        raise RecordError(f"{path}: reading .xlsx needs python-calamine; run: pip install 'mrwork[xlsx]'")
    data = bytes_of(path, RECORD)
    try:
        members = read_members(data, "xlsx")
    except TooLargeError as error:
        raise RecordError(f"{path}: {error}; save one test, without other sheets") from None
    except UnreadableError as error:
        raise RecordError(
            f"{path}: not a readable .xlsx workbook ({error}); save it again, without a password, or as CSV"
        ) from None
    digest = hashlib.sha256(data).hexdigest()
    texts = {
        str(member.attributes["name"]): member.array.tobytes()
        for member in members.values()
        if member.array is not None and member.array.size
    }
    sheets = [sheet for name, text in texts.items() for sheet in _opened(path, name, text, digest, is_record)]
    if not sheets:
        listed = ", ".join(f"'{name}'" for name in texts) or "it has none with cells"
        raise RecordError(f"{path}: no sheet has a table of numbers ({listed}); put one test into a sheet")
    records = [sheet for sheet in sheets if sheet.is_record]
    read = next(iter(records), max(sheets, key=lambda sheet: sheet.length))
    others = [name for name in texts if name != read.name]
    read.table.further = tuple(sheet.name for sheet in records if sheet is not read)
    unused = [f"'{name}'" for name in others if name not in read.table.further]
    if unused:
        read.table.unused = (f"sheet{'s' if len(unused) > 1 else ''} {', '.join(unused)}",)
    return read.table


def _opened(
    path: Path, name: str, text: bytes, digest: str, is_record: Callable[[ColumnTable], bool]
) -> tuple[_Sheet, ...]:
    try:
        table = table_of_text(text, source=f"{path}, sheet '{name}'", sha256=digest)
    except RecordError:
        return ()
    return (_Sheet(name=name, length=len(text), table=table, is_record=is_record(table)),)
