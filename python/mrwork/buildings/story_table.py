"""A shear building of a table with a row for each storey, as frame programs export it: mass, stiffness, height."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from mrwork.base.summary import list_names
from mrwork.base.units import STANDARD_GRAVITY, MeasuredQuantity
from mrwork.base.values import Floats
from mrwork.buildings.frames import shear_building
from mrwork.buildings.plane_building import Building
from mrwork.errors import RecordError
from mrwork.files.named_columns import ColumnTable, words_and_unit
from mrwork.files.open_table import open_table
from mrwork.files.roles import Role, column_of

_STOREY: Final = re.compile(
    r"(storey|story|level|floor|name|stockwerk|geschoss|piso|planta|étage|etage|階)s?", re.IGNORECASE
)
# Story3, 3F, Level 3, 3.
_NUMBER: Final = re.compile(r"\D*(\d{1,3})\D*")
# A row below the first storey.
_BASE: Final = re.compile(r"base|ground|foundation|basis|fundament|gf|0", re.IGNORECASE)


def _role(noun: str, quantity: MeasuredQuantity, words: str, example: str) -> Role:
    named = re.compile(rf"({words})[\s_-]?[xy]?", re.IGNORECASE)
    return Role(
        noun=noun,
        quantity=quantity,
        is_called=lambda name: named.fullmatch(words_and_unit(name)[0].strip(" _-")) is not None,
        example=example,
        takes_options=False,
    )


MASS: Final = _role("mass", "mass", "(storey|story|floor)?[\\s_-]?mass|masse|masa", "t")
WEIGHT: Final = _role("weight", "force", "(storey|story|floor)?[\\s_-]?weight|gewicht|peso|poids", "kN")
STIFFNESS: Final = _role(
    "stiffness", "stiffness", "(storey|story)?[\\s_-]?(stiff|stiffness)|steifigkeit|rigidez|k", "kN/m"
)
HEIGHT: Final = _role("height", "displacement", "(storey|story)?[\\s_-]?height|höhe|altura|hauteur|h", "m")
ELEVATION: Final = _role("elevation", "displacement", "elevation|elev|kote|cota|z", "m")


def building_of_stories(path: Path) -> Building:
    """Read a shear building from a table of storeys, in either order, numbered or by their elevations."""
    table, source = open_table(path, lambda _: True), str(path)
    weight, stiffness, height, elevation = (
        column_of(table, role, source, needed=role is STIFFNESS)
        for role in (WEIGHT, STIFFNESS, HEIGHT, ELEVATION)
    )
    mass = column_of(table, MASS, source, needed=weight is None)
    mass = weight / STANDARD_GRAVITY if mass is None and weight is not None else mass
    assert mass is not None
    assert stiffness is not None
    names = _names(table, mass.size)
    kept = [row for row, name in enumerate(names) if not _BASE.fullmatch(name.strip())]
    order = _order(
        [names[row] for row in kept], None if elevation is None else elevation[kept], table, kept, source
    )
    rows = [kept[place] for place in order]
    for role, values in ((MASS, mass), (STIFFNESS, stiffness)):
        for row in rows:
            if not (np.isfinite(values[row]) and values[row] > 0.0):
                raise RecordError(
                    f"{source}: {table.locate(row)}: the {role.noun} of {names[row]} is {values[row]:g}; give one "
                    "above zero"
                )
    if height is None and elevation is not None:
        based = [row for row, name in enumerate(names) if row not in kept]
        base = float(elevation[based[0]]) if based else 0.0
        height = np.zeros(mass.size)
        height[rows] = np.diff(elevation[rows], prepend=base)
    return shear_building(
        name=path.stem,
        masses=[float(mass[row]) for row in rows],
        stiffnesses=[float(stiffness[row]) for row in rows],
        heights=[] if height is None else [float(height[row]) for row in rows],
        floor_names=[names[row] if not names[row].isdigit() else f"floor {names[row]}" for row in rows],
        source=source,
    )


def _names(table: ColumnTable, count: int) -> list[str]:
    """Names of the storeys, or their numbers from the lowest where the table has none."""
    column = next((name for name in table.names if _STOREY.fullmatch(name.strip())), None)
    return table.texts(column) if column is not None else [str(row + 1) for row in range(count)]


def _order(
    names: Sequence[str], elevation: Floats | None, table: ColumnTable, rows: Sequence[int], source: str
) -> list[int]:
    """Places of the storeys from the lowest up, by elevation or else by the numbers in their names, without a hole."""
    if elevation is not None:
        return [int(place) for place in np.argsort(elevation, kind="stable")]
    matches = [_NUMBER.fullmatch(name) for name in names]
    if not all(matches):
        place = next(place for place, match in enumerate(matches) if match is None)
        raise RecordError(
            f"{source}: {table.locate(rows[place])}: '{names[place]}' has no number, and no column is the elevation; "
            "number the storeys from 1, or add a column such as elevation (m)"
        )
    numbers = [int(match[1]) for match in matches if match]
    expected = range(min(numbers), min(numbers) + len(numbers))
    if sorted(numbers) != [*expected]:
        lacking = sorted({*range(min(numbers), max(numbers) + 1)} - {*numbers})
        what = (
            f"storey {list_names([*map(str, lacking)])} is missing" if lacking else "a storey is there twice"
        )
        raise RecordError(f"{source}: {what}; give each of {min(numbers)} to {max(numbers)} a row")
    return [numbers.index(number) for number in expected]
