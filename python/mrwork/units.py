"""Units of quantities, their exact factors to SI, and standard gravity."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal, get_args

from mrwork.errors import UnitError

STANDARD_GRAVITY: Final = 9.80665
"""[m/s^2], exact by definition: third General Conference on Weights and Measures, 1901."""

MeasuredQuantity = Literal[
    "time",
    "frequency",
    "rate",
    "displacement",
    "velocity",
    "acceleration",
    "mass",
    "force",
    "stiffness",
    "damping",
    "current",
    "voltage",
    "current rate",
    "voltage rate",
]

CommandUnit = Literal[
    "A",
    "V",
    "mm",
    "in",
    "deg",
    "%",
    "bar",
    "psi",
    "kPa",
    "MPa",
    "lb",
    "degC",
    "degF",
    "K",
    "rpm",
    "Hz",
    "T",
    "mT",
    "W",
]
"""Unit of a command: of a current or voltage in SI, or that in which another scalar is recorded, never converted."""

DriverUnit = Literal["A", "V"]
"""Unit of the command that a controller sends to a driver."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandScale:
    """What the size of a command means: decimals of a set point, the largest one, and whether it may be negative."""

    decimals: int
    largest: float = 1e6
    is_signed: bool = False


COMMAND_SCALES: Final[Mapping[CommandUnit, CommandScale]] = MappingProxyType(
    {
        "A": CommandScale(decimals=2, largest=1000.0),
        "V": CommandScale(decimals=2, largest=1000.0),
        "mm": CommandScale(decimals=2),
        "in": CommandScale(decimals=3),
        "deg": CommandScale(decimals=1),
        "%": CommandScale(decimals=1),
        "bar": CommandScale(decimals=2),
        "psi": CommandScale(decimals=1),
        "kPa": CommandScale(decimals=0),
        "MPa": CommandScale(decimals=3),
        "lb": CommandScale(decimals=1),
        "degC": CommandScale(decimals=1, is_signed=True),
        "degF": CommandScale(decimals=1, is_signed=True),
        "K": CommandScale(decimals=1),
        "rpm": CommandScale(decimals=0),
        "Hz": CommandScale(decimals=2),
        "T": CommandScale(decimals=3),
        "mT": CommandScale(decimals=0),
        "W": CommandScale(decimals=1),
    }
)
"""Each unit of a command."""

OTHER_COMMAND_UNITS: Final[tuple[CommandUnit, ...]] = tuple(
    unit for unit in COMMAND_SCALES if unit not in get_args(DriverUnit)
)
"""Units of commands that are neither a current nor a voltage."""

_COMMAND_SPELLINGS: Final[Mapping[str, CommandUnit]] = {
    **{unit.casefold(): unit for unit in OTHER_COMMAND_UNITS},
    **dict.fromkeys(("\N{DEGREE SIGN}c", "deg c", "deg_c", "celsius"), "degC"),
    **dict.fromkeys(("\N{DEGREE SIGN}f", "deg f", "deg_f", "fahrenheit"), "degF"),
    **dict.fromkeys(("pct", "percent", "perc"), "%"),
    **dict.fromkeys(("lbs", "lbf"), "lb"),
    **dict.fromkeys(("\N{DEGREE SIGN}", "degree", "degrees"), "deg"),
    "inch": "in",
}

# A pound-force is 0.45359237 kg times standard gravity, both exact by definition.
_POUND_FORCE: Final = 4.4482216152605

FACTORS: Final[Mapping[MeasuredQuantity, Mapping[str, float]]] = MappingProxyType(
    {
        "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
        "frequency": {"Hz": 1.0},
        "rate": {"1/s": 1.0},
        "displacement": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
        "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "in/s": 0.0254},
        "acceleration": {
            "m/s2": 1.0,
            "cm/s2": 1e-2,
            "gal": 1e-2,
            "mm/s2": 1e-3,
            "g": STANDARD_GRAVITY,
            "mg": 1e-3 * STANDARD_GRAVITY,
            "in/s2": 0.0254,
            "ft/s2": 0.3048,
        },
        "mass": {"kg": 1.0, "t": 1e3},
        "force": {
            "N": 1.0,
            "kN": 1e3,
            "lbf": _POUND_FORCE,
            "kip": 1e3 * _POUND_FORCE,
            "kgf": STANDARD_GRAVITY,
            "tf": 1e3 * STANDARD_GRAVITY,
            "MN": 1e6,
        },
        "stiffness": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6, "N/mm": 1e3},
        "damping": {"N s/m": 1.0, "kN s/m": 1e3, "MN s/m": 1e6},
        "current": {"A": 1.0, "mA": 1e-3},
        "voltage": {"V": 1.0, "mV": 1e-3},
        "current rate": {"A/s": 1.0},
        "voltage rate": {"V/s": 1.0},
    }
)
"""Factor to SI of each unit of a quantity; the first unit is that of SI."""

_MEGA: Final = "M"

# Units are read in any case, except for mega, which would be milli.
_IN_ANY_CASE: Final[Mapping[tuple[MeasuredQuantity, str], float]] = {
    (quantity, symbol.casefold()): factor
    for quantity, units in FACTORS.items()
    for symbol, factor in units.items()
    if not symbol.startswith(_MEGA)
}

