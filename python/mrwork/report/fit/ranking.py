"""Sections on choices: how families of models, or laws of one, compare on tests that their fits have not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base import numbers
from mrwork.report import style
from mrwork.report.canvas import blank, name_ordinate, room_for
from mrwork.report.figures import Comparison
from mrwork.report.section import Absent, Group, Section, SectionKind, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.choice.law_table import LawTable
from mrwork.uncertainty.choice.ranking import Ranking, Standing

_ROW = 0.27
_AROUND = 1.35
# Width beside the names.
_WIDTH = 3.0
# Range [points] below the best that is drawn to scale; worse models are marked at the edge with their number.
_RANGE = 40.0


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """The sentence, the table and the figure of a comparison, and how its numbers are defined."""
    ranking = run.ranking
    if ranking is None:
        return None
    chosen = ranking.chosen_standing
    provisionally = " provisionally" if chosen.verdict == "provisional" else ""
    predicted = [each for each in ranking.standings if each.left_out_percent is not None]
    return Section(
        anchor="ranking",
        title="Choice of model",
        summary=f"Choice of model: {chosen.title}{provisionally} of {len(ranking.standings)} families, left-out fit "
        f"{chosen.left_out_in_words} %.",
        groups=(
            _group(ranking, ranking.remarks),
            Group(
                title="Left-out fit of the models",
                panels=(
                    panel(
                        "ranking",
                        "",
                        ranking_figure(ranking),
                        f"Left-out fit of {len(predicted)} models with its standard error; {chosen.title} is "
                        f"chosen{provisionally}",
                        f"Mean and standard error over {ranking.held_out}.",
                    ),
                ),
            ),
        ),
    )


def _laws_section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """The sentence and the table of a choice, and how its numbers are defined."""
    laws = run.laws
    if laws is None:
        return None
    chosen = laws.chosen_laws
    in_words = f"{laws.model}, {chosen.in_words}" if laws.is_of_several else chosen.in_words
    return Section(
        anchor="laws",
        title="Choice of current laws",
        summary=f"Choice of laws: {in_words}, of {len(laws.tried)} sets of laws; left-out fit "
        f"{chosen.left_out_percent:.2f} %.",
        groups=(_group(laws, laws.notes),),
    )


def _group(choice: Ranking | LawTable, remarks: Sequence[str]) -> Group:
    return Group(
        prose=(choice.sentence, *(f"{remark}." for remark in remarks)),
        table=choice.page_table,
        points=choice.definitions,
    )


@style.drawn_in_style()
def ranking_figure(ranking: Ranking) -> Figure:
    """Left-out fit of every family that has one, best on top, with the number of its parameters."""
    predicted = [each for each in ranking.standings if each.left_out_percent is not None]
    names = [f"{each.title}, {each.n_params}" for each in predicted]
    figure, axes = blank((_WIDTH + room_for(names), _AROUND + _ROW * len(predicted)))
    best = predicted[0].left_out_percent or 0.0
    least = min(max(each.left_out_percent or 0.0, best - _RANGE) for each in predicted)
    margin = 0.06 * max(best - least, 1.0)
    edge = least - margin
    for row, each in enumerate(predicted):
        _draw(axes, row, each, edge)
    axes.set_yticks(np.arange(len(predicted)), names)
    for label, each in zip(axes.get_yticklabels(), predicted, strict=True):
        label.set_fontweight("bold" if each.is_chosen else "normal")
    axes.set_ylim(len(predicted) - 0.4, -0.6)
    farthest = max((each.left_out_percent or 0.0) + (each.left_out_error or 0.0) for each in predicted)
    axes.set_xlim(edge - margin, min(farthest + margin, 100.5))
    axes.grid(visible=True, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlabel("Left-out fit (%), standard error")
    name_ordinate(axes, "Model, free parameters")
    return figure


def _draw(axes: Axes, row: int, own: Standing, edge: float) -> None:
    percent = own.left_out_percent or 0.0
    colour = style.MODEL if own.is_chosen or own.verdict == "as good" else style.DATA
    if percent < edge:
        axes.plot([edge], [row], marker="<", color=colour, markersize=6, linestyle="none")
        axes.annotate(
            f"{numbers.format_fixed(percent, 0)} %",
            (edge, row),
            xytext=(8, 0),
            textcoords="offset points",
            va="center",
            fontsize=style.SMALL_TEXT_SIZE,
        )
        return
    filled = colour if own.verdict != "as good" else "white"
    axes.errorbar(
        [percent],
        [row],
        xerr=None if own.left_out_error is None else [own.left_out_error],
        fmt="o",
        color=colour,
        markerfacecolor=filled,
        markersize=8.0 if own.is_chosen else 6.0,
        elinewidth=1.2,
    )
    if own.is_chosen or own.verdict == "as good":
        axes.annotate(
            own.verdict,
            (percent, row),
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=style.SMALL_TEXT_SIZE,
        )


RANKING = SectionKind(
    make=_section,
    absent=Absent(
        title="Choice of model",
        command="mrwork identify TESTS --model all",
        description="compares families of models on tests that their fits have not seen, and writes a run folder of "
        "its own.",
    ),
)
LAWS = SectionKind(
    make=_laws_section,
    absent=Absent(
        title="Choice of current laws",
        command="mrwork identify TESTS --law auto",
        description="chooses which parameters follow the command, and by which law, by predictions of tests left out, "
        "and writes a run folder of its own.",
    ),
)
