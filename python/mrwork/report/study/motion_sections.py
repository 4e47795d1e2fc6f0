"""Sections of what ground motions have to do with a score: its spread over them, groups, and the motions themselves."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from mrwork.numbers import NOTHING, fixed, significant
from mrwork.report import style
from mrwork.report.canvas import column_axes, room_for
from mrwork.report.section import Group, Section, panel
from mrwork.report.study.figures import short, strokes
from mrwork.report.study.tables import ShownRows
from mrwork.study.comparison import (
    StudyComparison,
    chosen_in_words,
    judged_in_words,
    motion_groups,
    times_better,
)
from mrwork.study.results import StudyResults
from mrwork.study.study import uses_in_words
from mrwork.table import Table

_ROW = 0.26
_NAME = 36


def spread_section(comparison: StudyComparison, shown: ShownRows) -> Section | None:
    """Least, quartiles and most of the scores under single motions, and scores of groups; `None` of a single motion."""
    results = comparison.results
    assert isinstance(results, StudyResults)
    scored = [row for _, rows in comparison.ranks for row in rows if math.isfinite(results.score(row))]
    rows = [row for row in scored if row in shown.listed]
    drawn = [row for row in scored if row in shown.drawn]
    if len(results.judged) < 2 or not rows:
        return None
    groups = [
        Group(title=f"Score over {judged_in_words(results)}", table=_spread_table(comparison, rows)),
        Group(
            panels=(
                panel(
                    "score-spread",
                    "Score under each motion",
                    score_figure(results, drawn),
                    f"Score of {len(drawn)} arrangements under each of {judged_in_words(results)}, with the median",
                    note="A dot for each test motion, circles for training motions; the line is the median.",
                ),
            )
        ),
    ]
    if motion_groups(results):
        groups.append(Group(title="Score under groups of motions", table=_group_table(results, rows)))
    return Section(
        anchor="spread",
        title="Spread over motions",
        summary=_spread_in_words(comparison),
        groups=tuple(groups),
    )


def _spread_in_words(comparison: StudyComparison) -> str:
    results, leading, passive = comparison.results, comparison.leading, comparison.passive
    parts = []
    if leading is not None and math.isfinite(results.score(leading)):
        spread = results.spread(leading)
        parts.append(
            f"the score of {results.rows[leading].label} is {fixed(spread.mean, 3)}, under single motions "
            f"{fixed(spread.least, 3)} to {fixed(spread.most, 3)}"
        )
        better = None if passive in (None, leading) else times_better(results, leading, passive)
        if better is not None and passive is not None:
            parts.append(
                f"peak drift and peak acceleration are both lower than those of {results.rows[passive].label} under "
                f"{better} of {judged_in_words(results)}"
            )
    return f"{'; '.join(parts)}. {chosen_in_words(results)}".strip()


def _spread_table(comparison: StudyComparison, rows: list[int]) -> Table:
    results, passive = comparison.results, comparison.passive
    spreads = {row: results.spread(row) for row in rows}

    def better(row: int, *names: str) -> str:
        if passive is None or row == passive:
            return NOTHING
        return fixed(times_better(results, row, passive, names), 0)

    cells = tuple(
        (
            results.rows[row].label,
            *(
                fixed(number, 3)
                for number in (
                    spreads[row].mean,
                    spreads[row].least,
                    spreads[row].lower_quartile,
                    spreads[row].median,
                    spreads[row].upper_quartile,
                    spreads[row].most,
                )
            ),
            better(row, "peak_drift"),
            better(row, "peak_acceleration"),
            better(row, "peak_drift", "peak_acceleration"),
        )
        for row in rows
    )
    constant = "the best passive damper" if passive is None else results.rows[passive].label
    return Table(
        label="Spread of the score over the motions",
        columns=("", "Mean", "Least", "25 %", "Median", "75 %", "Most", "Drift", "Acc.", "Both"),
        rows=cells,
        over=(("", 1), ("Score under single motions", 6), (f"Motions better than {constant}", 3)),
        headings=_headings(comparison, rows),
        note=f"Of {judged_in_words(results)}. Better: lower peak drift, peak acceleration, or both. "
        f"{chosen_in_words(results)}".rstrip(),
    )


def _headings(comparison: StudyComparison, rows: list[int]) -> dict[int, str]:
    return {
        rows.index(first): rank.title
        for rank, members in comparison.ranks
        for first in [next((row for row in members if row in rows), -1)]
        if first >= 0
    }


def _group_table(results: StudyResults, rows: list[int]) -> Table:
    groups = motion_groups(results)
    return Table(
        label="Score under groups of motions",
        columns=("", *(f"{group.name[:1].upper()}{group.name[1:]}" for group in groups)),
        rows=(
            ("Motions", *(fixed(len(group.motions), 0) for group in groups)),
            *(
                (
                    results.rows[row].label,
                    *(fixed(results.score_under(row, group.motions), 3) for group in groups),
                )
                for row in rows
            ),
        ),
        note="A motion may be in several groups: its soil, whether it has a near-fault pulse, its peak.",
    )


@style.drawn_in_style()
def score_figure(results: StudyResults, rows: list[int]) -> Figure:
    """Score under each motion, a line of dots for each row, the first on top."""
    shown = list(reversed(rows))
    names = [short(results.rows[row].label, _NAME) for row in shown]
    figure, axes = column_axes(left=room_for(names), top=0.15, height=0.8 + _ROW * len(shown))
    of_row = strokes(results)
    judged = set(results.judged)
    for place, row in enumerate(shown):
        for motion in range(len(results.motions)):
            score = results.score_under(row, (motion,))
            filled = of_row[row].colour if motion in judged else "none"
            axes.plot(
                score,
                place,
                "o",
                markersize=3.6,
                markerfacecolor=filled,
                markeredgecolor=of_row[row].colour,
                alpha=0.75,
            )
        median = results.spread(row).median
        axes.plot([median, median], [place - 0.34, place + 0.34], color=style.INK, linewidth=1.3)
    axes.set_yticks(range(len(shown)), names)
    axes.set_ylim(-0.6, len(shown) - 0.4)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("Score under one motion")
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x")
    return figure


def motion_section(results: StudyResults) -> Section:
    """The ground motions: use, groups, peak, duration, source and processing."""
    uses = [motion.use for motion in results.motions]
    peaks = np.array([motion.peak for motion in results.motions])
    lengths = np.array([motion.duration for motion in results.motions])
    return Section(
        anchor="motions",
        title="Ground motions",
        summary=f"{uses_in_words(uses)}, peaks from {significant(float(peaks.min()), 3)} to "
        f"{significant(float(peaks.max()), 3)} m/s², {significant(float(lengths.min()), 3)} to "
        f"{significant(float(lengths.max()), 3)} s long.",
        groups=(
            Group(
                table=Table(
                    label="Ground motions",
                    columns=("", "Use", "Groups", "Peak (m/s²)", "Duration (s)", "Source", "Changes"),
                    rows=tuple(
                        (
                            motion.name,
                            f"{motion.use}{', synthetic' if motion.synthetic else ''}",
                            ", ".join(motion.groups),
                            significant(motion.peak, 4),
                            significant(motion.duration, 4),
                            motion.source,
                            "; ".join(motion.changes),
                        )
                        for motion in results.motions
                    ),
                    words=(1, 2, 5, 6),
                )
            ),
        ),
    )
