"""Matrices from files: one per text file, or several by name in a .mat file."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records.formats.matlab import read_matlab_matrices
from mrwork.store.input_file import MATRIX, is_folder, text_of

Floats = NDArray[np.float64]

_SEPARATOR: Final = re.compile(r"\s*[,;\t]\s*|\s+")
_SUFFIXES: Final = (".csv", ".tsv", ".txt")


def read_matrix(path: Path) -> Floats:
    """Read a matrix from a text file with one row per line, shape (n_rows, n_columns).

    Numbers are separated by commas, semicolons, tabs or spaces; text after a # is a comment.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise RecordError(
            f"{path}: a matrix is read from a {', '.join(_SUFFIXES)} file; save it as one of these"
        )
    text = text_of(path, MATRIX)
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
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
        rows.append(row)
    if not rows:
        raise RecordError(f"{path}: the file holds no numbers; a matrix was expected, a row in each line")
    return np.array(rows)


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
