"""Program of the child process of `child_reader`; it stands alone because it imports nothing of mrwork.

The file comes through stdin; the function that is called as its `Format` writes to stdout what is in it. The library of
the format is imported first, so that the limits do not count the imports.
"""

from __future__ import annotations

import datetime
import importlib
import io
import json
import math
import sys
import time
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, Any, Final

try:
    import resource
except ImportError:
    # Windows; the parent limits the time there.
    resource = None  # type: ignore[assignment]  # on systems without it

NO_MEMORY = 3
"""Exit status where the memory that this process was started with is too little."""

_LIBRARIES: Final[Mapping[str, str]] = {
    "hdf5": "h5py",
    "parquet": "pyarrow.parquet",
    "xlsx": "python_calamine",
}

_DEEPEST = 2
_MOST = 10_000
_LONGEST = 100_000

_WORKBOOK = "xl/workbook.xml"
_MOST_SHEETS = 100
# Bytes of the words as which a text is written.
_WORD = 8
# Ends of lines and separators, within a cell.
_BLANKS = str.maketrans(
    dict.fromkeys("\t\n\v\f\r\x1c\x1d\x1e\x85\u2028\u2029", " ") | {"#": "\N{FULLWIDTH NUMBER SIGN}"}
)


def main(form: str, seconds: float, memory: int) -> None:
    """Read the file within limits on the time of the processor [s] and on the memory beyond that of the imports [B]."""
    own = math.inf
    try:
        data = sys.stdin.buffer.read()
        importlib.import_module(_LIBRARIES[form])
        own = _limit(seconds, memory)
        globals()[form](data, sys.stdout.buffer)
    except (ImportError, MemoryError) as error:
        sys.exit(NO_MEMORY if _memory_before < own else _reason(error))
    except Exception as error:  # the libraries raise whatever a damaged file leads them to
        sys.exit(_reason(error))


def _reason(error: Exception) -> str:
    try:
        reason = str(error).partition("\n")[0] or type(error).__name__
    except Exception:  # a text that cannot be made
        reason = type(error).__name__
    return reason.encode("ascii", "replace").decode()


def limit_of(name: str) -> float:
    """The limit that this process has, by its name in `resource`."""
    if resource is None:
        return math.inf
    limits = resource.getrlimit(getattr(resource, name))
    return min((each for each in limits if each != resource.RLIM_INFINITY), default=math.inf)


_memory_before = min(limit_of("RLIMIT_AS"), limit_of("RLIMIT_DATA"))


def _limit(seconds: float, memory: int) -> float:
    """Set the limits, none above that which the process was started with; return its own limit of the memory."""
    if resource is None:
        return math.inf
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _lower("RLIMIT_CPU", math.ceil(time.process_time() + seconds))
    try:
        with open("/proc/self/statm", "rb") as statm:  # noqa: PTH123 - a path takes longer to import
            used = int(statm.read().split()[0]) * resource.getpagesize()
    except OSError:
        # Other systems do not enforce this limit.
        return math.inf
    _lower("RLIMIT_AS", used + memory)
    return used + memory


def _lower(name: str, wanted: int) -> None:
    least = int(min(wanted, limit_of(name)))
    resource.setrlimit(getattr(resource, name), (least, least))


def hdf5(data: bytes, out: IO[bytes]) -> None:
    """A line of JSON with the path, shape, type and attributes of everything in the file, then the arrays."""
    import h5py
    import numpy as np

    with h5py.File(io.BytesIO(data), "r") as file:
        members = [("", file), *_members(file, "", 1)]
        head = {path: _describe(member) for path, member in members}
        out.write(json.dumps(head).encode() + b"\n")
        out.flush()
        for path, member in members:
            if head[path]["type"] is not None:
                out.write(np.ascontiguousarray(member[()]).data)


def _entry(shape: Sequence[int], kind: str | None, attributes: dict[str, Any]) -> dict[str, Any]:
    """JSON entry of an array; its type is null unless it holds real numbers."""
    return {"group": False, "shape": shape, "type": kind, "attributes": attributes}


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


def _describe(member: Any) -> dict[str, Any]:
    """Shape and type, which is null for all but real numbers that the file itself holds, and attributes."""
    import h5py

    is_numeric = (
        isinstance(member, h5py.Dataset)
        and member.shape is not None
        and member.dtype.kind in "iuf"
        and not member.is_virtual
        and not member.external
    )
    shape, kind = (member.shape, member.dtype.str) if is_numeric else ((), None)
    return _entry(shape, kind, dict(_attributes(member))) | {"group": isinstance(member, h5py.Group)}


def _attributes(member: Any) -> Iterator[tuple[str, Any]]:
    """Attributes that are a number or a text."""
    import numpy as np

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


def parquet(data: bytes, out: IO[bytes]) -> None:
    """A line of JSON with the columns, then those of numbers as float64, each read by itself."""
    import numpy as np
    import pyarrow
    from pyarrow.parquet import ParquetFile

    file = ParquetFile(pyarrow.BufferReader(data))
    n_rows = file.metadata.num_rows
    numeric = {
        field.name: pyarrow.types.is_integer(field.type) or pyarrow.types.is_floating(field.type)
        for field in file.schema_arrow
    }
    head: dict[str, object] = {
        name: _entry([n_rows], "<f8" if known else None, {}) for name, known in numeric.items()
    }
    out.write(json.dumps(head).encode() + b"\n")
    out.flush()
    for name, known in numeric.items():
        if known:
            # A single thread: the others would count towards the limit of memory.
            column = file.read(columns=[name], use_threads=False).column(name)
            if len(column) != n_rows:
                raise ValueError(f"column '{name}' has {len(column)} rows of {n_rows}")
            out.write(np.ascontiguousarray(column.to_numpy(), dtype="<f8").data)


def xlsx(data: bytes, out: IO[bytes]) -> None:
    """A line of JSON with the sheets, then each as UTF-8 text: a line for each row, with tabs between the cells."""
    import python_calamine

    if _WORKBOOK not in zipfile.ZipFile(io.BytesIO(data)).namelist():
        raise ValueError("it holds no workbook")
    book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
    tables = [
        each.name for each in book.sheets_metadata if each.typ == python_calamine.SheetTypeEnum.WorkSheet
    ]
    if len(tables) > _MOST_SHEETS:
        raise ValueError(f"more than {_MOST_SHEETS} sheets")
    texts = [_text(book.get_sheet_by_name(name)) for name in tables]
    head = {
        str(number): _entry([len(text) // _WORD], "<u8", {"name": name})
        for number, (name, text) in enumerate(zip(tables, texts, strict=True))
    }
    out.write(json.dumps(head).encode() + b"\n")
    for text in texts:
        out.write(text)


def _text(sheet: Any) -> bytes:
    rows = ("\t".join(map(_cell, row)) for row in sheet.iter_rows())
    text = "\n".join(rows).encode("utf-8", "replace").rstrip(b"\n")
    return text + b"\n" * (-len(text) % _WORD)


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


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]))
