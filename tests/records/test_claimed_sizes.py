"""What a small file claims to hold is counted before it is allocated."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from record_files import clean_columns
from scipy.io import savemat
from scipy.sparse import csc_matrix
from sentences import Refused

from mrwork.errors import RecordError
from mrwork.files.matlab import open_matlab, read_matlab_matrices
from mrwork.files.open_table import open_table
from mrwork.records import read_damper_test

HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
MATRIX, SPARSE, DOUBLE, STRUCT = 14, 5, 6, 2


def element(kind: int, content: bytes) -> bytes:
    return struct.pack("<2I", kind, len(content)) + content + bytes(-len(content) % 8)


def integers(*values: int) -> bytes:
    return element(5, np.array(values, "<i4").tobytes())


def matrix(kind: int, shape: tuple[int, ...], name: str, *parts: bytes) -> bytes:
    facts = (element(6, struct.pack("<2I", kind, 0)), integers(*shape), element(1, name.encode()))
    return element(MATRIX, b"".join((*facts, *parts)))


def packed(block: bytes) -> bytes:
    content = zlib.compress(block, 9)
    return struct.pack("<2I", 15, len(content)) + content


def zeros(name: str, count: int) -> bytes:
    return packed(matrix(DOUBLE, (count, 1), name, element(9, bytes(8 * count))))


def empty_sparse(name: str, side: int) -> bytes:
    starts = integers(*np.zeros(side + 1, dtype=np.int32))
    return packed(matrix(SPARSE, (side, side), name, integers(0), starts, element(9, bytes(8))))


def peak_of(read: Callable[[], object]) -> int:
    """Largest number of bytes that a call allocates; it must be refused in a sentence."""
    tracemalloc.start()
    try:
        with pytest.raises(RecordError) as caught:
            read()
        assert "\n" not in str(caught.value)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_variables_that_unpack_to_a_thousand_times_the_file_are_refused_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    # Each of them would do.
    one = zeros("t_s", 3_000_000)
    path.write_bytes(HEAD + 8 * one)
    assert path.stat().st_size < 1_000_000
    assert peak_of(lambda: read_damper_test(path)) < 200e6


def test_sparse_matrices_are_counted_as_the_dense_ones_that_they_become(tmp_path: Path) -> None:
    path = tmp_path / "frame.mat"
    path.write_bytes(HEAD + b"".join(empty_sparse(f"S{number}", 4096) for number in range(4)))
    assert peak_of(lambda: read_matlab_matrices(path)) < 500e6
    path.write_bytes(HEAD + b"".join(empty_sparse(name, 2048) for name in "MCK"))
    assert set(read_matlab_matrices(path)) == set("MCK")


NONE = element(9, b"")
ONE = element(9, bytes(8))
HUGE = 2**31 - 1
FIELD = (integers(8), element(1, b"f" + bytes(7)), matrix(DOUBLE, 100 * (1,), "", ONE))
STRUCT_OF_100 = matrix(STRUCT, (1, 1), "a", *FIELD)


@pytest.mark.parametrize(
    "content",
    [
        matrix(DOUBLE, (HUGE, 1), "a", ONE),
        matrix(DOUBLE, (HUGE, HUGE, HUGE, 0), "a", NONE),
        matrix(DOUBLE, (HUGE, HUGE, HUGE, 4), "a", NONE),
        matrix(DOUBLE, (-1, 1), "a", ONE),
        matrix(DOUBLE, 100 * (1,), "a", ONE),
        matrix(DOUBLE, (8, *99 * (1,)), "a", element(9, bytes(64))),
        matrix(SPARSE, (3, -1), "a", integers(), integers(), NONE),
        matrix(SPARSE, (3, 0), "a", integers(), integers(), NONE),
        STRUCT_OF_100,
    ],
    ids=[
        *("a long vector", "no items", "items missing", "negative", "100 of one", "100 dimensions"),
        *("sparse, negative", "sparse, no columns", "in a struct"),
    ],
)
@pytest.mark.parametrize("read", [open_matlab, read_matlab_matrices])
def test_sides_that_no_array_has_are_refused_in_a_sentence(
    tmp_path: Path, content: bytes, read: Callable[[Path], object], refused: Refused
) -> None:
    path = tmp_path / "rig.mat"
    path.write_bytes(HEAD + content)
    refused(read, path)


@pytest.mark.parametrize("side", [0, -1, HUGE])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 31, 32, 33, 64, 65])
@pytest.mark.parametrize("kind", [DOUBLE, SPARSE, STRUCT])
def test_no_shape_of_an_empty_matrix_ends_in_anything_but_an_error_in_words(
    tmp_path: Path, side: int, count: int, kind: int
) -> None:
    path = tmp_path / "rig.mat"
    for shape in ((side,) * count, (*(side,) * count, 0), (0, *(side,) * count)):
        path.write_bytes(
            HEAD + matrix(kind, shape, "a", *((integers(), integers(0)) if kind == SPARSE else ()), NONE)
        )
        for read in (open_matlab, read_matlab_matrices):
            with suppress(RecordError):
                read(path)


def test_an_empty_sparse_matrix_is_no_matrix(tmp_path: Path, refused: Refused) -> None:
    for version in ("4", "5"):
        path = tmp_path / "frame.mat"
        savemat(path, {"S": csc_matrix((0, 0)), "K": np.eye(2)}, format=version)
        assert list(read_matlab_matrices(path)) == ["K"]
        savemat(
            path, {name: csc_matrix((0, 0)) for name in ("t_s", "displacement_m", "force_n")}, format=version
        )
        refused(read_damper_test, path)


@pytest.mark.parametrize("starts", [(0, 2**31 - 1, -2, 0), (0, -1, 2**31 - 1, 1), (0, 2, 1, 1)])
def test_indices_of_sparse_columns_do_not_wrap(tmp_path: Path, starts: tuple[int, ...]) -> None:
    path = tmp_path / "frame.mat"
    path.write_bytes(HEAD + matrix(SPARSE, (3, 3), "S", integers(0), integers(*starts), element(9, bytes(8))))
    assert peak_of(lambda: read_matlab_matrices(path)) < 1e6


@pytest.mark.parametrize("last", [(2.0**17, 2.0**17), (np.nan, 1e300), (-np.inf, 2.0)])
def test_the_size_that_a_sparse_matrix_of_version_4_claims_is_not_allocated(
    tmp_path: Path, last: tuple[float, float]
) -> None:
    path = tmp_path / "frame.mat"
    triplets = np.array([[1.0, 1.0, 2.0], [*last, 0.0]])
    path.write_bytes(struct.pack("<5i", 2, 2, 3, 0, 2) + b"S\0" + triplets.ravel(order="F").tobytes())
    assert peak_of(lambda: read_matlab_matrices(path)) < 1e6


def test_structs_within_structs_are_not_entered(tmp_path: Path, refused: Refused) -> None:
    content = matrix(DOUBLE, (1, 1), "", element(9, bytes(8)))
    for _ in range(2000):
        content = matrix(STRUCT, (1, 1), "", integers(8), element(1, b"a".ljust(8, b"\0")), content)
    path = tmp_path / "rig.mat"
    path.write_bytes(HEAD + content)
    refused(read_damper_test, path)


def test_rows_of_a_parquet_file_are_counted_before_they_are_read(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = ["t_s", "displacement_m", "force_n"]
    rows = pyarrow.table({name: np.zeros(1_000_000) for name in names})
    path = tmp_path / "rig.parquet"
    with parquet.ParquetWriter(path, rows.schema, compression="zstd") as writer:
        for _ in range(10):
            writer.write_table(rows)
    assert path.stat().st_size < 1_000_000
    before = pyarrow.total_allocated_bytes()
    assert peak_of(lambda: read_damper_test(path)) < 10e6
    assert pyarrow.default_memory_pool().max_memory() - before < 200e6


def test_texts_of_a_parquet_file_are_not_read(tmp_path: Path, refused: Refused) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    columns = clean_columns()
    words = pyarrow.DictionaryArray.from_arrays(
        pyarrow.array(np.zeros(columns["t_s"].size, dtype=np.int32)), pyarrow.array(["x" * 1_000_000])
    )
    path = tmp_path / "rig.parquet"
    # Without the schema of Arrow the words would be read one by one, 400 MB.
    parquet.write_table(pyarrow.table({**columns, "note": words}), path, store_schema=False)
    assert read_damper_test(path).n_time == columns["t_s"].size
    refused(read_damper_test, path, columns={"force": "note:N"})


@pytest.mark.parametrize("suffix", [".mat", ".parquet"])
def test_columns_that_do_not_change_are_read_however_far_they_shrink(tmp_path: Path, suffix: str) -> None:
    time = 1e-3 * np.arange(1_000_000)
    columns = {
        "t_s": time,
        "displacement_m": np.round(0.01 * np.sin(2.0 * np.pi * time), 3),
        "velocity_mps": np.zeros(time.size),
        "force_n": 300.0 * np.sign(np.cos(2.0 * np.pi * time)),
    }
    path = tmp_path / f"rig{suffix}"
    if suffix == ".mat":
        parts = (
            packed(matrix(DOUBLE, (column.size, 1), name, element(9, column.tobytes())))
            for name, column in columns.items()
        )
        path.write_bytes(HEAD + b"".join(parts))
    else:
        pyarrow = pytest.importorskip("pyarrow")
        pytest.importorskip("pyarrow.parquet").write_table(pyarrow.table(columns), path, compression="zstd")
    assert path.stat().st_size < 32e6 / 4
    for name, column in open_table(path, lambda _: True).read(list(columns)).items():
        np.testing.assert_array_equal(column, columns[name])
