"""Numeric vectors and matrices of MATLAB .mat files, versions 4 to 7; files of version 7.3 are HDF5.

SciPy reads these files too, but a damaged type tag ends the whole process in its reader (1.17), and it allocates the
size that a header claims before it checks whether the file can hold it. Here every size is counted first. What is no
real numbers, such as an object, is left out and named. A process for SciPy alone costs more than this reader
(DECISIONS.md, "The package has its own reader of .mat files").
"""

from __future__ import annotations

import hashlib
import math
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, VectorTable
from mrwork.store.input_file import LEAST, MATRIX, RECORD, Allowance, FileKind, bytes_of
from mrwork.store.members import members_of, readable

_DAMAGED: Final = "it is cut off or damaged, save it again"
# Variables that a sentence lists.
_MOST_NAMED: Final = 12
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
# An object of a class in the language of MATLAB, as `ss` or a string: it has no dimensions.
_OPAQUE: Final = 17
_NUMERIC_CLASSES: Final = range(6, 16)
_OTHER_CLASSES: Final[Mapping[int, str]] = {1: "a cell array", 3: "an object", 4: "text", 16: "a function"}
_V5_ITEMS: Final[Mapping[int, str]] = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_COMPLEX_FLAG: Final = 0x0800
_LOGICAL_FLAG: Final = 0x0200
_COMPLEX: Final = "complex numbers"
# Bytes of an entry of `Variables`, beside its numbers.
_ENTRY: Final = 300
# Names of classes in version 7.3, of which each type of integers has its own.
_OTHERS_73: Final = {"char": "text", "cell": "a cell array", "function_handle": "a function"}
_NUMBERS_73: Final = re.compile(r"double|single|logical|u?int\d+")
_NO_NUMBERS_73: Final = {"MATLAB_empty", "MATLAB_object_decode"}
# Levels of structs in structs of version 7.3.
_DEPTH_73: Final = 5

Variables = dict[str, "NDArray[np.generic] | str"]
"""Contents by name, those of fields of structs by path (`model.M`, `eq(2).ag`); for other than real numbers, words."""
Block = bytes | memoryview


def open_matlab(path: Path, column: str | None = None) -> ColumnTable:
    """Open a .mat file; the columns are its numeric vectors, or those in the fields of its structs, by path.

    Where `column` is in a struct, they are the vectors of this struct by their names in it. A matrix of rows as
    long as the vectors has columns, too, as `F 1` and `F 2` of `F`. Without vectors they are the columns of the only
    matrix, or its rows where these are longer, by their numbers.
    """
    data, variables = read_variables(path, RECORD, column)
    vectors = {
        name: array.ravel()
        for name, array in variables.items()
        if isinstance(array, np.ndarray) and array.size == max(array.shape, default=0)
    }
    inside = column.rpartition(".")[0] if column in vectors else ""
    columns = {name: vector for name, vector in vectors.items() if name.rpartition(".")[0] == inside}
    if max((vector.size for vector in columns.values()), default=0) < 2:
        columns = vectors
    length = max((vector.size for vector in columns.values()), default=0)
    matrices = {
        name: matrix if matrix.shape[0] < matrix.shape[1] else matrix.T
        for name, matrix in matrices_among(variables).items()
        if min(matrix.shape) > 1 and max(matrix.shape) >= _FEWEST_ROWS
    }
    # Rows of a matrix are columns of the file where they are as long as the vectors.
    arrays = {
        name: rows for name, rows in matrices.items() if name not in vectors and rows.shape[1] == length
    }
    if length < 2 and len(matrices) == 1:
        ((name, rows),) = matrices.items()
        variables.pop(name)
        columns, arrays = dict(zip(numbered_names(len(rows)), rows, strict=True)), {}
    of_arrays = {
        name: tuple(f"{name} {row + 1}" for row in range(len(rows))) for name, rows in arrays.items()
    }
    for name, names in of_arrays.items():
        columns |= dict(zip(names, arrays[name], strict=True))
    if not columns:
        raise RecordError(
            f"{path}: expected one numeric vector per quantity, found {describe_left_out(variables) or 'nothing'}; "
            "save the time and each quantity as a variable of its own"
        )
    left_out = describe_left_out(
        {name: of for name, of in variables.items() if name not in {*columns, *arrays}}
    )
    return VectorTable(
        source=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        vectors={name.removeprefix(f"{inside}."): vector for name, vector in columns.items()},
        unused=(f"variables {left_out}",) if left_out else (),
        arrays=of_arrays,
    )


