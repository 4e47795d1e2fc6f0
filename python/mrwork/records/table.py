"""Named numeric columns of a file of any format, the reader of Parquet files, and lists of files."""

from __future__ import annotations

import glob
import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records.allowance import Allowance
from mrwork.store.input_file import RECORD, bytes_of, exists

# Bytes of a number of a column that is read.
_ITEM: Final = 8


class ColumnTable(ABC):
    """Columns of a file: their names, their values on request, and the location of a row in the file.

    `names` are in file order, `units` those that the file states apart from the names, `sha256` is the hash of the
    bytes of the file.
    """

    names: tuple[str, ...]
    units: Mapping[str, str]
    sha256: str

    @abstractmethod
    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """Columns by name, each of shape (n_time,); an empty cell is NaN.

        A constant may have shape (1,) if the format stores scalars.

        Raises
        ------
        RecordError
            A cell of a requested column is not a number, or the columns differ in length.
        """

    @abstractmethod
    def locate(self, row: int) -> str:
        """Location of row `row` of the columns (from 0) in the file, for messages."""


class VectorTable(ColumnTable):
    """Columns that the format stores as arrays (Parquet, MATLAB, TDMS)."""

    def __init__(
        self,
        *,
        source: str,
        sha256: str,
        vectors: Mapping[str, NDArray[np.generic]],
        units: Mapping[str, str] | None = None,
    ) -> None:
        self.names = tuple(vectors)
        self.units = units or {}
        self.sha256 = sha256
        self._source = source
        self._vectors = vectors

    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """Convert the requested vectors, each of shape (n_time,) or (1,)."""
        lengths = {name: self._vectors[name].size for name in wanted if self._vectors[name].size != 1}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"'{name}' has {size}" for name, size in lengths.items())
            raise RecordError(
                f"{self._source}: columns must be equally long, but {listed}; save them from one test"
            )
        return {name: self._numbers(name) for name in wanted}

    def locate(self, row: int) -> str:
        """Row number from 1."""
        return f"row {row + 1}"

    def _numbers(self, name: str) -> NDArray[np.float64]:
        vector = self._vectors[name]
        if not (np.issubdtype(vector.dtype, np.integer) or np.issubdtype(vector.dtype, np.floating)):
            raise RecordError(
                f"{self._source}: column '{name}' holds {vector.dtype} values where real numbers were "
                "expected; convert it before saving"
            )
        return vector.astype(np.float64, copy=False)


def open_parquet(path: Path) -> ColumnTable:
    """Open a .parquet file with pyarrow.

    Raises
    ------
    RecordError
        pyarrow is not installed, or the file is damaged.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise RecordError(
            f"{path}: reading Parquet needs pyarrow; run: pip install 'mrwork[parquet]'"
        ) from error
    data = bytes_of(path, RECORD)
    try:
        file = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(data))
        numeric = [
            field.name
            for field in file.schema_arrow
            if pyarrow.types.is_integer(field.type) or pyarrow.types.is_floating(field.type)
        ]
        # Repeated numbers take no space in the file; a page cannot unpack to more than it claims.
        claimed = file.metadata.num_rows * len(numeric) * _ITEM
        groups = [file.metadata.row_group(number) for number in range(file.metadata.num_row_groups)]
        packed = sum(
            group.column(number).total_uncompressed_size
            for group in groups
            for number in range(group.num_columns)
            if group.column(number).path_in_schema in numeric
        )
        Allowance(path, len(data)).take(max(claimed, packed), "a table of numbers")
        table = file.read(columns=numeric)
        # A column of other contents is refused when it is asked for.
        vectors = {
            field.name: table.column(field.name).to_numpy()
            if field.name in numeric
            else np.empty(file.metadata.num_rows and 1, dtype=np.object_)
            for field in file.schema_arrow
        }
    except RecordError:
        raise
    except (pyarrow.ArrowException, OSError, KeyError, ValueError) as error:
        first_line = str(error).partition("\n")[0]
        raise RecordError(f"{path}: not a readable Parquet file ({first_line}); write it again") from error
    return VectorTable(source=str(path), sha256=hashlib.sha256(data).hexdigest(), vectors=vectors)


def listed_files(paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, none: str) -> list[str]:
    """Return the files of a sequence of paths in its order, or of a glob pattern in name order.

    Raises
    ------
    RecordError
        No file matches the pattern, or there is no path; `none` is the message of the latter.
    """
    if isinstance(paths, str | os.PathLike):
        pattern = os.fspath(paths)
        # An existing file whose name contains brackets is not a pattern.
        found = glob.glob(pattern, recursive=True)  # noqa: PTH207 - `Path.glob` takes no absolute patterns
        files = [pattern] if exists(pattern) else sorted(found)
        if not files:
            raise RecordError(f"no file matches '{pattern}'; check the path and the pattern")
        return files
    files = [os.fspath(path) for path in paths]
    if not files:
        raise RecordError(none)
    for file in files:
        if "\0" in file:
            raise RecordError(f"{file!r} is no path of a file; check the name")
    return files
