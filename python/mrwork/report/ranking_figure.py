"""The ranking of models as a figure: a dot for each, with its standard error."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.report import numbers, style
from mrwork.uncertainty.choice.ranking import Ranking, Standing

_ROW = 0.27
_AROUND = 1.35
_WIDTH = 7.2
# Points below the best that are drawn to scale; what is worse stands at the edge with its number.
_RANGE = 40.0


def ranking_figure(ranking: Ranking) -> Figure:
    """Left-out fit of every family that was judged, best on top, with the number of its parameters."""
    judged = [each for each in ranking.standings if each.left_out_percent is not None]
    with style.drawn_in_style():
        figure = Figure(figsize=(_WIDTH, _AROUND + _ROW * len(judged)), layout="constrained")
        axes = figure.add_subplot()
        best = judged[0].left_out_percent or 0.0
        least = min(max(each.left_out_percent or 0.0, best - _RANGE) for each in judged)
        margin = 0.06 * max(best - least, 1.0)
        edge = least - margin
        for row, each in enumerate(judged):
            _draw(axes, row, each, edge)
        names = [f"{each.title}, {each.n_params}" for each in judged]
        axes.set_yticks(np.arange(len(judged)), names)
        for label, each in zip(axes.get_yticklabels(), judged, strict=True):
            label.set_fontweight("bold" if each.verdict == "chosen" else "normal")
        axes.set_ylim(len(judged) - 0.4, -0.6)
        farthest = max((each.left_out_percent or 0.0) + (each.left_out_error or 0.0) for each in judged)
        axes.set_xlim(edge - margin, min(farthest + margin, 100.5))
        axes.grid(visible=True, axis="x")
        axes.xaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 2.5, 5, 10]))
        axes.set_xlabel(f"Left-out fit (%), mean and standard error over\n{ranking.held_out}")
        axes.set_title("Model, free parameters", loc="left", pad=7)
    return figure


def _draw(axes: Axes, row: int, own: Standing, edge: float) -> None:
    percent = own.left_out_percent or 0.0
    colour = style.MODEL if own.verdict in ("chosen", "as good") else style.DATA
    if percent < edge:
        axes.plot([edge], [row], marker="<", color=colour, markersize=6, linestyle="none")
        axes.annotate(
            f"{numbers.fixed(percent, 0)} %",
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
        markersize=8.0 if own.verdict == "chosen" else 6.0,
        elinewidth=1.2,
    )
    if own.verdict in ("chosen", "as good"):
        axes.annotate(
            own.verdict,
            (percent, row),
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=style.SMALL_TEXT_SIZE,
        )
