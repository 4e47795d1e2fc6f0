"""Nominal amplitude, frequency and command from file names such as 25mm0x25Hz_0.75A."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

_NUMBER: Final = r"\d+(?:[x.]\d+)?"
_NAME: Final = re.compile(
    rf"(?P<amplitude>{_NUMBER})mm_?(?P<frequency>{_NUMBER})Hz"
    rf"(?:_?(?P<command>{_NUMBER})(?P<unit>[AV]))?(?![A-Za-z\d])",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """What a file name says: amplitude [m], frequency [Hz], current [A], voltage [V]; `None` where silent."""

    amplitude: float | None = None
    frequency: float | None = None
    current: float | None = None
    voltage: float | None = None


def nominal_from_name(stem: str) -> Nominal:
    """Read amplitude, frequency and command from a file name without its extension.

    The decimal point may be written ``x``; underscores between the parts and a prefix are allowed, and
    the command may be missing or in volts.

    Examples
    --------
    >>> nominal_from_name("unfiltered_25mm0x25Hz_0.75A").frequency
    0.25
    """
    match = _NAME.search(stem)
    if match is None:
        return Nominal()
    command = None if match["command"] is None else _value(match["command"])
    in_volts = (match["unit"] or "").upper() == "V"
    return Nominal(
        # Divided, not multiplied: 5 / 1000 is the double nearest to 0.005.
        amplitude=_value(match["amplitude"]) / 1000.0,
        frequency=_value(match["frequency"]),
        current=None if in_volts else command,
        voltage=command if in_volts else None,
    )


def _value(text: str) -> float:
    return float(text.replace("x", ".").replace("X", "."))
