"""What a small file claims to hold is counted before it is allocated."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

from mrwork.files.matlab import read_matlab_matrices
from mrwork.files.open_table import open_table
from mrwork.records import read_damper_test

pytestmark = pytest.mark.machine

HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
SPARSE, DOUBLE = 5, 6
HUGE = 2**31 - 1


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<2I", kind, len(content)) + content + bytes(-len(content) % 8)


def integers(*values: int) -> bytes:
    return element(5, np.array(values, "<i4").tobytes())


def matrix(kind: int, shape: tuple[int, ...], name: str, *parts: bytes) -> bytes:
    facts = (element(6, struct.pack("<2I", kind, 0)), integers(*shape), element(1, name.encode()))
    return element(14, b"".join((*facts, *parts)))


def packed(name: str, column: np.ndarray) -> bytes:
    block = matrix(DOUBLE, (column.size, 1), name, element(9, column.tobytes()))
    content = zlib.compress(block, 9)
    return struct.pack("<2I", 15, len(content)) + content


def peak_of(read: Callable[[Path], object], path: Path) -> int:
    """Largest number of bytes that a reader allocates before it refuses a file."""
    tracemalloc.start()
    try:
        refusal(read, path, match=path.name)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "content",
    [
        matrix(DOUBLE, (HUGE, 1), "a", element(9, bytes(8))),
        matrix(DOUBLE, (HUGE, HUGE, HUGE, 0), "a", element(9, b"")),
        matrix(DOUBLE, (-1, 1), "a", element(9, bytes(8))),
        matrix(DOUBLE, 100 * (1,), "a", element(9, bytes(8))),
        matrix(SPARSE, (3, 0), "a", integers(), integers(), element(9, b"")),
        matrix(SPARSE, (3, 3), "S", integers(0), integers(0, HUGE, -2, 0), element(9, bytes(8))),
    ],
    ids=["long", "no items", "negative", "100 dimensions", "no columns", "indices that wrap"],
)
def test_sides_that_no_array_has_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "frame.mat"
    path.write_bytes(HEAD + content)
    assert peak_of(read_matlab_matrices, path) < 1e6


def test_rows_of_a_parquet_file_are_counted_before_they_are_read(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = pyarrow.table({name: np.zeros(1_000_000) for name in ("t_s", "displacement_m", "force_n")})
    path = tmp_path / "rig.parquet"
    with parquet.ParquetWriter(path, rows.schema, compression="zstd") as writer:
        for _ in range(10):
            writer.write_table(rows)
    assert path.stat().st_size < 1_000_000
    assert peak_of(read_damper_test, path) < 10e6


def test_columns_that_do_not_change_are_read_however_far_they_shrink(tmp_path: Path) -> None:
    time = 1e-3 * np.arange(200_000)
    columns = {"t_s": time, "force_n": 300.0 * np.sign(np.cos(2.0 * np.pi * time))}
    path = tmp_path / "rig.mat"
    path.write_bytes(HEAD + b"".join(packed(name, column) for name, column in columns.items()))
    assert path.stat().st_size < 2 * time.nbytes / 4
    for name, column in open_table(path, lambda _: True).read(list(columns)).items():
        np.testing.assert_array_equal(column, columns[name])
