"""Numeric vectors and matrices of MATLAB .mat files, versions 4 to 7; those of version 7.3 are HDF5.

SciPy reads these files too, but a damaged type tag ends the whole process in its reader (1.17), and it allocates the
size that a header claims before it checks whether the file can hold it. Here every length is checked.
"""

from __future__ import annotations

import hashlib
import math
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, VectorTable, unused_parts
from mrwork.store.input_file import LEAST, MATRIX, RECORD, Allowance, FileKind, bytes_of
from mrwork.store.members import Member, members_of


def hdf5_variables(data: bytes, path: Path) -> dict[str, NDArray[np.generic] | None]:
    """Variables of a version 7.3 file, or the fields of its only struct; `None` for others than real numbers."""
    name, damaged = "version 7.3 .mat file", "it is cut off or damaged, save it again"
    members = members_of(data, path, name=name, remedy=damaged)
    names = [each for each in members if each and "/" not in each]
    prefix = ""
    if len(names) == 1 and members[names[0]].is_group:
        prefix = f"{names[0]}/"
        names = [each.removeprefix(prefix) for each in members if each.startswith(prefix)]
    return {each: _values(members[f"{prefix}{each}"]) for each in names}


def _values(member: Member) -> NDArray[np.generic] | None:
    """An array of real numbers as MATLAB shows it; MATLAB stores columns one after the other."""
    is_text = member.attributes.get("MATLAB_class", "double") == "char"
    if member.array is None or is_text or "MATLAB_empty" in member.attributes:
        return None
    return member.array.T


# A test has as many samples at least.
_FEWEST_ROWS: Final = 10
_HDF5: Final = b"\x89HDF"
# Bytes that matrices may take in all, whatever the size of the file: three sparse ones of a building with 4096
# coordinates.
_FOR_MATRICES: Final = 400 << 20
# Elements of a file or of a struct, of which each may take no more than its tag.
_MOST_ELEMENTS: Final = 10_000
# Bytes that an item of a sparse matrix takes while it is put in its place, beside those of its value.
_SPARSE_ITEM: Final = 40
# Largest index of any version.
_LARGEST_INDEX: Final = 2**31
# Dimensions of an array, and the bytes of the longest without items: what NumPy can shape.
_MOST_DIMENSIONS: Final = 32
_LARGEST_ARRAY: Final = 2**63 - 1
# Bytes of a number as it is used, and of the pieces in which a variable is unpacked.
_NUMBER: Final = 8
_PIECE: Final = 1 << 20

# Version 4: the tens digit of the type number gives the item type, the last digit the kind of matrix.
_V4_LAST_TYPE: Final = 4052
_V4_ITEMS: Final = ("f8", "f4", "i4", "i2", "u2", "u1")

# Version 5: tags of data elements, and the classes of matrices that hold numbers.
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
    if max((each.size for each in columns.values()), default=0) < 2 and len(matrices) == 1:
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
    """Read the real matrices of a .mat file by name, or those of its only struct; sparse ones become dense."""
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
        return data, hdf5_variables(data, path)
    try:
        # A version 4 file starts with a small integer, a version 5 file with text.
        read = _version_4 if 0 in data[:4] else _version_5
        size, least = (0, _FOR_MATRICES) if kind is MATRIX else (len(data), LEAST)
        variables = read(memoryview(data), Allowance(path, size, least=least))
    except (DamagedError, struct.error, zlib.error) as error:
        raise RecordError(
            f"{path}: not a readable .mat file ({error}); it is cut off or damaged, save it again"
        ) from error
    return data, variables


def _array(
    items: Block, item: str, shape: tuple[int, ...], name: str, allowance: Allowance
) -> NDArray[np.generic]:
    """Array of the items, which the format stores column by column."""
    if len(items) != math.prod(shape) * np.dtype(item).itemsize:
        raise DamagedError(f"a {_sides(shape)} matrix has {len(items)} bytes of {item[1:]} items")
    # What the items take already has been counted.
    allowance.take(max(_NUMBER * math.prod(shape) - len(items), 0), f"variable '{name}'")
    return np.frombuffer(items, dtype=item).reshape(shape, order="F")


def _shape(sides: Iterable[int]) -> tuple[int, ...]:
    shape = tuple(int(side) for side in sides)
    if len(shape) > _MOST_DIMENSIONS:
        raise DamagedError(f"a matrix claims {len(shape)} dimensions, {_MOST_DIMENSIONS} at most are read")
    if min(shape, default=0) < 0 or _NUMBER * math.prod(max(side, 1) for side in shape) > _LARGEST_ARRAY:
        raise DamagedError(f"a matrix claims to be {_sides(shape)}")
    return shape


def _sides(shape: tuple[int, ...]) -> str:
    return " x ".join(str(side) for side in shape)


