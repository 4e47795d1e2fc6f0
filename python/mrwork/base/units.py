"""Units of quantities, their exact factors to SI, and standard gravity."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal, get_args

from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.errors import UnitError

STANDARD_GRAVITY: Final = 9.80665
"""[m/s^2], exact by definition: third General Conference on Weights and Measures, 1901."""

RATIOS: Final = (5e-4, 0.25)
"""Usual damping ratios of frames and of spectra."""

MeasuredQuantity = Literal[
    "time", "frequency", "rate", "displacement", "velocity", "acceleration", "mass", "force", "stiffness", "damping",
    "current", "voltage", "current rate", "voltage rate",
]  # fmt: skip

CommandUnit = Literal[
    "A", "V", "mm", "in", "deg", "%", "bar", "psi", "kPa", "MPa", "lb", "degC", "degF", "K", "rpm", "Hz", "T", "mT",
    "W",
]  # fmt: skip
"""Unit of a command: of a current or voltage in SI, or that in which another scalar is recorded, never converted."""

DriverUnit = Literal["A", "V"]
"""Unit of the command that a controller sends to a driver."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandScale:
    """Scale of a command: decimals of a set point, the largest command, and whether it may be negative."""

    decimals: int
    largest: float = 1e6
    is_signed: bool = False


COMMAND_SCALES: Final[Mapping[CommandUnit, CommandScale]] = MappingProxyType({
    "A": CommandScale(decimals=2, largest=1000.0), "V": CommandScale(decimals=2, largest=1000.0),
    "mm": CommandScale(decimals=2), "in": CommandScale(decimals=3),
    "deg": CommandScale(decimals=1), "%": CommandScale(decimals=1),
    "bar": CommandScale(decimals=2), "psi": CommandScale(decimals=1),
    "kPa": CommandScale(decimals=0), "MPa": CommandScale(decimals=3), "lb": CommandScale(decimals=1),
    "degC": CommandScale(decimals=1, is_signed=True), "degF": CommandScale(decimals=1, is_signed=True),
    "K": CommandScale(decimals=1), "rpm": CommandScale(decimals=0), "Hz": CommandScale(decimals=2),
    "T": CommandScale(decimals=3), "mT": CommandScale(decimals=0), "W": CommandScale(decimals=1),
})  # fmt: skip
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

# Pound of mass times standard gravity, both exact by definition.
_POUND_FORCE: Final = 4.4482216152605

