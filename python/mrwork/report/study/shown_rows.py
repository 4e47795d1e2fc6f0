"""Rows that the page of a study shows: all of few, the best of many.

Tables and figures of hundreds of rows cannot be read, and take minutes to draw; `criteria.csv` and `results.json` have
every row.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from mrwork.study.comparison import StudyComparison

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
    listed, drawn = _best(comparison, range(total), MOST_LISTED), _best(comparison, range(total), MOST_DRAWN)
    with_histories = _best(comparison, chosen, MOST_DRAWN)
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
        "control laws first. All numbers are in `criteria.csv` and `results.json`; `controllers` of `[report]` chooses "
        "other histories.",
    )


def _best(comparison: StudyComparison, among: Collection[int], most: int) -> tuple[int, ...]:
    """All of few rows; of more, the references, the first of each rank, and then the others from rank to rank."""
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
