"""Contents of HDF5 files (netCDF 4, MATLAB 7.3) and of Excel workbooks, counted before they are read."""

from __future__ import annotations

import datetime
import io
import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import array_dataclass
from mrwork.errors import RecordError, reason_of
from mrwork.store.input_file import LEAST, Allowance

# First bytes of a compound file, which an .xls workbook is ([MS-CFB], 2.2).
_OF_XLS: Final = bytes.fromhex("d0cf11e0a1b11ae1")
# Bytes of XML in which a workbook has a byte of its cells, with room.
_MARKUP: Final = 4
# Ends of lines and separators, within a cell.
_BLANKS: Final = str.maketrans(
    dict.fromkeys("\t\n\v\f\r\x1c\x1d\x1e\x85\u2028\u2029", " ") | {"#": "\N{FULLWIDTH NUMBER SIGN}"}
)


@array_dataclass()
class Member:
    """A group or data set: its attributes that are numbers or texts, and its array if that has real numbers."""

    is_group: bool
    attributes: Mapping[str, Any]
    array: NDArray[np.generic] | None


def members_of(
    data: bytes, path: Path, *, name: str = "HDF5 file", remedy: str = "write it again", depth: int = 2
) -> dict[str, Member]:
    """Members of the HDF5 file at `path` down to the level `depth`, by path, and the file itself as "".

    Links to other files and names with `#` are left out. A file that is no readable `name`, or claims too much, is
    refused.
    """
    import h5py

    allowance = Allowance(path, len(data))
    with readable(path, name, remedy), h5py.File(io.BytesIO(data), "r") as file:
        members = [("", file), *_members(file, "", depth)]
        for label, member in members:
            if _is_numeric(member):
                allowance.take(math.prod(member.shape) * max(member.dtype.itemsize, 8), f"'{label}'")
        return {
            label: Member(
                is_group=isinstance(member, h5py.Group),
                attributes=dict(_attributes(member)),
                array=np.ascontiguousarray(member[()]) if _is_numeric(member) else None,
            )
            for label, member in members
        }


@contextmanager
def readable(path: Path, name: str, remedy: str) -> Iterator[None]:
    """Refuse the file at `path` as no readable `name` where the block ends in an error."""
    try:
        yield
    except (RecordError, MemoryError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # the libraries raise whatever a damaged file leads them to; one panics
        raise RecordError(f"{path}: not a readable {name} ({reason_of(error)}); {remedy}") from None


def _members(group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Members of a group; links to other files and MATLAB's own tables (`#refs#`) are not followed."""
    import h5py

    for name in group:
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member, path = group[name], f"{prefix}{name}"
        yield path, member
        if isinstance(member, h5py.Group) and depth > 1:
            yield from _members(member, f"{path}/", depth - 1)


def _is_numeric(member: Any) -> bool:
    import h5py

    return (
        isinstance(member, h5py.Dataset)
        and member.shape is not None
        and member.dtype.kind in "iuf"
        and not member.is_virtual
        and not member.external
    )


def _attributes(member: Any) -> Iterator[tuple[str, Any]]:
    for name in member.attrs:
        # A reference to what is not there is an error of the system.
        with suppress(OSError):
            values = np.ravel(member.attrs[name]).tolist()
            if len(values) == 1 and isinstance(values[0], int | float | str | bytes):
                yield name, values[0].decode(errors="replace") if isinstance(values[0], bytes) else values[0]


def sheets_of(data: bytes, path: Path) -> dict[str, list[str]]:
    """Sheets of the .xlsx or .xls workbook at `path` by name, each as lines with tabs between the cells."""
    import python_calamine

    unpacked = Allowance(path, _MARKUP * len(data), least=_MARKUP * LEAST)
    with readable(path, f"{path.suffix.lower()} workbook", "save it again, without a password, or as CSV"):
        # An .xls workbook is not packed.
        if not data.startswith(_OF_XLS):
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                for entry in archive.infolist():
                    unpacked.take(entry.file_size, f"'{entry.filename}'")
        allowance = Allowance(path, len(data))
        book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        return {
            sheet.name: _lines(book.get_sheet_by_name(sheet.name), allowance)
            for sheet in book.sheets_metadata
            if sheet.typ == python_calamine.SheetTypeEnum.WorkSheet
        }


def _lines(sheet: Any, allowance: Allowance) -> list[str]:
    """The rows of a sheet; a text that stands in many cells is in the file once, and counts in each."""
    lines = []
    for row in sheet.iter_rows():
        line = "\t".join(map(_cell, row))
        allowance.take(len(line), "a sheet")
        lines.append(line)
    return lines


def _cell(value: Any) -> str:
    if isinstance(value, str):
        text = value.translate(_BLANKS)
        return '"' + text.replace('"', '""') + '"' if '"' in text else text
    if isinstance(value, datetime.timedelta):
        seconds, rest = divmod(round(value / datetime.timedelta(microseconds=1)), 10**6)
        return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}.{rest:06d}"
    return str(value)
