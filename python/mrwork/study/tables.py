"""Tables of a study's page: which rows it shows, their criteria and ratios.

Tables and figures of hundreds of rows cannot be read, and take minutes to draw; `criteria.csv` and `runs.nc` have
every row.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import astuple, dataclass

import numpy as np

from mrwork.base.numbers import NOTHING, format_fixed, significant
from mrwork.base.table import Table
from mrwork.closed_loop.evaluation import SCORE, criterion
from mrwork.closed_loop.responses import in_command_unit, quantity_named
from mrwork.study.comparison import (
    BOTH,
    StudyComparison,
    best_cells,
    chosen_in_words,
    judged_in_words,
    motion_groups,
    rank_headings,
    times_better,
)
from mrwork.study.results import (
    BAND,
    ON_OFF,
    RealisationBand,
    StudyResults,
    largest_step_changes,
    ratio_band,
    score_band,
)

MOST_LISTED = 60
"""Most rows of a table."""

MOST_DRAWN = 24
"""Most rows of a figure, as many as there are lines that can be told apart, and most rows with histories."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownRows:
    """Indices of the rows in tables, in figures, and in histories, each in the order of the study.

    `in_words` says which rows these are, empty where all rows are shown.
    """

    listed: tuple[int, ...]
    drawn: tuple[int, ...]
    with_histories: tuple[int, ...]
    in_words: str


def shown_rows(comparison: StudyComparison, chosen: Collection[int]) -> ShownRows:
    """The rows that a page shows; of the histories, those among the `chosen` ones."""
    total = len(comparison.results.rows)
    listed, drawn = (_best_rows(comparison, range(total), most) for most in (MOST_LISTED, MOST_DRAWN))
    with_histories = _best_rows(comparison, chosen, MOST_DRAWN)
    sentences = []
    if len(listed) < total:
        sentences.append(f"tables show {len(listed)} of {total} arrangements, and mark the best of these")
    if len(drawn) < total:
        sentences.append(f"figures show {len(drawn)} of {total}")
    if len(with_histories) < len(chosen):
        sentences.append(f"histories are drawn of {len(with_histories)} of {len(chosen)}")
    text = ", ".join(sentences)
    return ShownRows(
        listed=listed,
        drawn=drawn,
        with_histories=with_histories,
        in_words=""
        if not text
        else f"{text[:1].upper()}{text[1:]}: the references, the best of each kind, and then the lowest scores, "
        "control laws first. All numbers are in `criteria.csv` and `runs.nc`; `controllers` of `[report]` chooses "
        "other histories.",
    )


def _best_rows(comparison: StudyComparison, among: Collection[int], most: int) -> tuple[int, ...]:
    """Rows to show: all if few, else the references, the best of each rank, and further rows by rank."""
    if len(among) <= most:
        return tuple(among)
    rows = set(among)
    off = comparison.results.row_of("passive_off")
    order = dict.fromkeys(
        [
            *comparison.references,
            *([] if off is None else [off]),
            *(ranked[0] for _, ranked in comparison.ranks),
            *(row for _, ranked in comparison.ranks for row in ranked),
        ]
    )
    return tuple(sorted([row for row in order if row in rows][:most]))


# Criterion, displayed unit, and factor to that unit.
_MILLIMETRE, _KILONEWTON = ("mm", 1e3), ("kN", 1e-3)
_ACCELERATION = ("m/s²", 1.0)
_VALUES = (
    ("peak_drift", *_MILLIMETRE), ("peak_drift_ratio", "%", 100.0), ("peak_ductility", "1", 1.0),
    ("stability_coefficient", "1", 1.0), ("residual_drift_ratio", "%", 100.0),
    ("peak_acceleration", *_ACCELERATION), ("peak_base_shear", *_KILONEWTON), ("rms_drift", *_MILLIMETRE),
    ("rms_acceleration", *_ACCELERATION), ("peak_force", *_KILONEWTON), ("peak_stroke", *_MILLIMETRE),
    ("rms_current", "", 1.0), ("command_travel", "", 1.0), ("switching_rate", "1/s", 1.0),
)  # fmt: skip
# What is not worth a column where no storey yields.
_OF_YIELD = ("residual_drift_ratio",)


def value_table(results: StudyResults, motions: Sequence[int], rows: Sequence[int]) -> Table:
    """The criteria themselves under one motion, or their medians over several."""
    unit = results.command_unit
    several, under = len(motions) > 1, results.motions[motions[0]].name
    by_row = [[_values(results, row, motion) for motion in motions] for row in rows]
    known = {name for of_row in by_row for of_run in of_row for name in of_run}
    values = [each for each in _VALUES if each[0] in known or not criterion(each[0]).optional]
    columns = [
        [factor * float(np.median([each.get(name, math.nan) for each in of_row])) for of_row in by_row]
        for name, _, factor in values
    ]
    heads = tuple(
        f"{criterion(name).short} ({shown or in_command_unit(criterion(name).unit, unit)})".removesuffix(
            " (1)"
        )
        for name, shown, _ in values
    )
    of_building = [quantity_named(criterion(name).quantity).axis != "device" for name, *_ in values].index(
        False
    )
    return Table(
        label=f"Criteria{f', median of {len(motions)} motions' if several else f' under {under}'}",
        columns=("", *heads),
        rows=tuple(
            (results.rows[row].label, *(significant(column[place], 3) for column in columns))
            for place, row in enumerate(rows)
        ),
        strong=best_cells(results, rows, columns[:of_building]),
        note="Peaks unless stated otherwise, of the worst floor, storey or damper. The best control law and the best "
        "passive damper of each column are bold. Travel is the total variation of the command per second; a switching "
        "is a change of more than 10 % of the largest command, until the command turns back by as much.",
    )


