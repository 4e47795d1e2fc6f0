"""Figures of a tuning: scores with their spread over motions, the course of each search, Pareto fronts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.closed_loop.evaluation import criterion
from mrwork.escaping import escaped
from mrwork.report import style
from mrwork.report.canvas import column_axes, room_for
from mrwork.tuning.results import Front, LawResult

_LINE = 0.36
_BELOW, _ABOVE = 0.55, 0.55
_LONGEST = 30
_HUES = (style.MODEL, style.RESIDUAL, "#3c8d5a", "#8a5aa8", "#c79a1e", "#3aa0b8", "#a83c5c", "#6b6b2a")


@style.drawn_in_style()
def score_figure(laws: Sequence[LawResult]) -> Figure:
    """Scores on training and test motions, the best above, with range and quartiles over the test motions."""
    names = [_short(each.label) for each in laws]
    height = _BELOW + _ABOVE + _LINE * len(laws)
    figure, axes = column_axes(left=room_for(names), top=_ABOVE, height=height)
    for place, each in enumerate(reversed(laws)):
        found = each.train if each.test is None else each.test
        spread = found.spread.get("score")
        if spread is not None:
            axes.plot([spread.least, spread.most], [place, place], color=style.RULE, linewidth=2.0)
            axes.plot(
                [spread.lower_quartile, spread.upper_quartile],
                [place, place],
                color=style.BAND_EDGE,
                linewidth=5.0,
            )
        last = place == len(laws) - 1
        axes.plot(each.train.score, place, "o", markersize=5, markerfacecolor="white", color=style.FAINT_INK)
        if each.test is not None:
            axes.plot(each.test.score, place, "o", markersize=5, color=style.MODEL)
        if last:
            axes.plot(
                [], [], "o", markersize=5, markerfacecolor="white", color=style.FAINT_INK, label="training"
            )
            if each.test is not None:
                axes.plot([], [], "o", markersize=5, color=style.MODEL, label="test")
            axes.plot([], [], color=style.BAND_EDGE, linewidth=5.0, label="middle half of the motions")
    axes.set_yticks(range(len(laws)), [escaped(name) for name in reversed(names)])
    axes.set_ylim(-0.6, len(laws) - 0.4)
    axes.set_xlabel("Score over i = 0")
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.2, columnspacing=0.9)
    return figure


@style.drawn_in_style()
def course_figure(laws: Sequence[LawResult]) -> Figure:
    """The least penalised objective after each generation of every search."""
    figure, axes = column_axes(top=0.2 + 0.19 * len(laws), height=style.PANEL_HEIGHT + 0.1 * len(laws))
    for number, each in enumerate(laws):
        axes.step(
            [point.candidates for point in each.trace],
            [point.least for point in each.trace],
            where="post",
            color=_HUES[number % len(_HUES)],
            label=_short(each.label),
        )
    axes.set_xlabel("Candidates")
    axes.set_ylabel("Least objective on the training motions")
    axes.set_xlim(left=0.0)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderpad=0.2, labelspacing=0.25)
    return figure


@style.drawn_in_style()
def front_figure(front: Front) -> Figure:
    """The first two objectives of a Pareto front, on the training and on the test motions."""
    figure, axes = column_axes()
    first, second = front.objectives[:2]
    for label, colour, numbers in (
        ("training", style.FAINT_INK, [each.train for each in front.points]),
        ("test", style.MODEL, [each.test for each in front.points if each.test is not None]),
    ):
        if numbers:
            order = np.argsort([each[first] for each in numbers])
            axes.plot(
                [numbers[int(n)][first] for n in order],
                [numbers[int(n)][second] for n in order],
                "o-" if label == "training" else "o",
                markersize=4,
                color=colour,
                label=label,
            )
    axes.set_xlabel(f"{criterion(first).title} over i = 0")
    axes.set_ylabel(f"{criterion(second).title} over i = 0")
    axes.legend(loc="upper right")
    return figure


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
