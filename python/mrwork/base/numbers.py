"""Numbers as text: significant digits, thousands, powers of ten, alignment at the decimal point, shares and counts.

The last three write the plain numbers of a terminal, with a hyphen where there is none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence

MINUS = "\N{MINUS SIGN}"
_THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"
NOTHING = "\N{EN DASH}"
"""Text of a number that is not known."""

_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_POWER = re.compile(" × 10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)")
_PLAIN_SIGNS = str.maketrans({MINUS: "-", NOTHING: "-", _THIN_SPACE: None})

# Numbers between these powers of ten are written without a power of ten.
_PLAIN = (-6, 7)
_DIGITS_OF_ERROR = 2
_MOST_DIGITS = 8
# An error below this share of its value is of arithmetic, and none of an estimate.
_ROUNDING = 1e-7
# A ratio above is far, and its digits say nothing.
_FAR = 1000.0


def format_fixed(value: float | None, decimals: int) -> str:
    """A number with fixed decimals and separated thousands; a dash for a missing one, a sign for infinity."""
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    text = f"{value:,.{decimals}f}"
    if float(text.replace(",", "")) == 0:
        text = text.lstrip("-")
    # A group of three is set apart from five digits on: 1234 but 12 345.
    grouped = text.replace(",", _THIN_SPACE) if abs(value) >= 1e4 else text.replace(",", "")
    return grouped.replace("-", MINUS)


def significant(value: float | None, digits: int) -> str:
    """A number to `digits` significant digits, with a power of ten where it is very large or small."""
    if value is None or not math.isfinite(value) or value == 0:
        return format_fixed(value, 0)
    exponent = leading_exponent(value, digits)
    if _PLAIN[0] < exponent < _PLAIN[1]:
        return format_fixed(round(value, digits - 1 - exponent), max(digits - 1 - exponent, 0))
    mantissa = float(f"{value:.{digits - 1}e}".partition("e")[0])
    return format_fixed(mantissa, digits - 1) + power_of_ten(exponent)


def shortest(value: float, digits: int = 4) -> str:
    """A number without trailing zeros, for bounds and settings."""
    text = significant(value, digits)
    if "." not in text:
        return text
    head, times, power = text.partition(" × ")
    return head.rstrip("0").rstrip(".") + times + power


def value_and_error(value: float, error: float | None) -> tuple[str, str]:
    """An estimate and its standard error: the error to two digits, the value to the same decimal, both of one power.

    The value keeps a digit where the error is far larger; where both have too many digits, each is written on its own.
    There is no error where it is rounding of the value.
    """
    if (
        error is None
        or not math.isfinite(error)
        or error <= _ROUNDING * abs(value)
        or not math.isfinite(value)
    ):
        return shortest(value, 5), NOTHING
    of_error = leading_exponent(error, _DIGITS_OF_ERROR) - _DIGITS_OF_ERROR + 1
    finest = min(of_error, leading_exponent(value, 1)) if value else of_error
    digits = math.floor(math.log10(abs(value))) - finest + 1 if value else 1
    leading = leading_exponent(value, max(digits, 1)) if value else of_error
    if max(leading, of_error) - finest >= _MOST_DIGITS:
        return significant(value, min(max(digits, 1), _MOST_DIGITS)), significant(error, _DIGITS_OF_ERROR)
    power = 0 if _PLAIN[0] < leading < _PLAIN[1] else leading
    texts = [
        format_fixed(round(number, -decimal) / 10.0**power, max(power - decimal, 0)) + power_of_ten(power)
        for number, decimal in ((value, finest), (error, of_error))
    ]
    return texts[0], texts[1]


def in_plain(text: str) -> str:
    """Text whose numbers are in the characters of every terminal, as -1.2e-09."""
    return _POWER.sub(lambda power: f"e{int(power[1].translate(_DIGITS)):+03d}", text).translate(_PLAIN_SIGNS)


def leading_exponent(value: float, digits: int) -> int:
    """Power of ten of the first digit after rounding to `digits`: 9.996 to three digits is 10.0."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def decimals_of(values: Sequence[float], digits: int) -> int:
    """Decimals of a column of numbers: enough for `digits` significant digits of its smallest entry."""
    sizes = [leading_exponent(value, digits) for value in values if math.isfinite(value) and value != 0]
    return min(max(digits - 1 - min(sizes, default=0), 0), 6)


def counted(count: int, noun: str) -> str:
    """A number of things, as "1 motion" or "2 motions"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def times(ratio: float) -> str:
    """How many times one number is another, as "12 times"; "more than 1000 times" where the digits say nothing."""
    return f"{ratio:.2g} times" if ratio <= _FAR else f"more than {_FAR:.0f} times"


def percent(share: float, decimals: int = 1) -> str:
    """A share in per cent as text, without the sign: 0.5 as "50.0"."""
    return format_fixed(100.0 * share, decimals)


def least_to_most(values: Iterable[float], shown: Callable[[float], str] | None = None) -> str:
    """The least and the most of numbers, to three digits or as `shown`; once where both look alike."""
    ends, show = sorted(values), shown or (lambda value: significant(value, 3))
    return " to ".join(dict.fromkeys((show(ends[0]), show(ends[-1]))))


def power_of_ten(power: int) -> str:
    """Power of ten behind a formatted number, in superscripts; empty for the power 0."""
    return f" × 10{str(power).translate(_SUPERSCRIPTS)}" if power else ""


def format_rounded(value: float | None, digits: int = 4) -> str:
    """A number with `digits` significant digits; a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}g}"


def round_to(value: float, digits: int = 4) -> float:
    """The nearest number of `digits` significant digits; a study file states four of a setting."""
    return float(f"{value:.{digits}g}")


def apart(shown: Callable[[float, int], str], one: float, other: float, digits: int) -> tuple[str, str]:
    """Texts of two numbers with as many digits or decimals as tell them apart, at least `digits`."""
    texts = shown(one, digits), shown(other, digits)
    if texts[0] == texts[1] and one != other and digits < 17:
        return apart(shown, one, other, digits + 1)
    return texts


def with_decimals(value: float, decimals: int) -> str:
    """A number with `decimals` decimals; a dash where it is not known."""
    return "-" if math.isnan(value) else f"{value:.{decimals}f}"


def of_unit(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with its unit, of which "1" is left out; a dash where there is no number."""
    return f"{format_rounded(value, digits)} {unit if unit != '1' else ''}".rstrip()


def in_newtons(force: float, digits: int = 6) -> str:
    """A force [N] with a prefix of its unit, as "4.448 kN"."""
    for unit, factor in (("MN", 1e6), ("kN", 1e3)):
        if force >= factor:
            return of_unit(force / factor, unit, digits)
    return of_unit(force, "N", digits)


def format_rate(rate: float) -> str:
    """Three digits, as in 950, 1.25k, 3.10M."""
    for unit in ("", "k", "M"):
        if rate < 1000.0:
            return f"{rate:.3g}{unit}"
        rate /= 1000.0
    return f"{rate:.3g}G"


def duration_in_words(seconds: float) -> str:
    """A time in seconds, minutes or hours, as in "3 min"."""
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    if seconds < 3600.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
