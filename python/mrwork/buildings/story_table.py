"""A shear building of tables with a row for each storey, as frame programs export them: mass, stiffness, height."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final
from warnings import warn

import numpy as np

from mrwork.base.summary import list_names
from mrwork.base.units import STANDARD_GRAVITY, MeasuredQuantity
from mrwork.buildings.frames import shear_building
from mrwork.buildings.plane_building import Building
from mrwork.errors import MrworkWarning, RecordError
from mrwork.files.joined import parts_of
from mrwork.files.named_columns import ColumnTable, words_and_unit
from mrwork.files.open_table import open_sheets
from mrwork.files.roles import Role, column_of

_STOREY: Final = re.compile(
    r"(storey|story|level|floor|name|stockwerk|geschoss|piso|planta|étage|etage|階)s?", re.IGNORECASE
)
# Story3, 3F, Level 3, 3.
_NUMBER: Final = re.compile(r"\D*(\d{1,3})\D*")
# A row below the first storey.
_BASE: Final = re.compile(r"base|ground|foundation|basis|fundament|gf|0", re.IGNORECASE)


def _roles(noun: str, quantity: MeasuredQuantity, words: str, example: str) -> tuple[Role, Role]:
    """The role of a column of the direction X, or of none, and that of Y."""

    def role(ends: str) -> Role:
        named = re.compile(rf"({words}){ends}", re.IGNORECASE)
        return Role(
            noun=noun,
            quantity=quantity,
            is_called=lambda name: named.fullmatch(words_and_unit(name)[0].strip(" _-")) is not None,
            example=example,
            takes_options=False,
        )

    return role(r"([\s_-]?x)?"), role(r"[\s_-]?y")


MASS: Final = _roles("mass", "mass", "(storey|story|floor)?[\\s_-]?mass|masse|masa|u", "t")
WEIGHT: Final = _roles("weight", "force", "(storey|story|floor)?[\\s_-]?weight|gewicht|peso|poids", "kN")
STIFFNESS: Final = _roles(
    "stiffness", "stiffness", "(storey|story)?[\\s_-]?(stiff|stiffness)|steifigkeit|rigidez|k", "kN/m"
)
HEIGHT: Final = _roles("height", "displacement", "(storey|story)?[\\s_-]?height|höhe|altura|hauteur|h", "m")
ELEVATION: Final = _roles("elevation", "displacement", "elevation|elev|kote|cota|z", "m")
# Height of a storey over the median, from which on one without its number is missing below it.
_TWO_STOREYS: Final = 1.5


def building_of_stories(path: Path) -> Building:
    """Read a shear building from tables of storeys, in either order, numbered or by their elevations.

    A workbook may have a sheet for each quantity, and ``stories.csv+mass.csv`` a file; their rows are of one storey by
    its name. Of two directions X is read.
    """
    source = str(path)
    tables = [each for part in parts_of(path) for each in open_sheets(part.path)]
    tables = [table for table in tables if _storeys_of(table)] or tables
    weight, stiffness, height, elevation = (
        _by_storey(tables, roles, source, needed=roles is STIFFNESS)
        for roles in (WEIGHT, STIFFNESS, HEIGHT, ELEVATION)
    )
    mass = _by_storey(tables, MASS, source, needed=not weight)
    mass = mass or {name: each / STANDARD_GRAVITY for name, each in weight.items()}
    names = [name for name in stiffness if not _BASE.fullmatch(name)]
    for noun, values in (
        ("mass", mass),
        ("stiffness", stiffness),
        ("height", height),
        ("elevation", elevation),
    ):
        lacking = [name for name in names if name not in values]
        if values and lacking:
            raise RecordError(f"{source}: the {noun} of {list_names(lacking)} is missing; add its row")
    names = _in_order(names, elevation, source, partial(_place, tables))
    for noun, values in (("mass", mass), ("stiffness", stiffness)):
        for name in names:
            if not (np.isfinite(values[name]) and values[name] > 0.0):
                raise RecordError(
                    f"{source}: {_place(tables, name)}the {noun} of {name} is {values[name]:g}; give one above zero"
                )
    if elevation:
        base = next((each for name, each in elevation.items() if _BASE.fullmatch(name)), 0.0)
        height = height or dict(
            zip(names, np.diff([elevation[name] for name in names], prepend=base), strict=True)
        )
    return shear_building(
        name=path.stem,
        masses=[float(mass[name]) for name in names],
        stiffnesses=[float(stiffness[name]) for name in names],
        heights=[float(height[name]) for name in names] if height else [],
        floor_names=[name if not name.isdigit() else f"floor {name}" for name in names],
        source=source,
    )


def _storeys_of(table: ColumnTable) -> str:
    return next((name for name in table.names if _STOREY.fullmatch(name.strip())), "")


def _names(table: ColumnTable) -> list[str]:
    """Names of the storeys, or their numbers from the lowest where the table has none."""
    column, count = _storeys_of(table), table.size_of(table.names[0])
    return (
        [name.strip() for name in table.texts(column)] if column else [str(row + 1) for row in range(count)]
    )


def _place(tables: Sequence[ColumnTable], name: str) -> str:
    """Line of a storey in a single table, for a message."""
    return f"{tables[0].locate(_names(tables[0]).index(name))}: " if len(tables) == 1 else ""


def _by_storey(
    tables: Sequence[ColumnTable], roles: tuple[Role, Role], source: str, *, needed: bool
) -> dict[str, float]:
    """Numbers in SI by the storey, of the one table that has the role; of two directions those of X, told."""
    role, _ = roles
    for table in tables:
        of_x, of_y = (column_of(table, each, source, needed=False) for each in roles)
        values = of_y if of_x is None else of_x
        if values is None:
            continue
        if of_y is not None and not np.array_equal(values, of_y, equal_nan=True):
            warn(
                f"{source}: the {role.noun} is read of the direction X; for Y delete the columns of X",
                MrworkWarning,
                stacklevel=2,
            )
        names = _names(table)
        if twice := [name for name in names if names.count(name) > 1]:
            raise RecordError(
                f"{source}: a storey is there twice, {twice[0]}; keep one row of each, of one load case"
            )
        return dict(zip(names, values.tolist(), strict=True))
    if needed:
        column_of(tables[0], role, source, needed=True)
    return {}


def _base(elevation: Mapping[str, float]) -> float:
    """Elevation of the row below the first storey, 0 without one."""
    return next((each for name, each in elevation.items() if _BASE.fullmatch(name)), 0.0)


def _in_order(
    names: Sequence[str], elevation: Mapping[str, float], source: str, place: Callable[[str], str]
) -> list[str]:
    """The storeys from the lowest up, by elevation or else by the numbers in their names, without a hole."""
    matches = [_NUMBER.fullmatch(name) for name in names]
    numbers = [int(match[1]) for match in matches if match]
    lacking = sorted({*range(min(numbers, default=0), max(numbers, default=-1) + 1)} - {*numbers})
    what = f"storey {list_names([*map(str, lacking)])} is missing"
    every = f"give each of {min(numbers, default=1)} to {max(numbers, default=1)} a row"
    if elevation:
        upward = sorted(names, key=elevation.__getitem__)
        heights = np.diff([elevation[name] for name in upward], prepend=_base(elevation))
        # Some buildings have no storey 13.
        if all(matches) and lacking and heights.max(initial=0.0) > _TWO_STOREYS * np.median(heights):
            raise RecordError(f"{source}: {what}, and a storey is {heights.max():g} m high; {every}")
        return upward
    if not all(matches):
        name = names[matches.index(None)]
        raise RecordError(
            f"{source}: {place(name)}'{name}' has no number, and no column is the elevation; number the storeys from "
            "1, or add a column such as elevation (m)"
        )
    if lacking:
        raise RecordError(f"{source}: {what}; {every}")
    return sorted(names, key=dict(zip(names, numbers, strict=True)).__getitem__)
