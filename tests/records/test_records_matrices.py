"""Matrices of .mat files: full and sparse, in both versions; damaged files are refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal
from scipy.io import savemat
from scipy.sparse import csc_matrix

from mrwork.files.matlab import read_matlab_matrices as read

FULL = np.array([[4.0, -1.0, 0.0], [0.5, 3.0, 0.0]])


@pytest.mark.parametrize(("version", "compressed"), [("4", False), ("5", False), ("5", True)])
def test_full_and_sparse_matrices_come_back_as_they_were(
    tmp_path: Path, version: str, compressed: bool
) -> None:
    path = tmp_path / "frame.mat"
    stored = {"K": FULL, "S": csc_matrix(FULL), "row": np.array([[1, 2, 3]], dtype=np.uint8)}
    # A sparse matrix without columns is none.
    savemat(path, stored | {"none": csc_matrix((0, 0))}, format=version, do_compression=compressed)
    matrices = read(path)
    assert set(matrices) == set(stored)
    np.testing.assert_array_equal(matrices["K"], FULL)
    np.testing.assert_array_equal(matrices["S"], FULL)
    np.testing.assert_array_equal(matrices["row"], [[1.0, 2.0, 3.0]])


def test_matrices_in_a_struct_are_found(tmp_path: Path) -> None:
    path = tmp_path / "frame.mat"
    savemat(path, {"building": {"K": FULL, "S": csc_matrix(FULL)}})
    np.testing.assert_array_equal(read(path)["S"], FULL)


@pytest.mark.parametrize("length", [160, 200])
def test_a_cut_file_is_refused(tmp_path: Path, length: int) -> None:
    path = tmp_path / "frame.mat"
    savemat(path, {"S": csc_matrix(FULL)})
    path.write_bytes(path.read_bytes()[:length])
    refusal(read, path, match="cut off or damaged")


def test_a_sparse_item_outside_its_matrix_is_refused(tmp_path: Path) -> None:
    triplets = np.array([[5.0, 1.0, 2.0], [2.0, 2.0, 0.0]])
    path = tmp_path / "frame.mat"
    path.write_bytes(struct.pack("<5i", 2, 2, 3, 0, 2) + b"S\0" + triplets.ravel(order="F").tobytes())
    refusal(read, path, match="outside its 2 x 2")
