"""Units a record may be written in, and their exact factors to SI."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal

from mrwork.errors import UnitError

Quantity = Literal["time", "displacement", "velocity", "force", "current", "voltage"]

# A pound-force is 0.45359237 kg times standard gravity 9.80665 m/s2, both exact by definition.
_POUND_FORCE: Final = 4.4482216152605

FACTORS: Final[Mapping[Quantity, Mapping[str, float]]] = MappingProxyType(
    {
        "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
        "displacement": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
        "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "in/s": 0.0254},
        "force": {"N": 1.0, "kN": 1e3, "lbf": _POUND_FORCE, "kip": 1e3 * _POUND_FORCE, "kgf": 9.80665},
        "current": {"A": 1.0, "mA": 1e-3},
        "voltage": {"V": 1.0, "mV": 1e-3},
    }
)

# Column names cannot hold a slash, so velocities have spellings without one.
_SPELLINGS: Final[Mapping[str, str]] = {
    f"{length}{separator}s": f"{length}/s"
    for length in ("m", "cm", "mm", "in")
    for separator in ("p", "_", "_per_")
}


def _normal(unit: str) -> str:
    text = unit.strip().replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u").casefold()
    return _SPELLINGS.get(text, text)


_BY_NAME: Final[Mapping[tuple[Quantity, str], float]] = {
    (quantity, symbol.casefold()): factor
    for quantity, table in FACTORS.items()
    for symbol, factor in table.items()
}


def measures(unit: str) -> Quantity | None:
    """Quantity that a unit measures, `None` for an unknown unit."""
    name = _normal(unit)
    return next((quantity for quantity in FACTORS if (quantity, name) in _BY_NAME), None)


def factor_to_si(unit: str, quantity: Quantity, *, context: str) -> float:
    """Factor by which values in `unit` are multiplied to be in SI.

    Parameters
    ----------
    unit
        Symbol in any case, such as ``"kN"``, ``"mm/s"`` or its spelling in a column name, ``"mmps"``.
    quantity
        What the values measure.
    context
        Start of the error's sentence: the file and column, or the option.

    Raises
    ------
    UnitError
        The unit is unknown or measures another quantity.
    """
    factor = _BY_NAME.get((quantity, _normal(unit)))
    if factor is not None:
        return factor
    known = ", ".join(FACTORS[quantity])
    other = measures(unit)
    if other is None:
        raise UnitError(f"{context}: '{unit}' is not a known unit; give {quantity} in one of {known}")
    raise UnitError(f"{context}: '{unit}' is a unit of {other}; give {quantity} in one of {known}")