_PREFIXES: Final[Mapping[str, float]] = {
    "": 1.0, "G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Unit:
    """Factor to SI, powers of the base units of which the unit is a product, and the prefixes usual with it."""

    factor: float
    powers: Mapping[str, int]
    prefixes: str = ""


_FORCE: Final = {"kg": 1, "m": 1, "s": -2}
# The radian, the cycle of a Hz and the volt count as base units. A prefix that is not usual makes no unit, as in kmin
# or mkg, nor does one that makes another unit: milli-inches would be minutes.
_SYMBOLS: Final[Mapping[str, Unit]] = {
    "1": Unit(1.0, {}),
    "s": Unit(1.0, {"s": 1}, "mun"),
    "min": Unit(60.0, {"s": 1}),
    "h": Unit(3600.0, {"s": 1}),
    "mph": Unit(0.44704, {"m": 1, "s": -1}),
    "Hz": Unit(1.0, {"cycle": 1, "s": -1}, "kMm"),
    "rad": Unit(1.0, {"rad": 1}, "m"),
    "m": Unit(1.0, {"m": 1}, "kcmun"),
    "in": Unit(0.0254, {"m": 1}),
    "ft": Unit(0.3048, {"m": 1}),
    "gal": Unit(1e-2, {"m": 1, "s": -2}),
    "g": Unit(STANDARD_GRAVITY, {"m": 1, "s": -2}, "m"),
    "kg": Unit(1.0, {"kg": 1}),
    "t": Unit(1e3, {"kg": 1}),
    "Mg": Unit(1e3, {"kg": 1}),
    "lbm": Unit(0.45359237, {"kg": 1}),
    "slug": Unit(_POUND_FORCE / 0.3048, {"kg": 1}),
    "N": Unit(1.0, _FORCE, "GMkmu"),
    "lbf": Unit(_POUND_FORCE, _FORCE),
    "kip": Unit(1e3 * _POUND_FORCE, _FORCE),
    "daN": Unit(10.0, _FORCE),
    "kgf": Unit(STANDARD_GRAVITY, _FORCE),
    "tf": Unit(1e3 * STANDARD_GRAVITY, _FORCE),
    "Pa": Unit(1.0, {"kg": 1, "m": -1, "s": -2}, "GMk"),
    "bar": Unit(1e5, {"kg": 1, "m": -1, "s": -2}, "m"),
    "psi": Unit(_POUND_FORCE / 0.0254**2, {"kg": 1, "m": -1, "s": -2}),
    "ksi": Unit(1e3 * _POUND_FORCE / 0.0254**2, {"kg": 1, "m": -1, "s": -2}),
    "J": Unit(1.0, {"kg": 1, "m": 2, "s": -2}, "GMkm"),
    "A": Unit(1.0, {"A": 1}, "kmun"),
    "V": Unit(1.0, {"V": 1}, "kmun"),
}
_PREFIXED: Final[Mapping[str, Unit]] = {
    f"{prefix}{name}": Unit(_PREFIXES[prefix] * unit.factor, unit.powers)
    for name, unit in _SYMBOLS.items()
    for prefix in ("", *unit.prefixes)
}

# Words that programs of test rigs write for units, in front of or after a slash.
_WORDS: Final = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s", "msec": "ms", "millisecond": "ms",
    "milliseconds": "ms", "newton": "N", "newtons": "N", "kilonewton": "kN", "kilonewtons": "kN", "meter": "m",
    "meters": "m", "metre": "m", "metres": "m", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm",
    "millimetres": "mm", "inch": "in", "inches": "in", "in.": "in", "volt": "V", "volts": "V", "amp": "A", "amps": "A",
    "ampere": "A", "amperes": "A", "lb": "lbf", "lbs": "lbf", "kips": "kip", "tonne": "t",
    "tonnes": "t", "slugs": "slug",
}  # fmt: skip


def unit_of(text: str, pound: str = "lbf") -> Unit | None:
    """The unit of a text as "kN s/mm", symbols with blanks between and at most one slash; `None` if it is not known.

    `pound`: whether a pound is a force, "lbf", or a mass, "lbm".
    """
    factor, powers = 1.0, Counter[str]()
    for sign, part in zip((1, -1), text.split("/", 1), strict=False):
        symbols = part.split()
        if not symbols:
            return None
        for symbol in symbols:
            power = int(symbol[-1]) if len(symbol) > 1 and symbol[-1] in "234" else 1
            bare = symbol[:-1] if power > 1 else symbol
            word = _WORDS.get(bare.casefold(), bare)
            unit = _PREFIXED.get(pound if bare in ("lb", "lbs") else bare) or _PREFIXED.get(word)
            if unit is None:
                return None
            size = unit.factor**power
            factor = factor * size if sign > 0 else factor / size
            powers.update({base: sign * power * exponent for base, exponent in unit.powers.items()})
    return Unit(factor, {base: exponent for base, exponent in powers.items() if exponent})


