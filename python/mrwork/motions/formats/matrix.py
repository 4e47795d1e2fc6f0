"""Ground motions in MATLAB .mat files: vectors with names, or one matrix of times and accelerations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.motions.formats.format import Stated
from mrwork.motions.formats.table import motion_of_table
from mrwork.motions.ground_motion import GroundMotion
from mrwork.records.formats.matlab import open_matlab, read_matlab_matrices
from mrwork.records.table import VectorTable


def read_matrix_motion(path: Path, stated: Stated) -> GroundMotion:
    """Read a .mat file of version 4 to 7.

    A matrix of two rows or two columns holds times [s] and accelerations, as the files of the structural control
    benchmarks do; vectors are known by their names as columns of a table are.

    Raises
    ------
    RecordError, UnitError, SettingError
        The file is damaged, or does not hold one ground motion.
    """
    matrices = read_matlab_matrices(path, str(path))
    pairs = {name: pair for name, matrix in matrices.items() for pair in _pair(matrix)}
    if stated.column is None and len(pairs) > 1:
        listed = ", ".join(f"'{name}'" for name in pairs)
        raise RecordError(f"{path}: variables {listed} may all be a ground motion; name one with `column`")
    name = next(iter(pairs), None) if stated.column is None else stated.column
    if name not in pairs:
        return motion_of_table(open_matlab(path, str(path)), stated, path)
    time, acceleration = pairs[name]
    table = VectorTable(source=str(path), sha256="", vectors={"t_s": time, name: acceleration})
    return motion_of_table(table, replace(stated, column=name), path)


def _pair(matrix: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Rows of times and accelerations, shape (2, n_time), if the matrix holds them."""
    if matrix.ndim != 2 or 2 not in matrix.shape or matrix.size < 6:
        return []
    return [matrix if matrix.shape[0] == 2 else matrix.T]
