"""Keys of declared tables: a dataclass field says what a key means, its unit and its range.

Readers of files, the schema that people read, and scripts that build the same values go by these notes.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, Field, field, fields
from typing import Any

from mrwork.errors import InvalidSettingError

_REQUIRED: Any = MISSING


def key(
    says: str,
    *,
    unit: str = "",
    default: Any = _REQUIRED,
    least: float = -math.inf,
    above: float = -math.inf,
) -> Any:
    """A key of a table.

    Parameters
    ----------
    says
        What it means.
    unit
        SI unit of a number; in a file it may then also come as a text with another unit.
    default
        What it is where nothing is said; without one it must be given.
    least, above
        A number is no less than the one, and more than the other.
    """
    notes = {"says": says, "unit": unit, "least": least, "above": above}
    return field(metadata=notes) if default is MISSING else field(default=default, metadata=notes)


def is_required(entry: Field[Any]) -> bool:
    """Whether the key must be given."""
    return entry.default is MISSING and entry.default_factory is MISSING


def described(entry: Field[Any]) -> str:
    """What a key means, and its unit."""
    unit = entry.metadata["unit"]
    return f"{entry.metadata['says']}{f' [{unit}]' if unit else ''}"


def out_of_range(name: str, value: float, entry: Field[Any]) -> str:
    """What is wrong with the number of a key; empty where nothing is."""
    least, above = entry.metadata["least"], entry.metadata["above"]
    # An infinite rate is no limit, and a broken sensor may say nan; nothing else is not finite.
    if (math.isnan(value) and name != "value") or (math.isinf(value) and entry.default != math.inf):
        return f"{name} is {value}; give a finite number"
    if value < least:
        return f"{name} is {value:g}; it can be no less than {least:g}"
    if value <= above:
        return f"{name} is {value:g}; it must be more than {above:g}"
    return ""


def check_keys(table: Any) -> None:
    """Check the numbers of a table that a script has made.

    Raises
    ------
    InvalidSettingError
        Where one is out of range.
    """
    for entry in fields(table):
        given = getattr(table, entry.name)
        for value in given if isinstance(given, tuple) else (given,):
            if isinstance(value, int | float) and (refusal := out_of_range(entry.name, value, entry)):
                raise InvalidSettingError(entry.name, refusal)
