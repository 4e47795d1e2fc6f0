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

# Bytes of a file; a thousand channels of an hour at 1 kHz are more.
_LARGEST_FILE: Final = 1 << 30


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
        return vector.astype(np.float64)


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
    check_size(path)
    data = path.read_bytes()
    try:
        table = pyarrow.parquet.ParquetFile(pyarrow.BufferReader(data)).read()
        vectors = {name: table.column(name).to_numpy() for name in table.column_names}
    except (pyarrow.ArrowException, OSError, KeyError, ValueError) as error:
        first_line = str(error).partition("\n")[0]
        raise RecordError(f"{path}: not a readable Parquet file ({first_line}); write it again") from error
    return VectorTable(source=str(path), sha256=hashlib.sha256(data).hexdigest(), vectors=vectors)


def check_size(path: Path) -> None:
    """Refuse a file that is too large for the memory of most machines.

    Raises
    ------
    RecordError
        The file is larger than any test of a damper.
    """
    size = path.stat().st_size
    if size > _LARGEST_FILE:
        raise RecordError(
            f"{path}: has {size / 1e9:.1f} GB where a test has {_LARGEST_FILE / 1e9:.1f} GB at most; "
            "export one test, at a lower rate or with fewer channels"
        )


def check_is_file(path: Path) -> None:
    """Check that a path is an ordinary file.

    Raises
    ------
    RecordError
        The path is missing, a directory or a device.
    """
    if path.is_dir():
        raise RecordError(f"{path}: is a directory; name the record files in it, such as {path}/*.csv")
    if not path.exists():
        raise RecordError(f"{path}: there is no such file; check the path")
    if not path.is_file():
        raise RecordError(f"{path}: is not an ordinary file; name a record file")


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
        files = [pattern] if Path(pattern).exists() else sorted(found)
        if not files:
            raise RecordError(f"no file matches '{pattern}'; check the path and the pattern")
        return files
    files = [os.fspath(path) for path in paths]
    if not files:
        raise RecordError(none)
    return files
