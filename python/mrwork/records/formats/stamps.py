"""Times of the day and dates with them, as columns of times: seconds since the first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

# 2024-05-01 12:00:00.010, with T, / or a zone; 01.05.2024 12:00:00; 12:00:00,010.
_STAMP: Final = re.compile(
    r"(?:(?:(?P<year>[0-9]{4})([-/])(?P<month>[0-9]{1,2})\2(?P<day>[0-9]{1,2})"
    r"|(?P<day_first>[0-9]{1,2})\.(?P<month_then>[0-9]{1,2})\.(?P<year_last>[0-9]{4}))(?:[T ]\s*|$))?"
    r"(?:(?P<hour>[0-9]{1,4}):(?P<minute>[0-5][0-9]):(?P<second>[0-5][0-9]|60)(?:[.,](?P<fraction>[0-9]{1,9}))?"
    r"\s*(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?)?"
)
_LONGEST: Final = 60
_DAY: Final = 86_400 * 10**9
_HOUR: Final = 3600 * 10**9


def is_stamp(text: str) -> bool:
    """Whether a cell is a time of the day, by itself or with its date."""
    return ":" in text and nanoseconds(text) is not None


def stamps_of(names: Sequence[str], row: Sequence[str]) -> frozenset[str]:
    """The columns that have times of the day, of which the first row is given."""
    return frozenset(name for name, text in zip(names, row, strict=False) if is_stamp(text))


def nanoseconds(text: str) -> int | None:
    """Time of a stamp [ns], of one with a date since 1970; `None` of another text.

    A date by itself is its midnight, as spreadsheets write that.
    """
    match = _STAMP.fullmatch(text.strip()) if 0 < len(text) <= _LONGEST else None
    if match is None or not match[0]:
        return None
    clock = 3600 * int(match["hour"] or 0) + 60 * int(match["minute"] or 0) + int(match["second"] or 0)
    time = clock * 10**9 + int((match["fraction"] or "").ljust(9, "0"))
    if match["zone"] not in (None, "Z"):
        sign, digits = match["zone"][0], match["zone"][1:].replace(":", "")
        offset = 60 * int(digits[:2]) + int(digits[2:])
        time -= (offset if sign == "+" else -offset) * 60 * 10**9
    year = match["year"] or match["year_last"]
    if year is None:
        return time
    month, day = match["month"] or match["month_then"], match["day"] or match["day_first"]
    try:
        days = np.datetime64(f"{year}-{int(month):02d}-{int(day):02d}", "D").astype(np.int64)
    except ValueError:
        return None
    return int(days) * _DAY + time


def seconds_since_first(times: Sequence[int | None], *, with_dates: bool) -> NDArray[np.float64]:
    """Seconds since the first of times [ns], NaN where one is missing; without dates, a new day begins at midnight."""
    found = np.full(len(times), np.nan)
    first: int | None = None
    last, days = 0, 0
    for row, time in enumerate(times):
        if time is None:
            continue
        if first is None:
            first = last = time
        elif not with_dates and time < last - 12 * _HOUR:
            days += 1
        last = time
        found[row] = (time + days * _DAY - first) * 1e-9
    return found


def has_date(text: str) -> bool:
    """Whether a stamp has a date."""
    match = _STAMP.fullmatch(text.strip())
    return match is not None and (match["year"] or match["year_last"]) is not None
