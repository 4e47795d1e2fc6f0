"""Times of the day in text tables, alone or with their dates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import Final

import numpy as np

from mrwork.base.values import Floats

# 2024-05-01 12:00:00.010, with T, / or a zone; 01.05.2024 12:00:00; 12:00:00,010.
_STAMP: Final = re.compile(
    r"(?:(?:(?P<year>[0-9]{4})([-/])(?P<month>[0-9]{1,2})\2(?P<day>[0-9]{1,2})"
    r"|(?P<day_first>[0-9]{1,2})\.(?P<month_then>[0-9]{1,2})\.(?P<year_last>[0-9]{4}))(?:[T ]\s*|$))?"
    r"(?:(?P<hour>[0-9]{1,4}):(?P<minute>[0-5][0-9]):(?P<second>[0-5][0-9]|60)(?:[.,](?P<fraction>[0-9]{1,9}))?"
    r"\s*(?P<zone>Z|[+-][0-9]{2}:?[0-9]{2})?)?"
)
LONGEST: Final = 60
"""Characters of a stamp."""
_DAY: Final = 86_400 * 10**9
_HOUR: Final = 3600 * 10**9


def stamps_of(names: Sequence[str], row: Sequence[str]) -> frozenset[str]:
    """The columns that have times of the day, by themselves or with dates, of which the first row is given."""
    pairs = zip(names, row, strict=False)
    return frozenset(name for name, text in pairs if ":" in text and nanoseconds(text) is not None)


def nanoseconds(text: str) -> int | None:
    """Time of a stamp [ns], since the year 1 if it has a date, which alone is its midnight; `None` of another text."""
    match = _STAMP.fullmatch(text.strip()) if 0 < len(text) <= LONGEST else None
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
        return time + date(int(year), int(month), int(day)).toordinal() * _DAY
    except ValueError:
        return None


def seconds_since_first(times: Sequence[int | None], *, with_dates: bool) -> Floats:
    """Seconds since the first of times [ns], NaN where one is missing; without dates, a new day begins at midnight."""
    seconds = np.full(len(times), np.nan)
    known = [row for row, time in enumerate(times) if time is not None]
    first = next((time for time in times if time is not None), 0)
    clock = np.array([time - first for time in times if time is not None], dtype=np.int64)
    days = np.cumsum(np.diff(clock, prepend=clock[:1]) < -12 * _HOUR) * (not with_dates)
    seconds[known] = (clock + days * _DAY) * 1e-9
    return seconds


def has_date(text: str) -> bool:
    """Whether a stamp has a date."""
    match = _STAMP.fullmatch(text.strip())
    return match is not None and (match["year"] or match["year_last"]) is not None