def describe_left_out(variables: Variables) -> str:
    """What variables hold, in words; empty without any."""
    held = {
        name: of if isinstance(of, str) else " x ".join(map(str, of.shape)) for name, of in variables.items()
    }
    return list_names([f"'{name}' ({words})" for name, words in held.items()], _MOST_NAMED)


def matrices_among(variables: Variables) -> dict[str, Floats]:
    """The real matrices among variables."""
    return {
        name: array.astype(np.float64, copy=False)
        for name, array in variables.items()
        if isinstance(array, np.ndarray) and array.ndim == 2 and array.size
    }


def read_variables(path: Path, kind: FileKind = MATRIX, wanted: str | None = None) -> tuple[bytes, Variables]:
    """Bytes of a .mat file, and what it has by name; where one struct has all numbers, its fields.

    A path that is `wanted` stays whole. Sparse matrices become dense.
    """
    data = bytes_of(path, kind)
    if not data:
        raise RecordError(f"{path}: the file is empty; a .mat file was expected")
    if data.startswith(_HDF5) or data[512:516] == _HDF5:
        return data, _of_only_struct(_version_73(data, path), wanted)
    if min(data[:_V5_HEADER]) >= ord("\t"):
        raise RecordError(
            f"{path}: is a text, as Octave and `save -ascii` write; save it by `save -v7`, or name its numbers .txt"
        )
    size, least = (0, _FOR_MATRICES) if kind is MATRIX else (len(data), LEAST)
    allowance = Allowance(path, size, least=least)
    # A version 4 file starts with a small integer, a version 5 file with text.
    read = _version_4 if 0 in data[:4] else _version_5
    with readable(path, ".mat file", _DAMAGED):
        return data, _of_only_struct(read(memoryview(data), allowance), wanted)


def _of_only_struct(variables: Variables, wanted: str | None) -> Variables:
    """The variables, without the name of the struct that has all numbers, and of one that it has them in."""
    whole = {name.partition(".")[0] for name, of in variables.items() if not isinstance(of, str)}
    prefix = f"{whole.pop()}." if len(whole) == 1 else "."
    if wanted in variables or not any(name.startswith(prefix) for name in variables):
        return variables
    return _of_only_struct({name.removeprefix(prefix): of for name, of in variables.items()}, wanted)


