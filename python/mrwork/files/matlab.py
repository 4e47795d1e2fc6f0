"""Numeric vectors and matrices of MATLAB .mat files, versions 4 to 7; files of version 7.3 are HDF5.

SciPy reads these files too, but a damaged type tag ends the whole process in its reader (1.17), and it allocates the
size that a header claims before it checks whether the file can hold it. Here every size is counted first.
"""

from __future__ import annotations

import hashlib
import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, VectorTable, unused_parts
from mrwork.store.input_file import LEAST, MATRIX, RECORD, Allowance, FileKind, bytes_of
from mrwork.store.members import members_of, readable

_DAMAGED: Final = "it is cut off or damaged, save it again"
# A test has as many samples at least.
_FEWEST_ROWS: Final = 10
_HDF5: Final = b"\x89HDF"
# Bytes that matrices may take in all, whatever the size of the file: three sparse ones of a building with 4096
# coordinates.
_FOR_MATRICES: Final = 400 << 20
# Bytes of a number as it is used, and of an item of a sparse matrix while it is put in its place.
_NUMBER: Final = 8
_SPARSE_ITEM: Final = 40

# Version 4: the tens digit of the type number gives the item type, the last digit the kind of matrix.
_V4_LAST_TYPE: Final = 4052
_V4_ITEMS: Final = ("f8", "f4", "i4", "i2", "u2", "u1")

# Version 5: types of data elements, and the classes of matrices that hold numbers.
_V5_HEADER: Final = 128
_MATRIX: Final = 14
_COMPRESSED: Final = 15
_STRUCT: Final = 2
_SPARSE: Final = 5
_NUMERIC_CLASSES: Final = range(6, 16)
_V5_ITEMS: Final[Mapping[int, str]] = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_COMPLEX_FLAG: Final = 0x0800

Variables = dict[str, "NDArray[np.generic] | None"]
Block = bytes | memoryview


def open_matlab(path: Path) -> ColumnTable:
    """Open a .mat file; the columns are its numeric vectors, or those in the fields of its only struct.

    Without vectors they are the columns of its only matrix, or its rows where these are longer, by their numbers.
    """
    data, variables = _variables(path, RECORD)
    columns = {
        name: array.ravel()
        for name, array in variables.items()
        if array is not None and array.size == max(array.shape, default=0)
    }
    matrices = [
        name
        for name, array in variables.items()
        if array is not None and array.ndim == 2 and min(array.shape) > 1 and max(array.shape) >= _FEWEST_ROWS
    ]
    if max((column.size for column in columns.values()), default=0) < 2 and len(matrices) == 1:
        matrix = np.asarray(variables[matrices[0]])
        rows = matrix if matrix.shape[0] < matrix.shape[1] else matrix.T
        columns = dict(zip(numbered_names(len(rows)), rows, strict=True))
        variables.pop(matrices[0])
    if not columns:
        listed = ", ".join(f"'{name}'" for name in variables) or "nothing"
        raise RecordError(
            f"{path}: expected one numeric vector per quantity, found {listed}; "
            "save each column as a variable of its own, such as t_s, displacement_m, force_n"
        )
    others = [f"'{name}'" for name in variables if name not in columns]
    return VectorTable(
        source=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        vectors=columns,
        unused=unused_parts("variable", others, "no vector of numbers"),
    )


def read_matlab_matrices(path: Path, kind: FileKind = MATRIX) -> dict[str, Floats]:
    """Read the real matrices of a .mat file, or of its only struct, by name; sparse matrices become dense."""
    _, variables = _variables(path, kind)
    return {
        name: array.astype(np.float64, copy=False)
        for name, array in variables.items()
        if array is not None and array.ndim == 2 and array.size
    }


