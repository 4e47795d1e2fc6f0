"""Contents of HDF5 files (netCDF 4, MATLAB 7.3) and of .xlsx workbooks, counted before they are read."""

from __future__ import annotations

import datetime
import io
import math
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import array_dataclass
from mrwork.errors import RecordError, reason_of
from mrwork.store.input_file import LEAST, Allowance

Format = Literal["hdf5", "xlsx"]

_DEEPEST: Final = 2
_MOST: Final = 10_000
_LONGEST: Final = 100_000
_MOST_SHEETS: Final = 100
# Bytes of XML in which a workbook has a byte of its cells, with room.
_MARKUP: Final = 4
_WORKBOOK: Final = "xl/workbook.xml"
# Ends of lines and separators, within a cell.
_BLANKS: Final = str.maketrans(
    dict.fromkeys("\t\n\v\f\r\x1c\x1d\x1e\x85\u2028\u2029", " ") | {"#": "\N{FULLWIDTH NUMBER SIGN}"}
)


@array_dataclass()
class Member:
    """A group, data set or sheet: its attributes that are numbers or texts, and its array if that has real numbers."""

    is_group: bool
    attributes: Mapping[str, Any]
    array: NDArray[np.generic] | None


def members_of(
    data: bytes, form: Format, path: Path, *, name: str = "HDF5 file", remedy: str = "write it again"
) -> dict[str, Member]:
    """Members of the file at `path` by name; a file that is no readable `name`, or claims too much, is refused.

    Of HDF5 down to the second level, by path, and the file itself as "", without links to other files and names with
    `#`; of .xlsx the sheets, by name, as bytes of a text with tabs between cells.
    """
    try:
        return (_hdf5 if form == "hdf5" else _xlsx)(data, path)
    except (RecordError, MemoryError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # the libraries raise whatever a damaged file leads them to; one panics
        raise RecordError(f"{path}: not a readable {name} ({reason_of(error)}); {remedy}") from None


def _hdf5(data: bytes, path: Path) -> dict[str, Member]:
    import h5py

    allowance = Allowance(path, len(data))
    with h5py.File(io.BytesIO(data), "r") as file:
        members = [("", file), *_members(file, "", 1)]
        for name, member in members:
            if _is_numeric(member):
                allowance.take(math.prod(member.shape) * max(member.dtype.itemsize, 8), f"'{name}'")
        return {
            name: Member(
                is_group=isinstance(member, h5py.Group),
                attributes=dict(_attributes(member)),
                array=np.ascontiguousarray(member[()]) if _is_numeric(member) else None,
            )
            for name, member in members
        }


def _members(group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Members of a group; links to other files and MATLAB's own tables (`#refs#`) are not followed."""
    import h5py

    for number, name in enumerate(group):
        if number == _MOST:
            raise ValueError(f"more than {_MOST} entries")
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        member, path = group[name], f"{prefix}{name}"
        yield path, member
        if isinstance(member, h5py.Group) and depth < _DEEPEST:
            yield from _members(member, f"{path}/", depth + 1)


def _is_numeric(member: Any) -> bool:
    """Whether the file itself holds real numbers there."""
    import h5py

    return (
        isinstance(member, h5py.Dataset)
        and member.shape is not None
        and member.dtype.kind in "iuf"
        and not member.is_virtual
        and not member.external
    )


def _attributes(member: Any) -> Iterator[tuple[str, Any]]:
    """Attributes that are a number or a text."""
    for name in member.attrs:
        identifier = member.attrs.get_id(name)
        if math.prod(identifier.shape or ()) != 1 or identifier.dtype.kind not in "iufSO":
            continue
        try:
            value = np.ravel(member.attrs[name])[0]
        except OSError:
            # References to what is not there.
            continue
        value = value.decode(errors="replace") if isinstance(value, bytes) else value
        value = value.item() if isinstance(value, np.generic) else value
        if isinstance(value, int | float | str) and not (isinstance(value, str) and len(value) > _LONGEST):
            yield name, value


def _xlsx(data: bytes, path: Path) -> dict[str, Member]:
    import python_calamine

    allowance = Allowance(path, len(data))
    unpacked = Allowance(path, _MARKUP * len(data), least=_MARKUP * LEAST)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if _WORKBOOK not in archive.namelist():
            raise ValueError("it holds no workbook")
        for entry in archive.infolist():
            unpacked.take(entry.file_size, f"'{entry.filename}'")
    book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
    names = [
        each.name for each in book.sheets_metadata if each.typ == python_calamine.SheetTypeEnum.WorkSheet
    ]
    if len(names) > _MOST_SHEETS:
        raise ValueError(f"more than {_MOST_SHEETS} sheets")
    return {
        name: Member(
            is_group=False,
            attributes={},
            array=np.frombuffer(_text(book.get_sheet_by_name(name), allowance), dtype=np.uint8),
        )
        for name in names
    }


def _text(sheet: Any, allowance: Allowance) -> bytes:
    """The rows of a sheet as lines; a text that stands in many cells is in the file once, and counts in each."""
    lines = []
    for row in sheet.iter_rows():
        line = "\t".join(map(_cell, row))
        allowance.take(len(line), "a sheet")
        lines.append(line)
    return "\n".join(lines).encode("utf-8", "replace").rstrip(b"\n")


def _cell(value: Any) -> str:
    if isinstance(value, str):
        text = value.translate(_BLANKS)
        return '"' + text.replace('"', '""') + '"' if '"' in text else text
    if isinstance(value, datetime.timedelta):
        seconds, rest = divmod(round(value / datetime.timedelta(microseconds=1)), 10**6)
        return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}.{rest:06d}"
    if isinstance(value, datetime.datetime):
        return value.isoformat(" ")
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return repr(float(value)) if isinstance(value, float) else str(value)