def _version_4(data: Block, allowance: Allowance) -> Variables:
    order = "<" if 0 <= struct.unpack("<i", data[:4])[0] <= _V4_LAST_TYPE else ">"
    variables: Variables = {}
    position = 0
    count = 0
    while position < len(data):
        _refuse_many(count := count + 1)
        kind, n_rows, n_columns, is_complex, name_length = struct.unpack_from(f"{order}5i", data, position)
        precision = kind // 10 % 10
        if not 0 <= kind <= _V4_LAST_TYPE or precision >= len(_V4_ITEMS):
            raise DamagedError(f"byte {position} starts no matrix")
        if min(n_rows, n_columns, name_length) < 0:
            raise DamagedError(f"byte {position} claims a negative size")
        item = order + _V4_ITEMS[precision]
        size = n_rows * n_columns * np.dtype(item).itemsize
        start = position + 20 + name_length
        position = start + size * (2 if is_complex else 1)
        if position > len(data):
            raise DamagedError(
                f"the header claims a {n_rows} x {n_columns} matrix, but the file has only {len(data)} bytes"
            )
        name = _text(data[start - name_length : start])
        variables[name] = None
        if kind % 10 in (0, 2) and not is_complex:
            stored = _array(data[start : start + size], item, (n_rows, n_columns), name, allowance)
            variables[name] = stored if kind % 10 == 0 else sparse_version_4(stored, name, allowance)
    return variables


def _version_5(data: Block, allowance: Allowance) -> Variables:
    endian = bytes(data[126:128])
    if endian not in (b"IM", b"MI"):
        raise DamagedError("the header has no byte-order mark")
    order = "<" if endian == b"IM" else ">"
    variables: Variables = {}
    fields: Variables | None = None
    for kind, block in _elements(data[_V5_HEADER:], order):
        if kind == _COMPRESSED:
            kind, block = _unpack_element(block, order, allowance)
        if kind == _MATRIX:
            name, content = _matrix(block, order, allowance, fields=True)
            if isinstance(content, dict):
                fields, content = content, None
            variables[name] = content
    return variables if fields is None or len(variables) > 1 else fields


def _elements(block: Block, order: str) -> Iterator[tuple[int, Block]]:
    """Tag and content of each data element of a version 5 block."""
    position = 0
    count = 0
    while position < len(block):
        _refuse_many(count := count + 1)
        kind, size = struct.unpack_from(f"{order}2I", block, position)
        start = position + 8
        if kind >> 16:
            # Up to four bytes of content are stored within the eight bytes of the tag.
            kind, size, start = kind & 0xFFFF, kind >> 16, position + 4
        if start + size > len(block):
            raise DamagedError(f"an element claims {size} bytes where {len(block) - start} are left")
        yield kind, block[start : start + size]
        # Content is padded to eight bytes, except compressed content.
        position = start + size if kind == _COMPRESSED else start + size + (-(start + size - position) % 8)


def _refuse_many(count: int) -> None:
    if count > _MOST_ELEMENTS:
        raise DamagedError(f"it has more than {_MOST_ELEMENTS} elements")


def _unpack_element(block: Block, order: str, allowance: Allowance) -> tuple[int, Block]:
    unpacker = zlib.decompressobj()
    kind, size = struct.unpack(f"{order}2I", unpacker.decompress(block, 8))
    if kind >> 16:
        raise DamagedError("a compressed element holds no matrix")
    allowance.take(size, "a compressed variable")
    content = bytearray(size)
    filled = 0
    # In pieces, because the library holds what it unpacks twice.
    while filled < size and (
        piece := unpacker.decompress(unpacker.unconsumed_tail, min(_PIECE, size - filled))
    ):
        content[filled : filled + len(piece)] = piece
        filled += len(piece)
    if filled < size:
        raise DamagedError(f"an element claims {size} bytes where {filled} are left")
    return kind, memoryview(content)


def _text(name: Block) -> str:
    return bytes(name).partition(b"\0")[0].decode("ascii", "replace")


def _matrix(
    block: Block, order: str, allowance: Allowance, *, fields: bool
) -> tuple[str, NDArray[np.generic] | Variables | None]:
    """Name and content of a matrix element: an array, `None` for other contents, or the `fields` of a single struct."""
    elements = _elements(block, order)
    parts = [next(elements, (0, b""))[1] for _ in range(3)]
    flags = struct.unpack_from(f"{order}I", parts[0])[0]
    shape = _shape(_integers(parts[1], order))
    name = _text(parts[2])
    matrix_class = flags & 0xFF
    if fields and matrix_class == _STRUCT and shape == (1, 1):
        return name, _fields(elements, order, allowance)
    if flags & _COMPLEX_FLAG:
        return name, None
    if matrix_class == _SPARSE and len(shape) == 2:
        parts = [next(elements, (0, b""))[1] for _ in range(2)]
        kind, values = next(elements, (0, b""))
        n_items = sum(map(len, parts)) // 4
        allowance.take(_SPARSE_ITEM * n_items, f"sparse variable '{name}', of {n_items} items,")
        rows, starts = (_integers(part, order) for part in parts)
        items = _items(kind, values, order, name, allowance)
        return name, sparse_version_5(rows, starts, items, (shape[0], shape[1]), name, allowance)
    if matrix_class not in _NUMERIC_CLASSES:
        return name, None
    kind, block = next(elements, (0, b""))
    return name, _items(kind, block, order, name, allowance, shape)


