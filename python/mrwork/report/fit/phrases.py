"""Words that several sections share."""

from __future__ import annotations

import math

from mrwork.report import numbers

_LEAST = 0.001


def probability(value: float) -> str:
    """A probability as it is printed: two decimals, more where it is small, none below a thousandth."""
    if math.isnan(value):
        return numbers.fixed(value, 0)
    return f"< {_LEAST:g}" if value < _LEAST else numbers.fixed(value, 3 if value < 0.1 else 2)


def tests_of(count: int, total: int) -> str:
    """As in "this test", "all 6 tests", "2 of 6 tests"."""
    if total == 1:
        return "this test"
    return f"all {total} tests" if count == total else f"{count} of {total} tests"


def most_of(share: float) -> str:
    """A share in whole per cent, but never all of it where something is missing."""
    return "more than 99" if 0.99 < share < 1.0 else numbers.fixed(100.0 * share, 0)


def percent(share: float, decimals: int = 1) -> str:
    """A share as a number of percent."""
    return numbers.fixed(100.0 * share, decimals)
