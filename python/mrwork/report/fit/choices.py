"""Sections on choices: of a model, of its current laws, and of the next test."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base import numbers
from mrwork.plots import style
from mrwork.plots.canvas import grid_of_axes, name_above, room_for
from mrwork.report.section import Group, Section, panel
from mrwork.uncertainty.choice.ranking import Ranking
from mrwork.uncertainty.planning import Plan

_ROW = 0.27
_AROUND = 1.35
# Width beside the names.
_WIDTH = 3.0
# Range [points] below the best that is drawn to scale; worse models are marked at the edge with their number.
_RANGE = 40.0


def ranking_section(ranking: Ranking) -> Section:
    """The sentence, the table and, of models, the figure of a choice, and how its numbers are defined."""
    chosen, of_laws = ranking.chosen_standing, ranking.unit is not None
    provisionally = " provisionally" if chosen.verdict == "provisional" else ""
    panels = []
    if not of_laws:
        predicted = sum(standing.left_out_percent is not None for standing in ranking.standings)
        what = f"Left-out fit of {predicted} models with its standard error; {chosen.title} is chosen{provisionally}"
        note = f"Mean and standard error over {ranking.held_out}."
        panels.append(panel("ranking", "Left-out fit of the models", ranking_figure(ranking), what, note))
    return Section(
        title=f"Choice of {'current laws' if of_laws else 'model'}",
        summary=f"{chosen.in_words}{provisionally} of {len(ranking.standings)} "
        f"{'sets of laws' if of_laws else 'families'}, left-out fit {chosen.left_out_in_words} %.",
        groups=(Group(summary=ranking._summary(), points=ranking.definitions, panels=tuple(panels)),),
    )


def ranking_figure(ranking: Ranking) -> Figure:
    """Left-out fit of every family that has one, best on top, with the number of its parameters."""
    predicted = [standing for standing in ranking.standings if standing.left_out_percent is not None]
    percents = np.array([standing.left_out_percent for standing in predicted], dtype=np.float64)
    errors = np.array([standing.left_out_error or 0.0 for standing in predicted])
    names = [f"{standing.title}, {standing.n_params}" for standing in predicted]
    figure, (axes,) = grid_of_axes(1, 1, (_WIDTH + room_for(names), _AROUND + _ROW * len(predicted)))
    least = float(np.maximum(percents, percents[0] - _RANGE).min())
    margin = 0.06 * max(float(percents[0]) - least, 1.0)
    edge = least - margin
    note = partial(axes.annotate, textcoords="offset points", fontsize=style.SMALL_TEXT_SIZE)
    axes.set_yticks(np.arange(len(predicted)), names)
    labels = axes.get_yticklabels()
    for row, (standing, percent, label) in enumerate(zip(predicted, percents.tolist(), labels, strict=True)):
        label.set_fontweight("bold" if standing.is_chosen else "normal")
        is_good = standing.is_chosen or standing.verdict == "as good"
        colour = style.MODEL if is_good else style.DATA
        if percent < edge:
            axes.plot([edge], [row], marker="<", color=colour, markersize=6, linestyle="none")
            note(f"{numbers.format_fixed(percent, 0)} %", (edge, row), xytext=(8, 0), va="center")
            continue
        axes.errorbar(
            percent,
            row,
            xerr=standing.left_out_error,
            fmt="o",
            color=colour,
            markerfacecolor=colour if standing.verdict != "as good" else "white",
            markersize=8.0 if standing.is_chosen else 6.0,
            elinewidth=1.2,
        )
        if is_good:
            note(standing.verdict, (percent, row), xytext=(0, 6), ha="center")
    axes.set_ylim(len(predicted) - 0.4, -0.6)
    axes.set_xlim(edge - margin, min(float((percents + errors).max()) + margin, 100.5))
    axes.grid(visible=True, axis="x")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlabel("Left-out fit (%), standard error")
    name_above(axes, "Model, free parameters")
    return figure


_MAP_COLUMNS = 3
_MAP_WIDTH, _MAP_HEIGHT = 3.6, 3.0
# From white to the blue of the models: the darker, the larger the reduction.
_MAP = LinearSegmentedColormap.from_list("gain", [style.PAGE, style.MODEL])
# Where a cell is darker, its number is white.
_DARK = 0.7


def plan_section(plan: Plan) -> Section:
    """The best candidates, and the map of all of them."""
    name = plan.gains[0].candidate.in_words(plan.command_unit)
    what = f"Variance reduction by each of {len(plan.gains)} tests, best {name}"
    drawn = panel("plan", "", plan_figure(plan), what)
    return Section(
        title="Next test",
        summary=f"{name}, of {len(plan.gains)} candidates.",
        groups=(
            Group(
                summary=plan._summary(),
                prose=(
                    "This assumes that the model is valid there; a test in which it is not shows the error of the "
                    "model instead.",
                ),
            ),
            Group(title="All candidates", panels=(drawn,), layout="whole"),
        ),
    )


def plan_figure(plan: Plan) -> Figure:
    """Variance reduction [%] at each amplitude and frequency; the best is framed, other places are blank."""
    commands = sorted({gain.candidate.command for gain in plan.gains}, key=lambda value: value or 0.0)
    most = max(gain.gain for gain in plan.gains)
    width = max(_MAP_WIDTH, style.PANEL_WIDTH / len(commands))
    figure, maps = grid_of_axes(len(commands), _MAP_COLUMNS, (width, _MAP_HEIGHT))
    for axes, command in zip(maps, commands, strict=True):
        gains = [gain for gain in plan.gains if gain.candidate.command == command]
        amplitudes = sorted({gain.candidate.amplitude for gain in gains})
        frequencies = sorted({gain.candidate.frequency for gain in gains})
        table = np.full((len(amplitudes), len(frequencies)), np.nan)
        for gain in gains:
            row = amplitudes.index(gain.candidate.amplitude)
            column, is_best = frequencies.index(gain.candidate.frequency), gain is plan.gains[0]
            table[row, column] = gain.gain
            axes.text(
                column,
                row,
                f"{100.0 * gain.gain:.0f}",
                ha="center",
                va="center",
                fontsize=style.SMALL_TEXT_SIZE,
                fontweight="bold" if is_best else "normal",
                color=style.PAGE if gain.gain > _DARK * most else style.INK,
            )
            if is_best:
                across, up = 0.5 * np.array([[-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1]])
                axes.plot(column + across, row + up, color=style.RESIDUAL, linewidth=2.0, clip_on=False)
        places = range(len(frequencies)), range(len(amplitudes))
        axes.pcolormesh(*places, table, cmap=_MAP, vmin=0.0, vmax=max(most, 1e-12))
        axes.grid(visible=False)
        axes.set_xticks(places[0], [f"{value:.3g}" for value in frequencies])
        axes.set_yticks(places[1], [f"{1e3 * value:.3g}" for value in amplitudes])
        axes.set_xlabel("Frequency (Hz)")
        axes.set_ylabel("Amplitude (mm)")
        title = "Variance reduction (%)"
        name_above(axes, title if command is None else f"{title}, {command:g} {plan.command_unit}")
    return figure
