"""Matrices of a file: a text with a row in each line, an array of NumPy, or a MATLAB file."""

from __future__ import annotations

import io
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.keys import quote_value
from mrwork.base.values import Floats
from mrwork.errors import RecordError, reason_of
from mrwork.files.layout import reads_as_float
from mrwork.files.matlab import Variables, describe_left_out, matrices_among, read_variables
from mrwork.store.input_file import MATRIX, bytes_of, is_folder, text_of

_SUFFIXES: Final = (".csv", ".tsv", ".txt")
# A variable of a .mat file: frame.mat:M, frame.mat:model.M.
_VARIABLE: Final = re.compile(r"(.+\.mat):([^:/\\]+)", re.IGNORECASE)


def read_matrix(path: Path) -> Floats:
    """Read a matrix from a file, shape (n_rows, n_columns): text with one row per line, .npy, or .mat.

    Of several matrices in a .mat file one is named behind a colon, as in ``frame.mat:M``. Numbers of a text are
    separated by commas, by semicolons, or by tabs and spaces; text after a # is a comment.
    """
    named = _VARIABLE.fullmatch(str(path))
    path, name = (path, None) if named is None else (Path(named[1]), named[2])
    suffix = path.suffix.lower()
    if suffix == ".mat":
        _, variables = read_variables(path, wanted=name)
        matrices = matrices_among(variables)
        if name in matrices or (name is None and len(matrices) == 1):
            return matrices[name or next(iter(matrices))]
        wanted = "one matrix" if name is None else f"a matrix '{name}'"
        listed = describe_left_out(variables) or "nothing"
        example = f"{path.name}:{next(iter(matrices), 'K')}"
        raise RecordError(
            f'{path}: {wanted} was expected, and the file has {listed}; name one, as in "{example}"'
        )
    if suffix == ".npy":
        return _matrix_of_array(path)
    if suffix not in _SUFFIXES:
        raise RecordError(
            f"{path}: a matrix is read from a {', '.join(_SUFFIXES)}, .npy or .mat file; save it as one of these"
        )
    lines = text_of(path, MATRIX).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    # Some exports end each line with a separator.
    bare = (line.partition("#")[0].strip().rstrip(",; \t") for line in lines)
    rows = {number: row for number, row in enumerate(bare, start=1) if row}
    if not rows:
        raise RecordError(f"{path}: the file holds no numbers; a matrix was expected, a row in each line")
    delimiter = next((mark for mark in ";," if mark in next(iter(rows.values()))), None)
    try:
        return np.loadtxt(rows.values(), delimiter=delimiter, comments=None, ndmin=2)
    except ValueError as error:
        raise RecordError(f"{path}: {_fault_of(rows, delimiter) or error}") from None


def _fault_of(rows: Mapping[int, str], delimiter: str | None) -> str:
    """The first line that is no row of the matrix, in words."""
    width = 0
    for number, row in rows.items():
        fields = row.split(delimiter)
        width = width or len(fields)
        for field in fields:
            if not reads_as_float(field):
                expected = "a number was expected; a matrix has decimal points and no header"
                return f"line {number} holds {quote_value(field)} where {expected}"
        if len(fields) != width:
            return f"line {number} has {len(fields)} numbers where the first row has {width}; complete it"
    return ""


def _matrix_of_array(path: Path) -> Floats:
    try:
        array = np.lib.format.read_array(io.BytesIO(bytes_of(path, MATRIX)), allow_pickle=False)
    except ValueError as reason:
        raise RecordError(f"{path} is damaged ({reason_of(reason)}); {MATRIX.remedy}") from None
    if array.ndim not in (1, 2) or not array.size or array.dtype.kind not in "fiu":
        raise RecordError(
            f"{path}: a matrix of real numbers was expected, and the array has shape {array.shape} and numbers of the "
            f"kind {array.dtype.name}; save a matrix"
        )
    return np.atleast_2d(array.astype(np.float64))


def read_contents(path: Path, names: Collection[str]) -> Variables:
    """Read what a .mat file has by name, or a folder with one text file per matrix in `names`."""
    if is_folder(path):
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES)
        taken = {file.stem: file for file in files if file.stem in names}
        others = {file.name: "not read" for file in files if file not in taken.values()}
        if twice := [name for name in others if Path(name).stem in taken]:
            raise RecordError(
                f"{path}: has {taken[Path(twice[0]).stem].name} and {twice[0]}; keep one of them"
            )
        return {**{name: read_matrix(file) for name, file in taken.items()}, **others}
    return read_variables(path)[1]
