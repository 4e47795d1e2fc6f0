"""What no building has: arrays that do not fit together, and masses, stiffnesses or damping that move without end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.values import Floats
from mrwork.buildings.modes import growing_modes, is_positive
from mrwork.buildings.structure import Structure
from mrwork.errors import SettingError

ARRAYS: Final = ("mass", "damping", "stiffness", "influence", "floors", "storeys")
"""Arrays that every building has."""
ASYMMETRY: Final = 1e-6
"""Relative error of published matrices, which have five or six digits, with each triangle rounded separately."""
# Height of a storey [m].
_TALLEST: Final = 200.0
# Products of several such numbers are finite.
_LARGEST: Final = 1e50
# Ratio of the smallest to the largest eigenvalue, after scaling to a unit diagonal.
_SINGULAR: Final = 1e-12
# A negative stiffness below this fraction of the largest is rounding.
_NEGATIVE_STIFFNESS: Final = 1e-9

# Five matrices, the copies of a reader and of the checks: gigabytes per coordinate squared.
_GIGABYTES: Final = 1.1e-7
# They fit into 1 GiB.
MOST_COORDINATES: Final = 3000


def check_size(n_coordinates: int, name: str) -> None:
    """Refuse a building whose matrices would not fit into memory."""
    if n_coordinates > MOST_COORDINATES:
        raise SettingError(
            f"building {name}: it has {n_coordinates:,} coordinates, and its matrices would take "
            f"{_GIGABYTES * n_coordinates**2:,.1f} GB until they are checked; condense it to at most "
            f"{MOST_COORDINATES:,} coordinates"
        )


def check_form(building: Structure) -> None:
    """Refuse arrays, names and numbers that do not fit together."""
    _refuse(building, _shapes, _sizes, _heights, _loads, _elements, _symmetry, _names)


def check_motion(building: Structure) -> None:
    """Refuse masses, a stiffness or damping that no building has."""
    _refuse(building, _mass, _stiffness, _weight, _motion)


def _refuse(building: Structure, *faults: Callable[[Structure], Iterator[str]]) -> None:
    """Refuse a building by the first fault that is found in it, in words."""
    for sentence in (sentence for find in faults for sentence in find(building)):
        raise SettingError(f"building {building.name}: {sentence}")


def _shapes(building: Structure) -> Iterator[str]:
    n = len(building.mass) if building.mass.ndim else 0
    if n == 0:
        yield "it has no coordinate; give a mass matrix of at least 1 x 1"
    for title in ARRAYS[:3]:
        if (matrix := getattr(building, title)).shape != (n, n):
            yield (
                f"{title} is {_sides(matrix)} where {n} x {n} was expected; "
                "M, C and K have one row and one column for each coordinate"
            )
    if building.influence.shape != (n,):
        yield f"influence is {_sides(building.influence)} where {n} entries were expected"
    for title in ARRAYS[4:]:
        rows = getattr(building, title)
        if rows.ndim != 2 or rows.shape[1] != n:
            yield f"{title} is {_sides(rows)}; give rows of {n} entries, one for each coordinate"


def _sizes(building: Structure) -> Iterator[str]:
    for title in ARRAYS:
        matrix: Floats = getattr(building, title)
        for index in np.argwhere(~(np.abs(matrix) <= _LARGEST)):
            entry = ", ".join(str(number + 1) for number in index)
            yield f"entry {entry} of {title} is {matrix[tuple(index)]:g}, which is beyond any building; correct it"


def _heights(building: Structure) -> Iterator[str]:
    heights = building.heights
    if heights.shape not in ((0,), (len(building.storeys),)):
        yield (
            f"heights is {_sides(heights)} where {len(building.storeys)} entries were expected, one for each storey"
        )
    if heights.size and not (((heights >= 0.0) & (heights <= _TALLEST)).all() and heights.any()):
        wrong = next((value for value in heights.tolist() if not 0.0 <= value <= _TALLEST), 0.0)
        yield f"the height of a storey is {wrong:g} m, which is beyond any storey; give heights in m, as 3.5"


def _loads(building: Structure) -> Iterator[str]:
    loads, heights = building.loads, building.heights
    if loads.shape not in ((0,), (len(building.storeys),)) or not (loads >= 0.0).all():
        yield (
            f"loads is {_sides(loads)} from {loads.min(initial=0.0):g}; give a weight of 0 N or more for each of "
            f"{counted(len(building.storeys), 'storey')}"
        )
    if building.drift_limit and not heights.size:
        yield "drift_limit stands on heights; give height or heights in [building]"
    if loads.any() and not (heights.size and (heights[loads > 0.0] > 0.0).all()):
        yield "P-delta stands on the heights of the storeys; give height or heights in [building]"


def _elements(building: Structure) -> Iterator[str]:
    for element in building.elements:
        if element.row.shape != building.influence.shape:
            yield (
                f"the row of {element.name} has shape {element.row.shape}; give ({building.influence.size},), a row of "
                "`storeys`"
            )


def _symmetry(building: Structure) -> Iterator[str]:
    for title in ("mass", "stiffness"):
        matrix: Floats = getattr(building, title)
        skew = np.abs(matrix - matrix.T)
        row, column = np.unravel_index(int(skew.argmax()), skew.shape)
        if skew[row, column] > ASYMMETRY * np.abs(matrix).max():
            yield (
                f"{title} is not symmetric, entry {row + 1}, {column + 1} is {matrix[row, column]:g} "
                f"and entry {column + 1}, {row + 1} is {matrix[column, row]:g}; make them equal"
            )


def _names(building: Structure) -> Iterator[str]:
    n_floors, n_storeys = len(building.floors), len(building.storeys)
    for noun, names, n_rows in (
        ("floor", building.floor_names, n_floors),
        ("storey", building.storey_names, n_storeys),
    ):
        if len(names) != n_rows:
            yield f"{len(names)} {noun} names for {n_rows} {noun} rows; name each of them"
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            yield f"two {noun}s are called {twice!r}; give each a different name"
    for name in building.isolators:
        if name not in (known := building.storey_names[: len(building.chain)]):
            yield f"isolators names {name!r}, which is no storey between floors; give some of {', '.join(known)}"
    if not 0 <= building.n_strokes <= n_storeys:
        yield (
            f"{building.n_strokes} of {n_storeys} storey rows are declared as strokes; give a number from zero to all"
        )


def _mass(building: Structure) -> Iterator[str]:
    mass, diagonal = building.mass, np.diag(building.mass)
    remedy = (
        "give it a mass, or leave it out of floors, storeys and rows; static_condensation condenses it, and a study "
        "without condense = false"
    )
    for first in np.flatnonzero(diagonal < 1.0 / _LARGEST).tolist():
        yield (
            f"the mass of coordinate {first + 1} is {diagonal[first]:g} kg, so the mass matrix is singular or worse; "
            f"{remedy}"
        )
    scale = 1.0 / np.sqrt(diagonal)
    scaled = mass * np.outer(scale, scale)
    # No eigenvalue is above the largest sum of a row.
    if is_positive(scaled, -_SINGULAR * float(np.abs(scaled).sum(axis=1).max())):
        return
    values, vectors = np.linalg.eigh(scaled)
    if values[0] <= _SINGULAR * values[-1]:
        # Largest coordinate of the motion that moves no mass.
        first = int(np.abs(vectors[:, 0]).argmax())
        kind = "singular" if abs(values[0]) <= _SINGULAR * values[-1] else "not positive definite"
        yield f"the mass matrix is {kind}, a motion dominated by coordinate {first + 1} moves no mass; {remedy}"


def _stiffness(building: Structure) -> Iterator[str]:
    stiffness = building.stiffness
    # The largest eigenvalue is not below the largest entry of the diagonal.
    if is_positive(stiffness, _NEGATIVE_STIFFNESS * max(float(np.diag(stiffness).max()), 0.0)):
        return
    values, vectors = np.linalg.eigh(stiffness)
    if values[0] < -_NEGATIVE_STIFFNESS * max(values[-1], 0.0) and values[0] < 0.0:
        first = int(np.abs(vectors[:, 0]).argmax())
        yield (
            f"the stiffness is unstable, a motion dominated by coordinate {first + 1} has the stiffness "
            f"{values[0]:g} N/m; check its signs"
        )


def _weight(building: Structure) -> Iterator[str]:
    if building.loads.any() and not is_positive(building.stiffness - building._geometric):
        softer, springs = building._softer, building.storey_stiffnesses
        storey = int(np.argmax(softer / springs if springs.shape == softer.shape else softer))
        yield (
            f"it falls under its weight: in {building.storey_names[storey]} P / h is {softer[storey]:.4g} N/m; check "
            "masses in kg, stiffnesses in N/m and heights in m"
        )


def _motion(building: Structure) -> Iterator[str]:
    yields = bool(building.loops)
    if yields and not is_positive(building._beside_loops, 1e-9 * float(np.trace(building.stiffness))):
        yield (
            "the storeys that yield are stiffer than the stiffness matrix, which has their initial stiffness; give the "
            "matrix of the elastic frame, and let its storeys yield once"
        )
    if growing := growing_modes(building.mass, building.damping, building.stiffness, building.floors):
        yield (
            f"{growing}, so that motion grows without end; check the signs of the damping matrix, and give a device "
            "that feeds energy as a control law, not as damping"
        )


def _sides(matrix: Floats) -> str:
    return " x ".join(str(side) for side in matrix.shape) if matrix.ndim > 1 else f"{matrix.size} long"
