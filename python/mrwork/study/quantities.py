"""Numbers with a unit, as a study may give them: 0.001, "1 ms", "0.1 g"."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from mrwork.closed_loop.evaluation import STANDARD_GRAVITY

# SI unit to the factors of those that measure the same.
FACTORS: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
        "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
        "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
        "m/s2": {"m/s2": 1.0, "cm/s2": 1e-2, "gal": 1e-2, "g": STANDARD_GRAVITY},
        "N": {"N": 1.0, "kN": 1e3, "MN": 1e6},
        "kg": {"kg": 1.0, "t": 1e3},
        "N/m": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6, "N/mm": 1e3},
        "N s/m": {"N s/m": 1.0, "kN s/m": 1e3, "MN s/m": 1e6},
        "Hz": {"Hz": 1.0},
        "A or V": {"A": 1.0, "mA": 1e-3, "V": 1.0, "mV": 1e-3},
        "1/s": {"1/s": 1.0},
        "A/s or V/s": {"A/s": 1.0, "V/s": 1.0},
    }
)


def number_of(text: str, unit: str) -> float | str:
    """A number in SI from a text such as "1 ms"; else what is wrong with it, as the rest of a sentence."""
    number, _, given = text.strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        return f"is {text!r}; give a number [{unit}], or one with its unit as in {_example(unit)}"
    factors = FACTORS[unit]
    if given.strip() in factors:
        return value * factors[given.strip()]
    if not given:
        return f"is the text {text!r}; give the number without quotes [{unit}], or with its unit as in {_example(unit)}"
    known = ", ".join(factors)
    for other in FACTORS.values():
        if given.strip() in other:
            return f"is {text!r}, where a number [{unit}] is wanted; its unit may be {known}"
    return f"is {text!r}, whose unit is not known; its unit may be {known}"


def _example(unit: str) -> str:
    return f'"1 {list(FACTORS[unit])[-1]}"'
