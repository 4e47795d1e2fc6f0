"""Matrices of a file: a text with a row in each line, an array of NumPy, or a MATLAB file."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.files.matlab import read_matlab_matrices
from mrwork.store.input_file import MATRIX, is_folder, read_array, text_of

_SEPARATOR: Final = re.compile(r"\s*[,;\t]\s*|\s+")
_SUFFIXES: Final = (".csv", ".tsv", ".txt")
# Of a text with a matrix; the largest is of a linear system with 6000 states.
_MOST_NUMBERS: Final = 50_000_000
_MOST_LINES: Final = 1_000_000
_LONGEST_LINE: Final = 1 << 20


def read_matrix(path: Path) -> Floats:
    """Read a matrix from a file, shape (n_rows, n_columns): text with one row per line, .npy, or .mat with one matrix.

    Numbers of a text are separated by commas, semicolons, tabs or spaces; text after a # is a comment.
    """
    suffix = path.suffix.lower()
    if suffix == ".mat":
        return _only_matrix(path)
    if suffix == ".npy":
        return _matrix_of_array(path)
    if suffix not in _SUFFIXES:
        raise RecordError(
            f"{path}: a matrix is read from a {', '.join(_SUFFIXES)}, .npy or .mat file; save it as one of these"
        )
    text = text_of(path, MATRIX).replace("\r\n", "\n").replace("\r", "\n")
    # In a file of ends of lines alone each line would take more than its byte.
    n_lines = text.count("\n") + 1
    if n_lines > _MOST_LINES:
        raise RecordError(
            f"{path}: has {n_lines:,} lines where a matrix has {_MOST_LINES:,} at most; {MATRIX.remedy}"
        )
    rows: list[Floats] = []
    n_numbers = 0
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > _LONGEST_LINE:
            raise RecordError(
                f"{path}: line {number} is longer than {_LONGEST_LINE >> 20} MiB, which no row of a matrix is; "
                f"{MATRIX.remedy}"
            )
        content = line.partition("#")[0].strip()
        if not content:
            continue
        fields = _SEPARATOR.split(content)
        # Some exports end each line with a separator.
        row = [
            _number(field, f"{path}: line {number}") for field in (fields[:-1] if not fields[-1] else fields)
        ]
        if rows and len(row) != len(rows[0]):
            raise RecordError(
                f"{path}: line {number} has {len(row)} numbers where the first row has {len(rows[0])}; complete it"
            )
        rows.append(np.array(row))
        n_numbers += len(row)
        if n_numbers > _MOST_NUMBERS:
            raise RecordError(
                f"{path}: has more than {_MOST_NUMBERS:,} numbers, no matrix here has; name another file"
            )
    if not rows:
        raise RecordError(f"{path}: the file holds no numbers; a matrix was expected, a row in each line")
    return np.array(rows)


def _only_matrix(path: Path) -> Floats:
    matrices = read_matlab_matrices(path)
    if len(matrices) != 1:
        listed = ", ".join(matrices) or "none"
        raise RecordError(
            f"{path}: one matrix was expected, and the file has {listed}; save the matrix alone"
        )
    return next(iter(matrices.values()))


def _matrix_of_array(path: Path) -> Floats:
    array = read_array(path, MATRIX)
    if array.ndim not in (1, 2) or not array.size or array.dtype.kind not in "fiu":
        raise RecordError(
            f"{path}: a matrix of real numbers was expected, and the array has shape {array.shape} and numbers of the "
            f"kind {array.dtype.name}; save a matrix"
        )
    return np.atleast_2d(array.astype(np.float64))


def read_matrices(path: Path, names: Collection[str]) -> dict[str, Floats]:
    """Read matrices by name from a .mat file, or from a folder with one text file per matrix in `names`."""
    if is_folder(path):
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES)
        return {file.stem: read_matrix(file) for file in files if file.stem in names}
    return read_matlab_matrices(path)


def _number(field: str, where: str) -> float:
    try:
        return float(field)
    except ValueError:
        shown = field if len(field) <= 40 else field[:40] + "..."
        raise RecordError(
            f"{where} holds '{shown}' where a number was expected; a matrix has no header"
        ) from None