# The mark of an inch by itself; around a unit it is a quotation mark.
_INCH: Final = re.compile(r"(?:[\"\u2033\u201d])(?=/|$)")

# Column names cannot hold a slash: mmps, mm_s and mm_per_s are mm/s.
_VELOCITY: Final = re.compile(r"(m|cm|mm|in)(?:p|_|_per_)s", re.ASCII)
# cm/sec^2, cm/s/s, cm/sec/sec, cm/s**2, and, where a slash cannot stand, cmps2, cm_s2, cm_per_s2.
_ACCELERATION: Final = re.compile(
    r"(m|cm|mm|in|ft)(?:/|p|_per_|_)s(?:ec)?(?:(?:\^|\*\*|_)?2|/s(?:ec)?|²)|(m|cm|mm|in|ft)_?s-2", re.ASCII
)


# Words that programs of test rigs write for units, in front of or after a slash.
_WORDS: Final = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s", "msec": "ms", "millisecond": "ms",
    "milliseconds": "ms", "newton": "n", "newtons": "n", "kilonewton": "kn", "kilonewtons": "kn", "meter": "m",
    "meters": "m", "metre": "m", "metres": "m", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm",
    "millimetres": "mm", "inch": "in", "inches": "in", "in.": "in", "volt": "v", "volts": "v", "amp": "a", "amps": "a",
    "ampere": "a", "amperes": "a", "lb": "lbf", "lbs": "lbf", "kips": "kip",
}  # fmt: skip


# Quantities of a number by its SI unit; that of a command depends on the damper.
_MEASURES: Final[Mapping[str, tuple[MeasuredQuantity, ...]]] = {
    **{next(iter(units)): (quantity,) for quantity, units in FACTORS.items()},
    "A or V": ("current", "voltage"),
    "A/s or V/s": ("current rate", "voltage rate"),
}


# Characters of the longest spelling of a unit, with room.
_LONGEST: Final = 60


def number_in(text: str, unit: str) -> float | str:
    """A number in SI from a text such as "1 ms", or the reason why it is not one, as the rest of a sentence."""
    factors = {name: factor for quantity in _MEASURES[unit] for name, factor in FACTORS[quantity].items()}
    known, example = ", ".join(factors), f'"1 {list(factors)[:2][-1]}"'
    number, _, given = text.strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        return f"is {text!r}; give a number [{unit}], or one with its unit as in {example}"
    if given.strip() in factors:
        return value * factors[given.strip()]
    if not given:
        return (
            f"is the text {text!r}; give the number without quotes [{unit}], or with its unit as in {example}"
        )
    if any(given.strip() in units for units in FACTORS.values()):
        return f"is {text!r}, where a number [{unit}] is expected; its unit may be {known}"
    return f"is {text!r}, whose unit is not known; its unit may be {known}"


def factor_of(unit: str, quantity: MeasuredQuantity) -> float | None:
    """Factor to SI of a unit in any case and common spelling; `None` where it is no unit of the quantity."""
    symbol, spelled = _symbol_of(unit)
    factor = FACTORS[quantity].get(symbol)
    return factor if factor is not None else _IN_ANY_CASE.get((quantity, spelled))


def quantity_of(unit: str) -> MeasuredQuantity | None:
    """Quantity that a unit measures, `None` for an unknown unit."""
    symbol, spelled = _symbol_of(unit)
    return next(
        (
            quantity
            for quantity, factors in FACTORS.items()
            if symbol in factors or (quantity, spelled) in _IN_ANY_CASE
        ),
        None,
    )


def command_unit_of(unit: str) -> CommandUnit | None:
    """The unit of a command that is neither a current nor a voltage, in any case and common spelling; else `None`."""
    return _COMMAND_SPELLINGS.get(" ".join(unit.split()).casefold()) if len(unit) <= _LONGEST else None


def known_units(quantity: MeasuredQuantity) -> str:
    """The units of a quantity, as messages list them."""
    return ", ".join(FACTORS[quantity])


def factor_to_si(unit: str, quantity: MeasuredQuantity, *, context: str) -> float:
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
    factor = factor_of(unit, quantity)
    if factor is not None:
        return factor
    other = quantity_of(unit)
    says = f"is no unit of {quantity}" if other is None else f"is a unit of {other}, no unit of {quantity}"
    raise UnitError(f"{context}: '{unit}' {says}; give one of {known_units(quantity)}")


def _symbol_of(unit: str) -> tuple[str, str]:
    """Symbol of a unit as it is written, and without its case and spelling; empty where it is none."""
    text = unit.strip()
    symbol = _INCH.sub("in", text, count=1) if _INCH.match(text) else text.strip("'\"")
    return (symbol, _without_spelling(symbol)) if len(symbol) <= _LONGEST else ("", "")


def _without_spelling(symbol: str) -> str:
    text = symbol.replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u").casefold()
    text = "/".join(_WORDS.get(part, part) for part in text.split("/"))
    if match := _VELOCITY.fullmatch(text):
        return f"{match[1]}/s"
    if match := _ACCELERATION.fullmatch(text):
        return f"{match[1] or match[2]}/s2"
    return text
