"""Tables of a study, for its page and the terminal: which rows they show, their criteria and ratios.

Tables and figures of hundreds of rows cannot be read, and take minutes to draw; `criteria.csv` and `runs.nc` have
every row.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from mrwork.base.numbers import NOTHING, format_fixed, significant
from mrwork.base.summary import Summary
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion, on_request, scored_in_words
from mrwork.closed_loop.responses import in_command_unit, quantity_named
from mrwork.study.comparison import (
    BOTH,
    Comparison,
    best_cells,
    change_table,
    compared,
    rank_headings,
    results_in_words,
    times_better,
)
from mrwork.study.results import BAND, ON_OFF, RealisationBand, StudyResults, bands_over, largest_step_changes

MOST_IN_DETAIL = 8
"""Most motions of which terminals show every table; of more they show medians."""

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


def shown_rows(comparison: Comparison, chosen: Collection[int]) -> ShownRows:
    """The rows that a page shows; of the histories, those among the `chosen` ones."""
    total = len(comparison.results.rows)
    listed, drawn = (_best_rows(comparison, range(total), most) for most in (MOST_LISTED, MOST_DRAWN))
    with_histories = _best_rows(comparison, chosen, MOST_DRAWN)
    parts = (
        (f"tables show {len(listed)} of {total} arrangements, and mark the best of these", listed, total),
        (f"figures show {len(drawn)} of {total}", drawn, total),
        (f"histories are drawn of {len(with_histories)} of {len(chosen)}", with_histories, len(chosen)),
    )
    text = ", ".join(words for words, rows, of in parts if len(rows) < of)
    if text:
        text = (
            f"{text[:1].upper()}{text[1:]}: the references, the best of each kind, and then the lowest scores, "
            "control laws first. All numbers are in `criteria.csv` and `runs.nc`; `controllers` of `[report]` chooses "
            "other histories."
        )
    return ShownRows(listed=listed, drawn=drawn, with_histories=with_histories, in_words=text)


def _best_rows(comparison: Comparison, among: Collection[int], most: int) -> tuple[int, ...]:
    """Rows to show: all if few, else the references, the best of each rank, and further rows by rank."""
    if len(among) <= most:
        return tuple(among)
    ranked = [row for _, rows in comparison.ranks for row in rows]
    best = [rows[0] for _, rows in comparison.ranks]
    order = [*comparison.references, *comparison.constants, *best, *ranked]
    return tuple(sorted([row for row in dict.fromkeys(order) if row in among][:most]))


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
_IN_UNITS = {"m": _MILLIMETRE, "N": _KILONEWTON, "m/s^2": _ACCELERATION}
# What is not worth a column where no storey yields.
_OF_YIELD = ("residual_drift_ratio",)


def value_table(results: StudyResults, motions: Sequence[int], rows: Sequence[int]) -> Table:
    """The criteria themselves under one motion, or their medians over several."""
    unit = results.command_unit
    several, under = len(motions) > 1, results.motions[motions[0]].name
    runs = np.ix_(list(rows), list(motions))
    asked = [
        (entry.name, *_IN_UNITS.get(entry.declared_unit, ("", 1.0)))
        for entry in results.criteria_of_runs.entries
        if entry.name in on_request([entry.name])
    ]
    of_all = (*asked, *_VALUES)
    numbers = {name: _known(results, name)[runs] for name, *_ in of_all}
    values = [
        value for value in of_all if not (criterion(value[0]).optional and np.isnan(numbers[value[0]]).all())
    ]
    columns = [(factor * np.median(numbers[name], axis=1)).tolist() for name, _, factor in values]
    units = (
        (shown or in_command_unit(criterion(name).unit, unit)).removesuffix("1") for name, shown, _ in values
    )
    # What a damper does is no better for being less: only criteria of the building have a best cell.
    of_dampers = (quantity_named(criterion(name).quantity).axis == "device" for name, *_ in values)
    unmarked = [math.nan] * len(rows)
    marked = [
        unmarked if is_of_damper else column for is_of_damper, column in zip(of_dampers, columns, strict=True)
    ]
    return Table(
        label=f"Criteria, median of {results.motions.in_words}" if several else f"{under}: criteria",
        columns=("", *(criterion(name).short for name, *_ in values)),
        units=("", *units),
        rows=tuple(
            (results.rows[row].label, *(significant(column[index], 3) for column in columns))
            for index, row in enumerate(rows)
        ),
        strong=best_cells(results, rows, marked),
        note="Peaks unless stated otherwise, of the worst place. The best control law and the best "
        "passive damper of each column are bold. Travel is the total variation of the command per second; a switching "
        "is a change of more than 10 % of the largest command, until the command turns back by as much.",
    )


def _known(results: StudyResults, name: str) -> Floats:
    """A criterion of the nominal runs; NaN where the run has no such quantity, as without dampers no stroke."""
    values = results.criteria_of_runs.numbers[name][:, :, 0]
    of_quantity = results.quantities.numbers[criterion(name).quantity][:, :, 0]
    lacking = np.isnan(of_quantity).reshape(*values.shape, -1).all(axis=2)
    if name in _OF_YIELD:
        lacking |= np.isnan(results.criteria_of_runs.numbers["peak_ductility"][:, :, 0])
    return np.where(lacking, np.nan, values)


def bands_of_study(results: StudyResults, rows: Sequence[int]) -> Table:
    """Bands of the score and of its ratios to i = 0 over the realisations of a study."""
    bands = [bands_over(results, row, results.at_zero) for row in rows]
    return Table(
        label=f"Over {results.n_realisations} realisations: median, 90 % band of the score and of ratios over i = 0",
        columns=("", "Score", *(criterion(name).short for name in results.scored)),
        rows=tuple(
            (results.rows[row].label, *(_band(by_name.get(name)) for name in ("score", *results.scored)))
            for row, by_name in zip(rows, bands, strict=True)
        ),
        note=f"Median, and the ends between which {100.0 * BAND:.0f} % of the {results.n_realisations} realisations "
        "lie; each number is a mean over the motions, over i = 0 in the same realisation. All rows have the same "
        "realisations; the laws are designed for the nominal study.",
    )


def step_table(results: StudyResults, rows: Collection[int]) -> Table:
    """The largest change of a criterion of each row with half the step."""
    columns = (
        Column(heading="arrangement", of=lambda change: results.rows[change.row].label),
        Column(
            heading="largest change", of=lambda change: change.change if change.criterion else None, shown=2
        ),
        Column(heading="criterion, motion", of=lambda change: change.in_words(results)),
    )
    return Table.of(
        columns,
        [change for change in largest_step_changes(results) if change.row in rows],
        label="Half the step: the largest change of a criterion, over its value",
        note=f"Every run was repeated with half its integration step; changes are relative to the value. {ON_OFF}",
    )


def spread_table(comparison: Comparison, rows: Sequence[int]) -> Table:
    """The score of rows, its spread over single motions, and how often each is better than the best passive damper.

    Of a single motion the score alone.
    """
    results, passive = comparison.results, comparison.passive

    def better(row: int, names: Sequence[str]) -> str:
        if passive is None or row == passive:
            return NOTHING
        return format_fixed(times_better(results, row, passive, names), 0)

    over = "i = 0" if results.row_of("passive_off") is not None else "no actuators"
    table = Table(
        label=f"Score ({scored_in_words(results.scored)} over {over}), mean over {results.motions.in_words}",
        columns=("", "Score"),
        rows=tuple((results.rows[row].label, format_fixed(results.score(row).mean, 3)) for row in rows),
        headings=rank_headings(comparison, rows),
    )
    if len(results.judged_motions) < 2:
        return table
    constant = "the best passive damper" if passive is None else results.rows[passive].label
    return replace(
        table,
        columns=("", "Mean", "Least", "25 %", "Median", "75 %", "Most", "Drift", "Acc.", "Both"),
        rows=tuple(
            (
                *cells,
                # Without the number of motions, and the mean, which is the score.
                *(format_fixed(number, 3) for number in astuple(results.score(row))[2:]),
                *(better(row, names) for names in (BOTH[:1], BOTH[1:], BOTH)),
            )
            for row, cells in zip(rows, table.rows, strict=True)
        ),
        over=(("", 1), ("Score under single motions", 6), (f"Motions better than {constant}", 3)),
        note=f"Of {results.motions.in_words}. Better: lower peak drift, peak acceleration, or both. "
        f"{chosen_in_words(results)}".rstrip(),
    )


def chosen_in_words(results: StudyResults) -> str:
    """What the best constant command is chosen on, a sentence; empty without such a row."""
    return "" if results.row_of("best_passive") is None else results.motions.chosen_in_words


def group_table(results: StudyResults, rows: Sequence[int]) -> Table:
    """The score of rows under each group of motions."""
    groups = results.motions.groups
    return Table(
        label="Score under groups of motions",
        columns=("", *(f"{name[:1].upper()}{name[1:]}" for name in groups)),
        rows=(
            ("Motions", *(format_fixed(len(motions), 0) for motions in groups.values())),
            *(
                (
                    results.rows[row].label,
                    *(format_fixed(results.score(row, motions).mean, 3) for motions in groups.values()),
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


def study_summary(results: StudyResults) -> Summary:
    """What a study has found, of the rows that were simulated; of many motions the criteria are medians."""
    comparison = compared(results)
    begun = "" if results.complete else f": {results.done} of {results.total} runs"
    return replace(
        results._summary(),
        title=f"{results.title}{begun}",
        tables=[replace(table, title=table.label, note="") for table in _tables(comparison)],
        notes=[
            chosen_in_words(results),
            *results_in_words(results),
            *([ON_OFF] if results.step_checked else []),
        ],
    )


def _tables(comparison: Comparison) -> Iterator[Table]:
    results, rows = comparison.results, range(len(comparison.results.rows))
    # After Ctrl-C not all were simulated.
    simulated = results.quantities.done[:, :, 0]
    begun = [row for row in rows if simulated[row].any()]
    for reference in comparison.references if len(begun) > 1 else ():
        if reference in begun:
            yield change_table(comparison, reference, begun)
    if len(results.motions) <= MOST_IN_DETAIL:
        for motion in range(len(results.motions)):
            if motion_rows := [row for row in rows if simulated[row, motion]]:
                yield value_table(results, (motion,), motion_rows)
    elif begun:
        yield value_table(results, results.judged_motions, begun)
    ranked = [row for _, ranked in comparison.ranks for row in ranked]
    if any(math.isfinite(results.score(row).mean) for row in rows):
        yield spread_table(comparison, [row for row in ranked if row in begun])
        if results.motions.groups:
            yield group_table(results, ranked)
    if results.at_zero in (realised := results.realised_rows):
        yield bands_of_study(results, realised)
    yield step_table(results, begun)