def _variables(path: Path, kind: FileKind) -> tuple[bytes, Variables]:
    """Bytes of the file, and its variables by name; `None` for contents other than real numbers."""
    data = bytes_of(path, kind)
    if not data:
        raise RecordError(f"{path}: the file is empty; a .mat file was expected")
    if data.startswith(_HDF5) or data[512:516] == _HDF5:
        return data, _version_73(data, path)
    size, least = (0, _FOR_MATRICES) if kind is MATRIX else (len(data), LEAST)
    allowance = Allowance(path, size, least=least)
    # A version 4 file starts with a small integer, a version 5 file with text.
    read = _version_4 if 0 in data[:4] else _version_5
    with readable(path, ".mat file", _DAMAGED):
        return data, read(memoryview(data), allowance)


def _version_73(data: bytes, path: Path) -> Variables:
    """Variables of a version 7.3 file, or the fields of its only struct."""
    members = members_of(data, path, name="version 7.3 .mat file", remedy=_DAMAGED)
    names = [member for member in members if member and "/" not in member]
    prefix = ""
    if len(names) == 1 and members[names[0]].is_group:
        prefix = f"{names[0]}/"
        names = [member.removeprefix(prefix) for member in members if member.startswith(prefix)]
    variables: Variables = dict.fromkeys(names)
    for name in names:
        member = members[f"{prefix}{name}"]
        is_text = member.attributes.get("MATLAB_class", "double") == "char"
        if member.array is not None and not is_text and "MATLAB_empty" not in member.attributes:
            # MATLAB stores columns one after the other.
            variables[name] = member.array.T
    return variables


def _version_4(data: Block, allowance: Allowance) -> Variables:
    order = "<" if 0 <= struct.unpack("<i", data[:4])[0] <= _V4_LAST_TYPE else ">"
    variables: Variables = {}
    position = 0
    while position < len(data):
        kind, n_rows, n_columns, is_complex, name_length = struct.unpack_from(f"{order}5i", data, position)
        precision = kind // 10 % 10
        if not 0 <= kind <= _V4_LAST_TYPE or min(n_rows, n_columns, name_length - 1) < 0:
            raise ValueError(f"byte {position} starts no matrix")
        item = order + _V4_ITEMS[precision]
        size = n_rows * n_columns * np.dtype(item).itemsize
        start = position + 20 + name_length
        position = start + size * (2 if is_complex else 1)
        name = _text(data[start - name_length : start])
        variables[name] = None
        if kind % 10 in (0, 2) and not is_complex:
            variables[name] = stored = _array(data[start : start + size], item, (n_rows, n_columns))
            if kind % 10 == 2:
                # A sparse matrix as rows of row, column (from 1) and item; the last row has the size.
                rows, columns = stored[:, :2].astype(np.int64).T
                shape = int(rows[-1]), int(columns[-1])
                items = stored[:-1, 2]
                variables[name] = _dense(items, rows[:-1] - 1, columns[:-1] - 1, shape, name, allowance)
    return variables


def _version_5(data: Block, allowance: Allowance) -> Variables:
    endian = bytes(data[126:128])
    if endian not in (b"IM", b"MI"):
        raise ValueError("the header has no byte-order mark")
    reader = _Version5(order="<" if endian == b"IM" else ">", allowance=allowance)
    variables: Variables = {}
    fields: Variables | None = None
    for kind, block in reader.elements(data[_V5_HEADER:]):
        if kind == _COMPRESSED:
            kind, block = reader.unpack(block)
        if kind == _MATRIX:
            name, content = reader.matrix(block, with_fields=True)
            if isinstance(content, dict):
                fields, content = content, None
            variables[name] = content
    return variables if fields is None or len(variables) > 1 else fields


