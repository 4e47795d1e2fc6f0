"""Units of acceleration that records are written in, alone or at the end of a column's name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from mrwork.errors import UnitError

# By definition, third General Conference on Weights and Measures, 1901.
STANDARD_GRAVITY: Final = 9.80665

FACTORS: Final[Mapping[str, float]] = MappingProxyType(
    {
        "m/s2": 1.0,
        "cm/s2": 1e-2,
        "gal": 1e-2,
        "mm/s2": 1e-3,
        "g": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY,
        "in/s2": 0.0254,
        "ft/s2": 0.3048,
    }
)
# cm/sec^2, cm/s/s, cm/sec/sec, cm/s**2, and, where a slash cannot stand, cmps2, cm_s2, cm_per_s2.
_OF_LENGTH: Final = re.compile(
    r"(m|cm|mm|in|ft)(?:/|p|_per_|_)s(?:ec)?(?:(?:\^|\*\*|_)?2|/s(?:ec)?|²)|(m|cm|mm|in|ft)_?s-2", re.ASCII
)


def factor_of(unit: str) -> float | None:
    """Factor from a unit of acceleration, in any case and common spelling, to m/s^2; `None` for another text."""
    text = unit.strip().strip("'\"").casefold()
    match = _OF_LENGTH.fullmatch(text)
    return FACTORS.get(f"{match[1] or match[2]}/s2" if match else text)


def factor_to_si(unit: str, *, context: str) -> float:
    """Factor by which accelerations in `unit` are multiplied to be in m/s^2.

    Raises
    ------
    UnitError
        It is no unit of acceleration; `context` begins the sentence.
    """
    factor = factor_of(unit)
    if factor is None:
        raise UnitError(f"{context}: '{unit}' is no unit of acceleration; give one of {', '.join(FACTORS)}")
    return factor


def unit_in(name: str) -> str | None:
    """Unit of acceleration that ends a column's name, such as ``a_mps2``, ``Acc (cm/s^2)`` or ``EW [g]``.

    ``a_g`` is not taken for an acceleration in g: it is as often the ground's acceleration in some other unit.
    """
    text = name.strip()
    if text.casefold() in ("a_g", "ag"):
        return None
    bracketed = re.search(r"[(\[]([^)\]]*)[)\]]$", text)
    if bracketed:
        return bracketed[1].strip() if factor_of(bracketed[1]) is not None else None
    for place in re.finditer(r"[\s_\-,:]+", text):
        rest = text[place.end() :]
        if factor_of(rest) is not None:
            return rest
    return None