_KNOWN: Final[Mapping[MeasuredQuantity, str]] = {
    "time": "s, ms, us, min",
    "frequency": "Hz",
    "rate": "1/s",
    "displacement": "m, cm, mm, um, in, ft",
    "velocity": "m/s, km/h, cm/s, mm/s, in/s, ft/s, mph",
    "acceleration": "m/s2, cm/s2, gal, mm/s2, g, mg, in/s2, ft/s2",
    "mass": "kg, t, Mg, lbm, slug",
    "force": "N, kN, lbf, kip, kgf, tf, MN, daN",
    "stiffness": "N/m, kN/m, MN/m, N/mm, kN/mm, lbf/in, kip/in",
    "damping": "N s/m, kN s/m, MN s/m, lbf s/in, kip s/in",
    "current": "A, mA",
    "voltage": "V, mV",
    "current rate": "A/s",
    "voltage rate": "V/s",
}

FACTORS: Final[Mapping[MeasuredQuantity, Mapping[str, float]]] = MappingProxyType(
    {
        quantity: {name: unit.factor for name in names.split(", ") if (unit := unit_of(name)) is not None}
        for quantity, names in _KNOWN.items()
    }
)
"""Factor to SI of each unit of a quantity that records have; the first is the SI unit."""

# Units of weight, in which masses are given: the mass is the weight over standard gravity.
_OF_WEIGHT: Final = ("lbf", "kip", "kgf", "tf")

# Ratios and angles, which no record has, with the factors of their other units: in products these are no units.
_PURE: Final[Mapping[str, Mapping[str, float]]] = {
    "1": {"1": 1.0, "%": 1e-2},
    "rad": {"rad": 1.0, "deg": math.pi / 180.0},
}
_EVERY: Final = (*FACTORS.values(), *_PURE.values())

_DEGREE: Final = math.pi / 180.0
_FEET: Final = _POUND_FORCE * 0.3048
_ROTARY: Final[Mapping[MeasuredQuantity, Mapping[str, float]]] = {
    "displacement": {
        **dict.fromkeys(("rad", "radian", "radians"), 1.0),
        **dict.fromkeys(("deg", "\N{DEGREE SIGN}", "degree", "degrees", "grad"), _DEGREE),
        **dict.fromkeys(("rev", "revs", "turn", "turns"), 2.0 * math.pi),
    },
    "velocity": {
        "rad/s": 1.0,
        **dict.fromkeys(("deg/s", "\N{DEGREE SIGN}/s"), _DEGREE),
        "rev/s": 2.0 * math.pi,
        **dict.fromkeys(("rpm", "rev/min"), math.pi / 30.0),
    },
    "force": {
        "nm": 1.0, "knm": 1e3, "nmm": 1e-3, "ncm": 1e-2,
        **dict.fromkeys(("lbfft", "lbft", "ftlb", "ftlbf"), _FEET),
        **dict.fromkeys(("lbfin", "lbin", "inlb", "inlbf"), _FEET / 12.0),
    },
}  # fmt: skip
"""Units of an angle, its rate and a torque, in the places of displacement, velocity and force of a rotary damper."""


def rotary_factor(unit: str, quantity: MeasuredQuantity) -> float | None:
    """Factor to rad, rad/s or N m of a unit of a rotary damper, in the place of a quantity; `None` of another."""
    text = "".join(unit.split()).casefold()
    bare = text if quantity != "force" else re.sub("[\N{MIDDLE DOT}*_.-]", "", text)
    return _ROTARY.get(quantity, {}).get(bare)


def factor_of_product(own: str, by: str, other: str, quantity: MeasuredQuantity) -> float | None:
    """Factor to SI of a unit times (`*`) or over (`/`) another, as of bar*cm2, deg*m and Nm/m; `None` if it is none."""
    angle, torque = rotary_factor(own, "displacement"), rotary_factor(own, "force")
    left = unit_of(own)
    if angle is not None:
        left = Unit(angle, {})
    elif torque is not None:
        left = Unit(torque, {"kg": 1, "m": 2, "s": -2})
    right, target = unit_of(other), unit_of(next(iter(FACTORS[quantity])))
    if left is None or right is None or target is None:
        return None
    sign = 1 if by == "*" else -1
    bases = {*left.powers, *right.powers}
    powers = {base: left.powers.get(base, 0) + sign * right.powers.get(base, 0) for base in bases}
    is_it = {base: power for base, power in powers.items() if power} == target.powers
    return left.factor * right.factor**sign if is_it else None


