"""Where the next test tells most: the gain over amplitude and frequency, one map per command."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from mrwork.dampers.parameters import CommandUnit
from mrwork.report import style
from mrwork.uncertainty.planning.plan import Gain, Plan

_COLUMNS = 3
_WIDTH, _HEIGHT = 3.6, 3.0
# From paper to the blue of the models: the darker, the more a test tells.
_MAP = LinearSegmentedColormap.from_list("gain", ["#ffffff", style.MODEL])
# On a darker ground the number is written in white.
_DARK = 0.55


def plan_figure(plan: Plan, unit: CommandUnit | None) -> Figure:
    """Gain in percent at each amplitude and frequency; the best is framed, what is not a candidate blank."""
    commands = sorted({each.candidate.command for each in plan.gains}, key=lambda value: value or 0.0)
    columns = min(_COLUMNS, len(commands))
    rows = -(-len(commands) // columns)
    most = max(each.gain for each in plan.gains)
    with style.drawn_in_style():
        figure = Figure(
            figsize=(max(columns * _WIDTH, style.PANEL_WIDTH), rows * _HEIGHT), layout="constrained"
        )
        for number, command in enumerate(commands):
            axes = figure.add_subplot(rows, columns, number + 1)
            gains = [each for each in plan.gains if each.candidate.command == command]
            _draw(axes, gains, plan.gains[0], most)
            title = "Variance taken away (%)"
            axes.set_title(title if command is None else f"{title}, {command:g} {unit}", loc="left", pad=6)
    return figure


def _draw(axes: Axes, gains: list[Gain], best: Gain, most: float) -> None:
    amplitudes = sorted({each.candidate.amplitude for each in gains})
    frequencies = sorted({each.candidate.frequency for each in gains})
    table = np.full((len(amplitudes), len(frequencies)), np.nan)
    for each in gains:
        row, column = amplitudes.index(each.candidate.amplitude), frequencies.index(each.candidate.frequency)
        table[row, column] = each.gain
        axes.text(
            column,
            row,
            f"{100.0 * each.gain:.0f}",
            ha="center",
            va="center",
            fontsize=style.SMALL_TEXT_SIZE,
            fontweight="bold" if each is best else "normal",
            color="white" if each.gain > _DARK * most else style.INK,
        )
        if each is best:
            axes.plot(
                column + 0.5 * np.array([-1, 1, 1, -1, -1]),
                row + 0.5 * np.array([-1, -1, 1, 1, -1]),
                color=style.RESIDUAL,
                linewidth=2.0,
                clip_on=False,
            )
    axes.imshow(table, origin="lower", aspect="auto", cmap=_MAP, vmin=0.0, vmax=max(most, 1e-12))
    axes.grid(visible=False)
    axes.set_xticks(range(len(frequencies)), [f"{value:.3g}" for value in frequencies])
    axes.set_yticks(range(len(amplitudes)), [f"{1e3 * value:.3g}" for value in amplitudes])
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel("Amplitude (mm)")
