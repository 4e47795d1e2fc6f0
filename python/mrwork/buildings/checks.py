"""What a building must be before anything is computed with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError

if TYPE_CHECKING:
    from mrwork.buildings.matrices import Building

Floats = NDArray[np.float64]

STATUSES: Final = ("verified", "published", "ours")
# Matrices are typed from tables of five or six digits, each triangle rounded by itself.
_ASYMMETRY: Final = 1e-6
# Of the smallest eigenvalue over the largest, rows and columns scaled to a unit diagonal.
_SINGULAR: Final = 1e-12
# A negative stiffness of this share of the largest is rounding.
_ROUNDING: Final = 1e-9


def check_building(building: Building) -> None:
    """Refuse a building that cannot be computed with.

    Raises
    ------
    SettingError
        Where shapes disagree, a number is not finite, M or K is not symmetric, M is singular or K unstable.
    """
    where = f"building {building.name}"
    _check_shapes(building, where)
    for title, matrix in (
        ("mass", building.mass),
        ("damping", building.damping),
        ("stiffness", building.stiffness),
        ("influence", building.influence),
        ("floors", building.floors),
        ("storeys", building.storeys),
    ):
        if not np.isfinite(matrix).all():
            place = ", ".join(str(index + 1) for index in np.argwhere(~np.isfinite(matrix))[0])
            raise SettingError(f"{where}: entry {place} of {title} is not a finite number; correct it")
    _check_symmetric(building.mass, "mass", where)
    _check_symmetric(building.stiffness, "stiffness", where)
    _check_mass(building.mass, where)
    _check_stiffness(building.stiffness, where)
    _check_names(building.floor_names, len(building.floors), "floor", where)
    _check_names(building.storey_names, len(building.storeys), "storey", where)
    if building.status not in STATUSES:
        raise SettingError(f"{where}: the status is {building.status!r}; it is one of {', '.join(STATUSES)}")
    if not 0 <= building.n_strokes <= len(building.storeys):
        raise SettingError(
            f"{where}: {building.n_strokes} of {len(building.storeys)} storey rows are said to be strokes; "
            "give a number from zero to all"
        )


def _check_shapes(building: Building, where: str) -> None:
    n = len(building.mass) if building.mass.ndim else 0
    if n == 0:
        raise SettingError(f"{where}: it has no coordinate; give a mass matrix of at least 1 x 1")
    for title, matrix in (
        ("mass", building.mass),
        ("damping", building.damping),
        ("stiffness", building.stiffness),
    ):
        if matrix.shape != (n, n):
            raise SettingError(
                f"{where}: {title} is {_sides(matrix)} where {n} x {n} was expected; "
                "M, C and K have one row and one column for each coordinate"
            )
    if building.influence.shape != (n,):
        raise SettingError(
            f"{where}: influence is {_sides(building.influence)} where {n} entries were expected"
        )
    for title, rows in (("floors", building.floors), ("storeys", building.storeys)):
        if rows.ndim != 2 or rows.shape[1] != n:
            raise SettingError(
                f"{where}: {title} is {_sides(rows)}; give rows of {n} entries, one for each coordinate"
            )


def _check_symmetric(matrix: Floats, title: str, where: str) -> None:
    skew = np.abs(matrix - matrix.T)
    row, column = np.unravel_index(int(skew.argmax()), skew.shape)
    if skew[row, column] > _ASYMMETRY * np.abs(matrix).max():
        raise SettingError(
            f"{where}: {title} is not symmetric, entry {row + 1}, {column + 1} is {matrix[row, column]:g} "
            f"and entry {column + 1}, {row + 1} is {matrix[column, row]:g}; make them equal"
        )


def _check_mass(mass: Floats, where: str) -> None:
    diagonal = np.diag(mass)
    remedy = "give it a mass, or condense it out of the matrices"
    if (diagonal <= 0.0).any():
        first = int(np.flatnonzero(diagonal <= 0.0)[0])
        raise SettingError(
            f"{where}: the mass of coordinate {first + 1} is {diagonal[first]:g} kg, so the mass matrix is "
            f"singular or worse; {remedy}"
        )
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(mass * np.outer(scale, scale))
    if values[0] <= _SINGULAR * values[-1]:
        # The motion that moves no mass, in the coordinate where it is largest.
        first = int(np.abs(vectors[:, 0]).argmax())
        kind = "singular" if abs(values[0]) <= _SINGULAR * values[-1] else "not positive definite"
        raise SettingError(
            f"{where}: the mass matrix is {kind}, a motion led by coordinate {first + 1} moves no mass; {remedy}"
        )


def _check_stiffness(stiffness: Floats, where: str) -> None:
    values, vectors = np.linalg.eigh(stiffness)
    if values[0] < -_ROUNDING * max(values[-1], 0.0) and values[0] < 0.0:
        first = int(np.abs(vectors[:, 0]).argmax())
        raise SettingError(
            f"{where}: the stiffness is unstable, a motion led by coordinate {first + 1} is pushed on with "
            f"{values[0]:g} N/m; check its signs"
        )


def _check_names(names: Sequence[str], n_rows: int, noun: str, where: str) -> None:
    if len(names) != n_rows:
        raise SettingError(f"{where}: {len(names)} {noun} names for {n_rows} {noun} rows; name each of them")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise SettingError(f"{where}: two {noun}s are called {twice!r}; give each a name of its own")


def _sides(matrix: Floats) -> str:
    return " x ".join(str(side) for side in matrix.shape) if matrix.ndim > 1 else f"{matrix.size} long"