# Quantity and factor of each symbol; in any case, except for mega, which would be milli.
_MEASURED: Final[Mapping[str, tuple[MeasuredQuantity, float]]] = {
    spelling: (quantity, factor)
    for quantity, units in FACTORS.items()
    for symbol, factor in units.items()
    for spelling in {symbol, symbol if symbol.startswith("M") else symbol.casefold()}
}

# The mark of an inch by itself; around a unit it is a quotation mark.
_INCH: Final = re.compile(r"(?:[\"\u2033\u201d]|\u2032\u2032)(?=/|$)")

# Column names cannot hold a slash: mmps, mm_s and mm_per_s are mm/s, cmps2 and cm_s2 are cm/s2, as are cm/sec^2, cm/s/s
# and cm/s**2.
_RATE: Final = re.compile(
    r"(m|cm|mm|in|ft)(?:(?:/|p|_per_|_)s(?:(?:ec)?((?:\^|\*\*|_)?2|/s(?:ec)?|²))?|_?s(-2))", re.ASCII
)

# Between the symbols of a product.
_BETWEEN: Final = re.compile("[-*\N{MIDDLE DOT}.]")

# A letter directly behind a number begins its unit, unless it is the exponent.
_GLUED: Final = re.compile(
    r"([+-]?(?:\d[\d_]*+(?:\.[\d_]*+)?+|\.\d[\d_]*+)(?:e[+-]?\d++)?+)([a-z%].*)",
    re.ASCII | re.IGNORECASE | re.DOTALL,
)


def number_in(text: str, unit: str) -> float | str:
    """A number in SI from a text such as "1 ms", or the reason why it is not one, as the rest of a sentence.

    The text may have any unit of the dimension of `unit`, which may be several with "or" between. A blank between
    number and unit may be left out, but not in front of a unit that begins with a digit, as 1/s.
    """
    glued = _GLUED.fullmatch(text.strip())
    number, symbol = glued.groups() if glued else text.strip().partition(" ")[::2]
    names = ", ".join(name for part in unit.split(" or ") for name in _readable(part))
    try:
        value = float(number)
    except ValueError:
        symbol = ""
    if not symbol:
        example = names.split(", ")[:2][-1]
        return (
            f'is the text {text!r}; give a number [{unit}], or one with its unit in quotes, as "1 {example}"'
        )
    symbol = symbol.strip()
    if symbol in unit.split(" or "):
        return value
    if symbol in _PURE.get(unit, {}):
        return value * _PURE[unit][symbol]
    if {"ton", "tons"} & set(symbol.casefold().split()):
        tons = "short (2000 lb), long (2240 lb) or metric (1000 kg)"
        return f"is {text!r}; a ton may be {tons}, so give another unit: {names}"
    wanted = [target.powers for part in unit.split(" or ") if (target := unit_of(part))]
    read = [unit_of(symbol, pound) for pound in ("lbf", "lbm")]
    if fitting := [entry for entry in read if entry is not None and entry.powers in wanted]:
        return value * fitting[0].factor
    if read[0] is None:
        pure = any(symbol in units for units in _PURE.values())
        which = f"where a number [{unit}] is expected" if pure else "whose unit is not known"
        return f"is {text!r}, {which}; its unit may be {names}"
    if unit == "kg" and _WORDS.get(symbol.casefold(), symbol) in _OF_WEIGHT:
        return value * read[0].factor / STANDARD_GRAVITY
    return f"is {text!r}, where a number [{unit}] is expected; its unit may be {names}"