def _items(
    kind: int, items: Block, order: str, name: str, allowance: Allowance, shape: tuple[int, ...] | None = None
) -> NDArray[np.generic]:
    """Items of a data element in the shape of the matrix, or flat without a shape."""
    if kind not in _V5_ITEMS:
        raise DamagedError(f"variable '{name}' has items of the unknown type {kind}")
    item = order + _V5_ITEMS[kind]
    length = len(items) // np.dtype(item).itemsize
    return _array(items, item, (length,) if shape is None else shape, name, allowance)


def _fields(elements: Iterator[tuple[int, Block]], order: str, allowance: Allowance) -> Variables:
    length = next(iter(_integers(next(elements, (0, b""))[1], order)), 0)
    names = next(elements, (0, b""))[1]
    if length <= 0:
        raise DamagedError("a struct has field names of no length")
    fields: Variables = {}
    for start in range(0, len(names), length):
        name = _text(names[start : start + length])
        kind, block = next(elements, (0, b""))
        if kind != _MATRIX:
            raise DamagedError(f"field '{name}' holds no matrix")
        content = _matrix(block, order, allowance, fields=False)[1]
        fields[name] = None if isinstance(content, dict) else content
    return fields


def _integers(block: Block, order: str) -> NDArray[np.int64]:
    if len(block) % 4:
        raise DamagedError(f"{len(block)} bytes are no whole number of integers")
    # Of eight bytes, in which no difference or product of the indices of a file wraps.
    return np.frombuffer(block, dtype=f"{order}i4").astype(np.int64)


class DamagedError(Exception):
    """Damage inside a .mat file; the caller adds the name of the file."""


def sparse_version_4(triplets: NDArray[np.generic], name: str, allowance: Allowance) -> Floats:
    """Dense matrix from rows of row, column (from 1) and value, shape (n_items + 1, 3); the last row has the size."""
    if triplets.ndim != 2 or triplets.shape[1] != 3 or not len(triplets):
        raise DamagedError(f"sparse variable '{name}' is not a list of row, column, value")
    allowance.take(_SPARSE_ITEM * len(triplets), f"sparse variable '{name}', of {len(triplets)} items,")
    stated = triplets[:, :2].astype(np.float64)
    if not (np.abs(stated) <= _LARGEST_INDEX).all():
        raise DamagedError(f"sparse variable '{name}' has rows or columns that are no whole numbers")
    places = stated.astype(np.int64)
    shape, rows, columns = (int(places[-1, 0]), int(places[-1, 1])), places[:-1, 0] - 1, places[:-1, 1] - 1
    return _fill_matrix(rows, columns, triplets[:-1, 2], shape, name, allowance)


def sparse_version_5(
    rows: NDArray[np.int64],
    starts: NDArray[np.int64],
    values: NDArray[np.generic],
    shape: tuple[int, int],
    name: str,
    allowance: Allowance,
) -> Floats:
    """Dense matrix from compressed columns: column j has the items `starts[j]` to `starts[j + 1]`, in `rows` from 0."""
    counts = np.diff(starts)
    if len(starts) != shape[1] + 1 or starts[0] != 0 or (counts < 0).any():
        raise DamagedError(f"sparse variable '{name}' has no order in its columns")
    n_items = int(starts[-1])
    if n_items > min(len(rows), values.size):
        raise DamagedError(
            f"sparse variable '{name}' claims {n_items} items and has {min(len(rows), values.size)}"
        )
    columns = np.repeat(np.arange(shape[1]), counts)
    return _fill_matrix(rows[:n_items], columns, values.ravel()[:n_items], shape, name, allowance)


def _fill_matrix(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: NDArray[np.generic],
    shape: tuple[int, int],
    name: str,
    allowance: Allowance,
) -> Floats:
    if min(shape) < 0:
        raise DamagedError(f"sparse variable '{name}' claims to be {shape[0]} x {shape[1]}")
    allowance.take(_NUMBER * shape[0] * shape[1], f"sparse variable '{name}', of {shape[0]} x {shape[1]},")
    inside = (rows >= 0) & (rows < shape[0]) & (columns >= 0) & (columns < shape[1])
    if not inside.all():
        raise DamagedError(f"sparse variable '{name}' has an item outside its {shape[0]} x {shape[1]}")
    matrix = np.zeros(shape)
    np.add.at(matrix, (rows, columns), values.astype(np.float64))
    return matrix