@dataclass(frozen=True, slots=True, kw_only=True)
class _Version5:
    """Reads data elements of version 5 in a byte order, with an allowance for all of them."""

    order: str
    allowance: Allowance

    def elements(self, block: Block) -> Iterator[tuple[int, Block]]:
        """Type and content of each data element of a block."""
        position = 0
        while position < len(block):
            kind, size = struct.unpack_from(f"{self.order}2I", block, position)
            start = position + 8
            if kind >> 16:
                # Up to four bytes of content are stored within the eight bytes of the tag.
                kind, size, start = kind & 0xFFFF, kind >> 16, position + 4
            if not kind:
                # Zeros are no elements.
                return
            if (end := start + size) > len(block):
                raise ValueError(f"an element claims {size} bytes where {len(block) - start} are left")
            yield kind, block[start:end]
            # Content is padded to eight bytes, except compressed content.
            position = end if kind == _COMPRESSED else end + (position - end) % 8

    def unpack(self, block: Block) -> tuple[int, Block]:
        """Type and content of the element within a compressed one."""
        unpacker = zlib.decompressobj()
        kind, size = struct.unpack(f"{self.order}2I", unpacker.decompress(block, 8))
        self.allowance.take(size, "a compressed variable")
        return kind, memoryview(unpacker.decompress(unpacker.unconsumed_tail, size) if size else b"")

    def matrix(
        self, block: Block, *, with_fields: bool
    ) -> tuple[str, NDArray[np.generic] | Variables | None]:
        """Name and content of a matrix element: an array, a single struct `with_fields`, `None` for others."""
        elements = self.elements(block)
        parts = [next(elements)[1] for _ in range(3)]
        (flags,) = struct.unpack_from(f"{self.order}I", parts[0])
        # No side is negative: for NumPy -1 is a side to be found.
        shape = tuple(np.frombuffer(parts[1], dtype=f"{self.order}u4").tolist())
        name, matrix_class = _text(parts[2]), flags & 0xFF
        if with_fields and matrix_class == _STRUCT and shape == (1, 1):
            return name, self._fields(elements)
        if flags & _COMPLEX_FLAG:
            return name, None
        if matrix_class == _SPARSE and len(shape) == 2:
            return name, self._sparse(elements, shape, name)
        return name, self._items(elements, shape) if matrix_class in _NUMERIC_CLASSES else None

    def _items(
        self, elements: Iterator[tuple[int, Block]], shape: tuple[int, ...] = (-1,)
    ) -> NDArray[np.generic]:
        """Items of the next element in the shape of the matrix, or flat without a shape."""
        kind, items = next(elements)
        return _array(items, self.order + _V5_ITEMS[kind], shape)

    def _sparse(self, elements: Iterator[tuple[int, Block]], shape: tuple[int, ...], name: str) -> Floats:
        """Dense matrix from compressed columns: column j has the items `starts[j]` to `starts[j + 1]`, in `rows`."""
        rows, starts = self._integers(next(elements)[1]), self._integers(next(elements)[1])
        items, n_items = self._items(elements), int(starts[-1] - starts[0])
        columns = np.repeat(np.arange(starts.size - 1), np.diff(starts))
        return _dense(items[:n_items], rows[:n_items], columns, shape, name, self.allowance)

    def _fields(self, elements: Iterator[tuple[int, Block]]) -> Variables:
        (length,), names = self._integers(next(elements)[1]), next(elements)[1]
        fields: Variables = {}
        for start in range(0, len(names), length):
            content = self.matrix(next(elements)[1], with_fields=False)[1]
            fields[_text(names[start : start + length])] = None if isinstance(content, dict) else content
        return fields

    def _integers(self, block: Block) -> NDArray[np.int64]:
        # Of eight bytes, in which no difference of the indices of a file wraps.
        return np.frombuffer(block, dtype=f"{self.order}i4").astype(np.int64)


def _text(name: Block) -> str:
    return bytes(name).partition(b"\0")[0].decode("ascii", "replace")


def _array(items: Block, item: str, shape: tuple[int, ...]) -> NDArray[np.generic]:
    """Array of the items, which the format stores column by column."""
    return np.frombuffer(items, dtype=item).reshape(shape, order="F")


def _dense(
    items: NDArray[np.generic],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    shape: tuple[int, ...],
    name: str,
    allowance: Allowance,
) -> Floats:
    """Matrix of zeros but for items in rows and columns from 0; items in the same place are added."""
    from scipy.sparse import coo_array

    count = _NUMBER * math.prod(shape) + _SPARSE_ITEM * rows.size
    allowance.take(count, f"sparse variable '{name}', of {' x '.join(map(str, shape))},")
    matrix: Floats = coo_array((items.astype(np.float64), (rows, columns)), shape=shape).toarray()
    return matrix
