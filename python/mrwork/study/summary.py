"""The summary of a study: changes of every quantity, criteria of each motion, scores, and what they mean."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import isfinite
from typing import get_args

import numpy as np

from mrwork.base.summary import Summary, list_names
from mrwork.base.table import Table
from mrwork.study.comparison import (
    ADD_BEST_PASSIVE,
    MOST_IN_DETAIL,
    StudyComparison,
    change_table,
    chosen_in_words,
    compared,
    findings,
    judged_in_words,
    motion_groups,
)
from mrwork.study.results import OFF_BALANCE, ON_OFF, StudyResults
from mrwork.study.schema import Use
from mrwork.study.tables import (
    bands_of_study,
    group_table,
    spread_table,
    step_table,
    value_table,
)


def study_summary(results: StudyResults) -> Summary:
    """What a study has found; of many motions the criteria are medians."""
    comparison = compared(results)
    leading = comparison.leading
    changes = [] if leading is None else comparison.in_words(leading)
    begun = "" if results.complete else f": {results.done} of {results.total} runs"
    return Summary(
        title=f"{results.title}{begun}",
        facts=(
            ("dampers", list_names(results.device_names)),
            *((f"{use} motions", list_names(results.names_of(use))) for use in get_args(Use)),
        ),
        cautions=results.warnings(),
        tables=[*_tables(comparison)],
        notes=[
            *([comparison.heading(leading)] if leading is not None and changes else []),
            *changes,
            *([ADD_BEST_PASSIVE] if comparison.lacks_best_passive else []),
            *findings(results),
            *([] if results.balanced else [OFF_BALANCE]),
        ],
    )


def _tables(comparison: StudyComparison) -> Iterator[Table]:
    """The tables of the page with titles, of the rows that were simulated."""
    results = comparison.results
    judged, several = judged_in_words(results), len(results.judged_motions) > 1
    begun = _begun_rows(results)
    for reference in comparison.references if len(begun) > 1 else ():
        if reference in begun:
            title = f"Change in % against {results.rows[reference].label}{f', mean over {judged}' if several else ''}"
            yield replace(change_table(comparison, reference, begun), title=title, note="")
    if len(results.motions) <= MOST_IN_DETAIL:
        for number, motion in enumerate(results.motions):
            if rows := _begun_rows(results, number):
                table = value_table(results, (number,), rows)
                yield replace(table, title=f"{motion.name}: criteria", note="")
    elif begun:
        table = value_table(results, results.judged_motions, begun)
        yield replace(table, title=f"Criteria, median of {judged}", note="")
    if any(isfinite(results.score(row)) for row in range(len(results.rows))):
        yield from _scores(comparison, begun)
    if results.row_of("passive_off") in (rows := results.realised_rows):
        title = f"Over {results.n_realisations} realisations: median, 90 % band of the score and of ratios over i = 0"
        yield replace(bands_of_study(results, rows), title=title, note="")
    title = "Half the step: the largest change of a criterion, over its value"
    yield replace(step_table(results, begun), title=title, note=ON_OFF)


def _scores(comparison: StudyComparison, begun: list[int]) -> Iterator[Table]:
    """The score of every row, its spread over the motions, how often it beats a constant command, and its groups."""
    results, against = comparison.results, comparison.passive
    ranked = [row for _, rows in comparison.ranks for row in rows]
    below = [rank.note for rank, _ in comparison.ranks if rank.note]
    if len(results.judged_motions) > 1 and against is not None:
        better = (
            "Least to most: of single motions. Better: motions with less peak drift, less peak acceleration, or both, "
            f"than {results.rows[against].label}. {chosen_in_words(results)}"
        )
        below.insert(0, better.rstrip())
    score = f"Score (peak and RMS drift and acceleration over those at i = 0), mean over {judged_in_words(results)}:"
    table = spread_table(comparison, [row for row in ranked if row in begun])
    yield replace(table, title=score, note=" ".join(below))
    if motion_groups(results):
        yield replace(group_table(results, ranked), title="Score under groups of motions:", note="")


def _begun_rows(results: StudyResults, motion: int | None = None) -> list[int]:
    """Rows that were simulated, under this motion or any; after Ctrl-C these are not all."""
    begun = results.quantities.done[:, :, 0]
    return [int(row) for row in np.flatnonzero(begun.any(axis=1) if motion is None else begun[:, motion])]
