"""Sparse matrices of MATLAB .mat files, filled up: those met here are state matrices of a few hundred rows."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

# A filled matrix of more items is not worth its memory, and a header may claim any size.
_MOST_ITEMS: Final = 1 << 24


class DamagedError(Exception):
    """What is wrong inside a .mat file; who opened it says which file."""


def sparse_version_4(triplets: NDArray[np.generic], name: str) -> NDArray[np.float64]:
    """Fill up from rows of row, column (from 1) and value, shape (n_items + 1, 3); the last row has the sides."""
    if triplets.ndim != 2 or triplets.shape[1] != 3 or not len(triplets):
        raise DamagedError(f"sparse variable '{name}' is not a list of row, column, value")
    places = triplets[:, :2].astype(np.int64)
    return _filled(
        places[:-1, 0] - 1,
        places[:-1, 1] - 1,
        triplets[:-1, 2],
        (int(places[-1, 0]), int(places[-1, 1])),
        name,
    )


def sparse_version_5(
    rows: NDArray[np.int32],
    starts: NDArray[np.int32],
    values: NDArray[np.generic],
    shape: tuple[int, int],
    name: str,
) -> NDArray[np.float64]:
    """Fill up from compressed columns: column j has the items `starts[j]` to `starts[j + 1]`, in `rows` from 0."""
    counts = np.diff(starts)
    if len(starts) != shape[1] + 1 or starts[0] != 0 or (counts < 0).any():
        raise DamagedError(f"sparse variable '{name}' has no order in its columns")
    n_items = int(starts[-1])
    if n_items > min(len(rows), values.size):
        raise DamagedError(
            f"sparse variable '{name}' claims {n_items} items and has {min(len(rows), values.size)}"
        )
    columns = np.repeat(np.arange(shape[1]), counts)
    return _filled(rows[:n_items].astype(np.int64), columns, values.ravel()[:n_items], shape, name)


def _filled(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    values: NDArray[np.generic],
    shape: tuple[int, int],
    name: str,
) -> NDArray[np.float64]:
    if min(shape) < 0 or shape[0] * shape[1] > _MOST_ITEMS:
        raise DamagedError(f"sparse variable '{name}' claims to be {shape[0]} x {shape[1]}")
    inside = (rows >= 0) & (rows < shape[0]) & (columns >= 0) & (columns < shape[1])
    if not inside.all():
        raise DamagedError(f"sparse variable '{name}' has an item outside its {shape[0]} x {shape[1]}")
    matrix = np.zeros(shape)
    np.add.at(matrix, (rows, columns), values.astype(np.float64))
    return matrix