def _values(results: StudyResults, row: int, motion: int) -> dict[str, float]:
    """The known criteria; none if the run did not finish, nor of a quantity that it has not: no dampers, no stroke."""
    criteria, run = results.criteria(row, motion) or {}, results.quantities.at(row, motion)
    return {
        name: criteria[name]
        for name, *_ in _VALUES
        if name in criteria
        and not np.isnan(run[criterion(name).quantity]).all()
        and (name not in _OF_YIELD or "peak_ductility" in criteria)
    }


def bands_of_study(results: StudyResults, rows: Sequence[int]) -> Table:
    """Bands of the score and of its ratios to i = 0 over the realisations of a study."""
    off = results.row_of("passive_off")
    bands = [
        (score_band(results, row), *(ratio_band(results, row, off, name) for name in SCORE)) for row in rows
    ]
    return Table(
        label="Bands over realisations",
        columns=("", "Score", *(criterion(name).short for name in SCORE)),
        rows=tuple((results.rows[row].label, *map(_band, own)) for row, own in zip(rows, bands, strict=True)),
        note=f"Median, and the ends between which {100.0 * BAND:.0f} % of the {results.n_realisations} realisations "
        "lie; each number is a mean over the motions, over i = 0 in the same realisation. All rows have the same "
        "realisations; the laws are those of the nominal study.",
    )


def step_table(results: StudyResults, rows: Collection[int]) -> Table:
    """The largest change of a criterion of each row with half the step."""
    return Table(
        label="Largest change of a criterion with half the step",
        columns=("", "Largest change", "Criterion, motion"),
        rows=tuple(
            (
                results.rows[each.row].label,
                significant(each.change if each.criterion else None, 2),
                each.in_words(results),
            )
            for each in largest_step_changes(results)
            if each.row in rows
        ),
        words=(2,),
        note=f"Every run was repeated with half its integration step; changes are relative to the value. {ON_OFF}",
    )


def spread_table(comparison: StudyComparison, rows: Sequence[int]) -> Table:
    """The score of rows, its spread over single motions, and how often each is better than the best passive damper.

    Of a single motion the score alone.
    """
    results, passive = comparison.results, comparison.passive
    if len(results.judged_motions) < 2:
        return Table(
            label="Score",
            columns=("", "Score"),
            rows=tuple((results.rows[row].label, format_fixed(results.score(row), 3)) for row in rows),
            headings=rank_headings(comparison, rows),
        )
    spreads = {row: results.spread(row) for row in rows}

    def better(row: int, names: Sequence[str]) -> str:
        if passive is None or row == passive:
            return NOTHING
        return format_fixed(times_better(results, row, passive, names), 0)

    cells = tuple(
        (
            results.rows[row].label,
            # All but the number of motions.
            *(format_fixed(number, 3) for number in astuple(spreads[row])[1:]),
            *(better(row, names) for names in (BOTH[:1], BOTH[1:], BOTH)),
        )
        for row in rows
    )
    constant = "the best passive damper" if passive is None else results.rows[passive].label
    return Table(
        label="Spread of the score over the motions",
        columns=("", "Mean", "Least", "25 %", "Median", "75 %", "Most", "Drift", "Acc.", "Both"),
        rows=cells,
        over=(("", 1), ("Score under single motions", 6), (f"Motions better than {constant}", 3)),
        headings=rank_headings(comparison, rows),
        note=f"Of {judged_in_words(results)}. Better: lower peak drift, peak acceleration, or both. "
        f"{chosen_in_words(results)}".rstrip(),
    )


def group_table(results: StudyResults, rows: Sequence[int]) -> Table:
    """The score of rows under each group of motions."""
    groups = motion_groups(results)
    return Table(
        label="Score under groups of motions",
        columns=("", *(f"{name[:1].upper()}{name[1:]}" for name in groups)),
        rows=(
            ("Motions", *(format_fixed(len(motions), 0) for motions in groups.values())),
            *(
                (
                    results.rows[row].label,
                    *(format_fixed(results.score_under(row, motions), 3) for motions in groups.values()),
                )
                for row in rows
            ),
        ),
        note="A motion may be in several groups: its soil, whether it has a near-fault pulse, its peak.",
    )


def _band(band: RealisationBand | None) -> str:
    if band is None:
        return NOTHING
    return f"{format_fixed(band.median, 3)} ({format_fixed(band.lower, 3)}–{format_fixed(band.upper, 3)})"
