"""Matrices of .mat files: full and sparse, in both versions; damaged files are refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix
from sentences import Refused

from mrwork.errors import RecordError
from mrwork.files.matlab import read_matlab_matrices as read

FULL = np.array([[4.0, -1.0, 0.0], [0.5, 3.0, 0.0]])


@pytest.mark.parametrize("version", ["4", "5"])
@pytest.mark.parametrize("compressed", [False, True])
def test_full_and_sparse_matrices_come_back_as_they_were(
    tmp_path: Path, version: str, compressed: bool
) -> None:
    path = tmp_path / "frame.mat"
    stored = {"K": FULL, "S": csc_matrix(FULL), "row": np.array([[1, 2, 3]], dtype=np.uint8)}
    savemat(path, stored, format=version, do_compression=compressed and version == "5")
    matrices = read(path)
    np.testing.assert_array_equal(matrices["K"], FULL)
    np.testing.assert_array_equal(matrices["S"], FULL)
    np.testing.assert_array_equal(matrices["row"], [[1.0, 2.0, 3.0]])


def test_matrices_in_a_struct_are_found(tmp_path: Path) -> None:
    path = tmp_path / "frame.mat"
    savemat(path, {"building": {"K": FULL, "S": csc_matrix(FULL)}})
    np.testing.assert_array_equal(read(path)["S"], FULL)


def test_every_cut_of_a_file_with_sparse_matrices_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "frame.mat"
    savemat(path, {"S": csc_matrix(FULL), "K": FULL})
    whole = path.read_bytes()
    sentences = []
    for length in range(128, len(whole) - 8, 8):
        path.write_bytes(whole[:length])
        try:
            matrices = read(path)
        except RecordError as error:
            sentences.append(str(error))
        else:
            # A file cut between two variables still has the first.
            assert all(np.array_equal(matrix, FULL) for matrix in matrices.values())
    assert len(sentences) > 20
    assert all(str(path) in sentence and "\n" not in sentence for sentence in sentences)


def test_a_sparse_item_outside_its_matrix_is_refused(tmp_path: Path, refused: Refused) -> None:
    triplets = np.array([[5.0, 1.0, 2.0], [2.0, 2.0, 0.0]])
    header = struct.pack("<5i", 2, 2, 3, 0, 2) + b"S\0"
    path = tmp_path / "frame.mat"
    path.write_bytes(header + triplets.ravel(order="F").tobytes())
    refused(read, path)
