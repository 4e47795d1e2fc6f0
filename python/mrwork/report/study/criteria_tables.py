"""Tables of criteria of every row, and their ratios to the building without dampers and to i = 0."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from mrwork.closed_loop.evaluation import criterion
from mrwork.report.numbers import fixed, significant
from mrwork.report.section import Table
from mrwork.study.comparison import RANKS, StudyComparison, judged_in_words
from mrwork.study.results import StudyCriteria, StudyResults
from mrwork.study.study import Kind

# Criterion, its name in a narrow column, displayed unit, and factor to that unit.
_MILLIMETRE, _KILONEWTON = ("mm", 1e3), ("kN", 1e-3)
_ACCELERATION = ("m/s²", 1.0)
_VALUES = (
    ("peak_drift", "Drift", *_MILLIMETRE),
    ("peak_acceleration", "Acceleration", *_ACCELERATION),
    ("peak_base_shear", "Base shear", *_KILONEWTON),
    ("rms_drift", "RMS drift", *_MILLIMETRE),
    ("rms_acceleration", "RMS acc.", *_ACCELERATION),
    ("peak_force", "Force", *_KILONEWTON),
    ("peak_stroke", "Stroke", *_MILLIMETRE),
    ("rms_current", "RMS", "", 1.0),
)
_RATIOS = ("peak_drift", "peak_acceleration", "peak_base_shear", "rms_drift", "rms_acceleration")
_AGAINST: tuple[Kind, ...] = ("uncontrolled", "passive_off")
_DECIMALS = 3


def overview_table(comparison: StudyComparison, shown: Collection[int]) -> Table:
    """The score, and the mean of each ratio over the motions, the rows of each rank together."""
    results = comparison.results
    ranks = [
        (rank, found) for rank, rows in comparison.ranks if (found := [row for row in rows if row in shown])
    ]
    order = [row for _, rows in ranks for row in rows]
    columns = [[results.score(row) for row in order], *_ratio_columns(results, order, results.judged)]
    return _ratio_table(
        results,
        order,
        columns,
        label=f"Score and mean ratios over {judged_in_words(results)}",
        first=("Score",),
        headings={order.index(rows[0]): rank.title for rank, rows in ranks},
        note="The score is our own: the mean over the motions of peak and RMS drift and acceleration, each over "
        "its value with the dampers without a command. A low score may hide a quantity that became worse: see the "
        "changes. Ratios are means over the motions. Control laws, passive dampers and other devices are ranked apart, "
        "and the best of each column is bold in each."
        + "".join(f" {rank.note}" for rank, _ in ranks if rank.note),
    )


def ratio_table(results: StudyResults, motion: int, rows: Sequence[int]) -> Table:
    """The ratios under one motion."""
    columns = _ratio_columns(results, rows, (motion,))
    return _ratio_table(
        results, rows, columns, label=f"Ratios under {results.motions[motion].name}", first=(), note=""
    )


def _ratio_columns(results: StudyCriteria, rows: Sequence[int], motions: Sequence[int]) -> list[list[float]]:
    """A column for each reference and ratio: its mean over the motions for each row."""
    columns: list[list[float]] = []
    for against in _AGAINST:
        found = [[results.ratios(row, motion, against) for motion in motions] for row in rows]
        columns += [[float(np.mean([each[name] for each in of_row])) for of_row in found] for name in _RATIOS]
    return columns


def value_table(results: StudyResults, motions: Sequence[int], rows: Sequence[int]) -> Table:
    """The criteria themselves under one motion, or their medians over several."""
    unit = results.command_unit
    several, under = len(motions) > 1, results.motions[motions[0]].name
    cells: list[tuple[str, ...]] = []
    columns: list[list[float]] = []
    found = [[_values(results, row, motion) for motion in motions] for row in rows]
    for name, _, _, factor in _VALUES:
        numbers = [factor * float(np.median([each[name] for each in of_row])) for of_row in found]
        columns.append(numbers)
        cells.append(tuple(significant(number, 3) for number in numbers))
    drive = f"RMS {'current' if unit == 'A' else 'voltage'} ({unit})"
    heads = tuple(f"{head} ({shown})" if shown else drive for _, head, shown, _ in _VALUES)
    return Table(
        label=f"Criteria{f', median of {len(motions)} motions' if several else f' under {under}'}",
        columns=("", *heads),
        rows=tuple(
            (results.rows[row].label, *(column[place] for column in cells)) for place, row in enumerate(rows)
        ),
        strong=_best(results, rows, columns[:5]),
        note="Peaks unless stated otherwise, of the worst floor, storey or damper. The best control law and the best "
        "passive damper of each column are bold.",
    )


def _values(results: StudyResults, row: int, motion: int) -> dict[str, float]:
    """The criteria; NaN if the run did not finish, or has nothing of a quantity: no dampers, no stroke."""
    found = results.criteria(row, motion)
    if found is None:
        return {name: math.nan for name, *_ in _VALUES}
    run = results.runs[row, motion]
    return {
        name: found[name] if np.size(getattr(run, criterion(name).quantity)) else math.nan
        for name, *_ in _VALUES
    }


def _ratio_table(
    results: StudyCriteria,
    rows: Sequence[int],
    columns: Sequence[Sequence[float]],
    *,
    label: str,
    first: tuple[str, ...],
    note: str,
    headings: Mapping[int, str] = MappingProxyType({}),
) -> Table:
    cells = [[fixed(number, _DECIMALS) for number in column] for column in columns]
    return Table(
        label=label,
        columns=("", *first, *(criterion(name).short for _ in _AGAINST for name in _RATIOS)),
        rows=tuple(
            (results.rows[row].label, *(column[place] for column in cells)) for place, row in enumerate(rows)
        ),
        over=(("", 1 + len(first)), *((_over(results, against), len(_RATIOS)) for against in _AGAINST)),
        strong=_best(results, rows, columns),
        headings=headings,
        note=note,
    )


def _over(results: StudyCriteria, against: Kind) -> str:
    """Heading of the ratios to a reference."""
    reference = results.row_of(against)
    if against == "uncontrolled" or reference is None:
        return "over no dampers" if against == "uncontrolled" else "over i = 0"
    return f"over {results.rows[reference].label}"


def _best(
    results: StudyCriteria, rows: Sequence[int], columns: Sequence[Sequence[float]]
) -> frozenset[tuple[int, int]]:
    """Cells with the smallest printed number of each column, among the rows of each rank; none of a rank of one."""
    strong = set()
    for rank in RANKS:
        candidates = [place for place, row in enumerate(rows) if results.rows[row].kind in rank.kinds]
        for cell, column in enumerate(columns, start=1):
            known = [column[place] for place in candidates if not math.isnan(column[place])]
            if len(known) > 1:
                least = significant(min(known), 3)
                strong |= {(place, cell) for place in candidates if significant(column[place], 3) == least}
    return frozenset(strong)
