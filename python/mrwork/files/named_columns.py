"""Named numeric columns of a file, the reader of Parquet files, lists of files, and the grid of rounded times."""

from __future__ import annotations

import glob
import hashlib
import importlib.util
import os
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.store.child_reader import TooLargeError, UnreadableError, read_members
from mrwork.store.input_file import RECORD, bytes_of, exists
from mrwork.summary import listed


class ColumnTable(ABC):
    """Columns of a file: their names, their values on request, and the location of a row in the file.

    `names` are in file order, `units` those that the file states apart from the names, `sha256` is the hash of the
    bytes of the file. `stamps` are columns of times of the day, which are read as seconds since the first. `unused` are
    parts of the file that are no column: sheets, variables without a vector of numbers; `further` are those that have a
    record of their own.
    """

    names: tuple[str, ...]
    units: Mapping[str, str]
    sha256: str
    stamps: frozenset[str] = frozenset()
    unused: tuple[str, ...] = ()
    further: tuple[str, ...] = ()

    @abstractmethod
    def read(self, wanted: Sequence[str]) -> dict[str, NDArray[np.float64]]:
        """Columns by name, each of shape (n_time,); an empty cell is NaN.

        A constant may have shape (1,) if the format stores scalars.
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
        unused: tuple[str, ...] = (),
    ) -> None:
        self.names = tuple(vectors)
        self.units = units or {}
        self.unused = unused
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
        # What is beyond the range of doubles is infinite, and refused with its row.
        with np.errstate(over="ignore", invalid="ignore"):
            return vector.astype(np.float64, copy=False)


def unused_parts(noun: str, names: Sequence[str], why: str) -> tuple[str, ...]:
    """Parts of a file that are no columns, and why, as `ColumnTable.unused` has them; nothing where there are none."""
    return (f"{noun}{'s' if len(names) > 1 else ''} {listed(names)} ({why})",) if names else ()


def open_parquet(path: Path) -> ColumnTable:
    """Open a .parquet file."""
    if importlib.util.find_spec("pyarrow") is None:
        raise RecordError(f"{path}: reading Parquet needs pyarrow; run: pip install 'mrwork[parquet]'")
    data = bytes_of(path, RECORD)
    try:
        columns = read_members(data, "parquet")
    except TooLargeError as error:
        raise RecordError(f"{path}: {error}; save one test, without other data") from None
    except UnreadableError as error:
        raise RecordError(f"{path}: not a readable Parquet file ({error}); write it again") from None
    # A column of other contents is refused when it is asked for.
    vectors = {
        name: np.empty(1, dtype=np.object_) if column.array is None else column.array
        for name, column in columns.items()
    }
    return VectorTable(source=str(path), sha256=hashlib.sha256(data).hexdigest(), vectors=vectors)


def listed_files(paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, none: str) -> list[str]:
    """Return the files of a sequence of paths in its order, or of a glob pattern in name order."""
    if isinstance(paths, str | os.PathLike):
        pattern = os.fspath(paths)
        _refuse_nameless(pattern)
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
        _refuse_nameless(file)
    return files


def _refuse_nameless(file: str) -> None:
    # An empty name would be the current folder.
    if not file or "\0" in file:
        raise RecordError(f"{file!r} is no path of a file; check the name")


def rounded_grid(time: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The uniform grid of which these times are rounded values, shape (n_time,); `None` if they are not.

    The grid is the regression of the time on the number of the sample, which rounding does not bias, unlike the
    median step. Each time may differ from it by half of the last digit with which it is written, more is jitter: one
    column may have times of different numbers of decimals, as a format with a fixed number of significant digits
    prints them. A digit above half a step could equally be a missing sample.
    """
    index = np.arange(time.size) - 0.5 * (time.size - 1)
    slope = float(index @ time) / float(index @ index)
    grid = np.asarray(np.mean(time) + slope * index, dtype=np.float64)
    digit = last_digit(time)
    typical = float(np.median(digit))
    if typical > 0.5 * slope:
        return None
    # The regression of a short record is itself uncertain by a fifth of the typical digit.
    allowed = np.minimum(0.5 * digit + 0.25 * typical, 0.5 * slope)
    return grid if np.all(np.abs(time - grid) <= allowed) else None


def last_digit(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power of ten of the last decimal with which each value can be written, shape of `values`, 1 to 1e-12."""
    digit = np.full(values.shape, 1e-12)
    for power in range(12, -1, -1):
        scaled = values * 10.0**power
        # Values that were converted from another unit are a few roundings away from their decimals.
        written = np.abs(scaled - np.round(scaled)) <= 1e-9 + 8.0 * np.spacing(np.abs(scaled))
        digit = np.where(written, 10.0**-power, digit)
    return digit