def _version_73(data: bytes, path: Path) -> Variables:
    """Variables of a version 7.3 file; its structs and sparse matrices are groups."""
    members = members_of(data, path, name="version 7.3 .mat file", remedy=_DAMAGED, depth=_DEPTH_73)
    allowance = Allowance(path, 0, least=_FOR_MATRICES)
    variables: Variables = {}
    within = "/"
    for label, member in members.items():
        if not label or label.startswith(within):
            continue
        name, sparse_rows = label.replace("/", "."), member.attributes.get("MATLAB_sparse")
        kind = str(member.attributes.get("MATLAB_class", "struct" if member.is_group else "double"))
        is_number = _NUMBERS_73.fullmatch(kind) is not None
        if sparse_rows is not None:
            within = f"{label}/"
            # One of zeros alone has neither items nor rows.
            parts = (members.get(within + part) for part in ("data", "ir", "jc"))
            items, *places = (
                np.ravel([] if part is None or part.array is None else part.array) for part in parts
            )
            rows, starts = (numbers.astype(np.int64) for numbers in places)
            with readable(path, "version 7.3 .mat file", _DAMAGED):
                columns = np.repeat(np.arange(starts.size - 1), np.diff(starts))
                shape = int(sparse_rows), starts.size - 1
                variables[name] = _dense(items, rows, columns, shape, name, allowance)
        elif member.array is not None and is_number and not member.attributes.keys() & _NO_NUMBERS_73:
            # MATLAB stores columns one after the other.
            variables[name] = member.array.T
        elif not member.is_group or kind != "struct":
            within = f"{label}/"
            other = "no real numbers" if is_number else f"an object of class {kind}"
            variables[name] = _OTHERS_73.get(kind, other)
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
        variables[name] = _COMPLEX if is_complex else "text"
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
    for kind, block in reader.elements(data[_V5_HEADER:]):
        if kind == _COMPRESSED:
            kind, block = reader.unpack(block)
        if kind == _MATRIX:
            variables.update(reader.matrix(block))
    # One without a name is the table of what the objects hold.
    return {name: content for name, content in variables.items() if name}


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
        self, block: Block, path: str | None = None
    ) -> Iterator[tuple[str, NDArray[np.generic] | str]]:
        """Name and content of a matrix element, of a struct those of its fields; `path` is the name of a field."""
        self.allowance.take(_ENTRY, "a variable")
        if not block:
            yield path or "", "empty"
            return
        elements = self.elements(block)
        (flags,) = struct.unpack_from(f"{self.order}I", next(elements)[1])
        matrix_class, second = flags & 0xFF, next(elements)[1]
        if matrix_class == _OPAQUE:
            # Its name, the system of its class, and its class.
            next(elements)
            yield path or _text(second), f"an object of class {_text(next(elements)[1])}"
            return
        # No side is negative: for NumPy -1 is a side to be found.
        shape = tuple(np.frombuffer(second, dtype=f"{self.order}u4").tolist())
        own = _text(next(elements)[1])
        name = own if path is None else path
        if matrix_class == _STRUCT:
            yield from self._fields(elements, name, is_array=shape != (1, 1))
        elif flags & _COMPLEX_FLAG:
            yield name, _COMPLEX
        elif matrix_class == _SPARSE and len(shape) == 2:
            yield name, self._sparse(elements, shape, name, is_logical=bool(flags & _LOGICAL_FLAG))
        elif matrix_class in _NUMERIC_CLASSES:
            yield name, self._items(elements, shape)
        else:
            yield name, _OTHER_CLASSES.get(matrix_class, "no real numbers")

    def _items(self, elements: Iterator[tuple[int, Block]], shape: tuple[int, ...]) -> NDArray[np.generic]:
        """Items of the next element in the shape of the matrix."""
        kind, items = next(elements)
        return _array(items, self.order + _V5_ITEMS[kind], shape)

    def _sparse(
        self, elements: Iterator[tuple[int, Block]], shape: tuple[int, ...], name: str, *, is_logical: bool
    ) -> Floats:
        """Dense matrix from compressed columns: column j has the items `starts[j]` to `starts[j + 1]`, in `rows`."""
        rows, starts = self._integers(next(elements)[1]), self._integers(next(elements)[1])
        kind, block = next(elements)
        n_items = int(starts[-1] - starts[0])
        # MATLAB calls the bytes of a logical matrix doubles.
        is_bytes = is_logical and len(block) in (n_items, rows.size)
        items = _array(block, "u1" if is_bytes else self.order + _V5_ITEMS[kind], (-1,))
        columns = np.repeat(np.arange(starts.size - 1), np.diff(starts))
        return _dense(items[:n_items], rows[:n_items], columns, shape, name, self.allowance)

    def _fields(
        self, elements: Iterator[tuple[int, Block]], name: str, *, is_array: bool
    ) -> Iterator[tuple[str, NDArray[np.generic] | str]]:
        """Contents of the fields of a struct, or of each struct of an array of them, counted from 1."""
        (length,), names = self._integers(next(elements)[1]), next(elements)[1]
        fields = [_text(names[start : start + length]) for start in range(0, len(names), length)]
        for number, (_, block) in enumerate(elements):
            place = f"({1 + number // len(fields)})" if is_array else ""
            yield from self.matrix(block, f"{name}{place}.{fields[number % len(fields)]}")

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