def _readable(unit: str) -> list[str]:
    """Units that a number in `unit` may have: that one first, usual ones, and every other symbol of the dimension."""
    usual = next((units for units in _EVERY if unit in units), (unit,))
    target = unit_of(unit)
    alike = [name for name, other in _PREFIXED.items() if target and target.powers == other.powers != {}]
    weights = ["lb", *_OF_WEIGHT] if unit == "kg" else ["lb"] if unit == "N" else []
    return list(dict.fromkeys([*usual, *alike, *weights]))


_UNUSUAL: Final = RemarkKind(
    "number_unusual", "{0}{1} is {value:.4g}{unit}, and {least:g} to {most:g}{unit} is usual", "{cure}"
)


def unusual_number(
    name: str,
    value: float,
    usual: tuple[float, float],
    unit: str = "1",
    *,
    where: str = "",
    room: float = 1.0,
) -> Iterator[Remark]:
    """Warn of a number in SI outside of what is usual, with the unit in which it would be within.

    `room` is a factor by which the number may be beyond the usual, as one whose unit is stated.
    """
    least, most = usual
    if least / room <= value <= most * room:
        return
    symbol = unit.split(" or ")[0]
    units = next((group for group in _EVERY if symbol in group), {})
    meant = [other for other, factor in units.items() if least <= value * factor <= most]
    # Thousandfold units first, as mm for m.
    meant.sort(key=lambda other: math.log10(units[other]) % 3.0 != 0.0)
    shown = "" if symbol in ("", "1") else f" {symbol}"
    cure = f'write "{value:g} {meant[0]}" if that is meant' if meant else "check it and its unit"
    measured = Measured(value, symbol)
    yield _UNUSUAL.remark(where, name, measured=measured, unit=shown, least=least, most=most, cure=cure)


def factor_of(unit: str, quantity: MeasuredQuantity) -> float | None:
    """Factor to SI of a unit in any case and common spelling; `None` where it is no unit of the quantity."""
    measurand, factor = _measured(unit)
    return factor if measurand == quantity else None


def quantity_of(unit: str) -> MeasuredQuantity | None:
    """Quantity that a unit measures, `None` for an unknown unit."""
    return _measured(unit)[0]


def _measured(unit: str) -> tuple[MeasuredQuantity | None, float]:
    """Quantity and factor of a unit as it is written, or else without its case and spelling."""
    text = unit.strip()
    symbol = _INCH.sub("in", text, count=1) if _INCH.match(text) else text.strip("'\"")
    text = symbol.replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u").casefold()
    text = "/".join(_WORDS.get(part, part) for part in text.split("/")).casefold()
    if match := _RATE.fullmatch(text):
        text = f"{match[1]}/s{'2' if match[2] or match[3] else ''}"
    return _MEASURED.get(symbol) or _MEASURED.get(text) or _mass_of(symbol) or (None, 0.0)


def _mass_of(symbol: str) -> tuple[MeasuredQuantity, float] | None:
    """A mass that is a force over an acceleration, as frame programs write it: kN-s²/m, lb-s2/in."""
    if "s" not in symbol or "/" not in symbol:
        return None
    unit = unit_of(_BETWEEN.sub(" ", symbol).replace("²", "2").replace("^2", "2"))
    return ("mass", unit.factor) if unit is not None and unit.powers == {"kg": 1} else None


def spelt_command_unit(unit: str) -> CommandUnit | None:
    """The unit of a command that is neither a current nor a voltage, in any case and common spelling; else `None`."""
    return _COMMAND_SPELLINGS.get(" ".join(unit.split()).casefold())


def factor_to_si(unit: str, quantity: MeasuredQuantity, *, context: str) -> float:
    """Factor by which values in `unit`, as in `factor_of`, are multiplied to be in SI.

    `context` is the start of the error's sentence: the file and column, or the option.
    """
    other, factor = _measured(unit)
    if other == quantity:
        return factor
    says = f"is no unit of {quantity}" if other is None else f"is a unit of {other}, no unit of {quantity}"
    raise UnitError(f"{context}: '{unit}' {says}; give one of {', '.join(FACTORS[quantity])}")
