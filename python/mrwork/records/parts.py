"""Parts of a file that are tests of their own: sweeps whose time restarts, bursts between gaps, columns side by side.

`FILE#2` is the second part of a file, in the order of the file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mrwork.base.values import Floats
from mrwork.errors import MrworkError, RecordError
from mrwork.files.grid import grid
from mrwork.files.named_columns import ColumnTable
from mrwork.records.columns import Headings, tells_a_test
from mrwork.records.window import FEWEST_SAMPLES, MOST_IN_GAPS


def spans_of(time: Floats) -> list[slice]:
    """Rows of each sweep, which ends where the time falls, or without sweeps of each burst, which ends in a gap."""
    rows = np.flatnonzero(np.isfinite(time))
    ends = rows[1:][np.diff(time[rows]) < 0.0]
    if not ends.size and rows.size > 1:
        ends = rows[1 + grid(time[rows]).gaps]
    spans = [slice(first, last) for first, last in pairwise((0, *ends.tolist(), time.size))]
    return [span for span in spans if span.stop - span.start >= FEWEST_SAMPLES]


def sides_of(headings: Sequence[str], names: Sequence[str]) -> list[tuple[str, ...]]:
    """Names of the columns of tests side by side, whose headings are equal; other columns are of all of them.

    A single heading that is there twice is of two sensors.
    """
    counts = Counter(filter(None, headings))
    count = max(counts.values(), default=0)
    if list(counts.values()).count(count) < 2:
        return []
    sides: list[list[str]] = [[] for _ in range(count)]
    seen = Counter[str]()
    for heading, name in zip(headings, names, strict=True):
        seen[heading] += 1
        is_of_all = headings.count(heading) < count
        for side in sides if is_of_all else sides[seen[heading] - 1 : seen[heading]]:
            side.append(name)
    return [tuple(side) for side in sides] if count > 1 else []


def side_of(table: ColumnTable, headings: Headings, part: int) -> tuple[Headings, bool]:
    """The headings of a part, and whether it is one of several tests side by side."""
    sides = _tests_side_by_side(table)
    if not sides or not part:
        return headings, False
    _check(part, len(sides), headings.source)
    return replace(headings, names=sides[part - 1]), True


def _tests_side_by_side(table: ColumnTable) -> list[tuple[str, ...]]:
    sides = sides_of(table.headings or table.names, table.names)
    return sides if all(tells_a_test(table, side) for side in sides) else []


def span_of(time: Floats, part: int, source: str) -> slice:
    """The rows of a part."""
    spans = spans_of(time)
    _check(part, len(spans), source)
    return spans[part - 1]


def _check(part: int, count: int, source: str) -> None:
    if not 1 <= part <= count:
        known = f"give one of {source}#1 to {source}#{count}" if count > 1 else f"give {source} alone"
        raise RecordError(
            f"{source}: has no part {part}, of sweeps, bursts or tests side by side there are {count}; {known}"
        )


def count_parts(table: ColumnTable) -> int:
    """Number of tests in a file that are not one; 1 where that cannot be told."""
    if sides := _tests_side_by_side(table):
        return len(sides)
    try:
        chosen = Headings.of(table).guess()[0].get("time")
        time = None if chosen is None else table.numbers(chosen.column)
    except MrworkError:
        return 1
    if time is None:
        return 1
    present = time[np.isfinite(time)]
    # A test with a gap is one.
    is_one = present.size < 2 or (
        np.all(np.diff(present) >= 0.0) and grid(present).share_in_gaps <= MOST_IN_GAPS
    )
    return 1 if is_one else max(len(spans_of(time)), 1)
