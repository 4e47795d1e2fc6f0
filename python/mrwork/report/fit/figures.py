"""Figures of a test beside its model, on the page and in files, from the figures of `mr.plots`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.base.values import Floats
from mrwork.plots import canvas, style
from mrwork.plots.canvas import axes_between, finish_signed
from mrwork.plots.of_tests import Motion, commands, histories, loops, residuals
from mrwork.plots.samples import zoom_window
from mrwork.records.damper_test import DamperTest
from mrwork.uncertainty.bands.prediction import Prediction

# Inches between a force history and its residual below, the residual's share of the height, and a line of heading.
_BETWEEN = 0.42
_RESIDUAL_SHARE = 0.3
_HEADING = 0.34
# Samples of a small loop.
_SMALL_SAMPLES = 400

Drawing = Callable[[Figure, int, Prediction, str], None]
"""Draws a test into the column of a figure with this number, forces in this unit."""


def name_of(test: DamperTest) -> str:
    """Name of a test, which says where its data are synthetic."""
    return test.name + (" (synthetic)" if test.synthetic else "")


def common_unit(predictions: Sequence[Prediction]) -> str:
    """One unit of force for all tests of a report, so that their figures are comparable."""
    peaks = [float(np.nanmax(np.abs(each.test.force))) for each in predictions]
    return style.force_unit(max(peaks, default=0.0)).symbol


def force_history(drawn: Prediction, unit: str) -> Figure:
    """Force against time with the residual below: the whole record, and a few cycles of it enlarged."""
    return figure_of_test(drawn, unit, draw_record, draw_cycles, heading=name_of(drawn.test))


def hysteresis_loops(drawn: Prediction, unit: str) -> Figure:
    """Force against displacement and against velocity."""
    both = partial(draw_loop, "displacement"), partial(draw_loop, "velocity")
    return figure_of_test(drawn, unit, *both, heading=name_of(drawn.test))


@style.drawn_in_style()
def repair_panel(test: DamperTest, original: DamperTest, unit: str) -> Figure:
    """Force against displacement before and after the repair of a test, as one column."""
    figure, axes = canvas.column_axes()
    axes.grid(True, axis="both")
    shown, scale = style.force_unit(0.0, unit), style.MILLIMETRE
    for drawn, colour, width, label in (
        (original, style.DATA, 1.6, "as recorded"),
        (test, style.RESIDUAL, 0.9, "repaired"),
    ):
        stroke, force = drawn.displacement * scale.factor, drawn.force * shown.factor
        axes.plot(stroke, force, color=colour, linewidth=width, label=label)
    finish_signed(axes, f"Force ({unit})", f"Displacement ({scale.symbol})")
    canvas.legend(axes)
    return figure


@style.drawn_in_style()
def figure_of_test(drawn: Prediction, unit: str, *drawings: Drawing, heading: str = "") -> Figure:
    """Drawings of a test as a figure, a column each, below its heading if it has one."""
    width, room = len(drawings) * style.PANEL_WIDTH, _HEADING if heading else 0.0
    figure = Figure(figsize=(width, style.PANEL_HEIGHT + room))
    if heading:
        top = 1 - 0.12 / figure.get_figheight()
        figure.text(canvas.LEFT / width, top, heading, va="top", fontweight="bold")
    for column, draw in enumerate(drawings):
        draw(figure, column, drawn, unit)
    return figure


def draw_record(figure: Figure, column: int, drawn: Prediction, unit: str) -> None:
    """The whole record; the part that the next panel enlarges is shaded."""
    for axes in _draw_history(figure, column, drawn, unit):
        _shade_window(axes, drawn.test)


def draw_cycles(figure: Figure, column: int, drawn: Prediction, unit: str) -> None:
    """A few cycles of the record."""
    _draw_history(figure, column, few_cycles(drawn), unit)


def _draw_history(figure: Figure, column: int, drawn: Prediction, unit: str) -> tuple[Axes, Axes]:
    """Force over time and, below, its residual."""
    free = style.PANEL_HEIGHT - canvas.TOP - canvas.BOTTOM - _BETWEEN
    split = canvas.BOTTOM + _RESIDUAL_SHARE * free
    lower = _axes(figure, column, canvas.BOTTOM, split)
    upper = _axes(figure, column, split + _BETWEEN, style.PANEL_HEIGHT - canvas.TOP, sharex=lower)
    upper.tick_params(labelbottom=False)
    histories(drawn, upper, unit=unit)
    limit_force(upper, drawn, unit)
    finish_signed(upper)
    upper.set_xlabel("")
    residuals(drawn, lower, unit=unit)
    canvas.symmetric(lower)
    finish_signed(lower, y_bins=3)
    time = drawn.test.time
    margin = 0.0 if time.size > 1 else 0.5
    lower.set_xlim(float(time[0]) - margin, float(time[-1]) + margin)
    return upper, lower


def few_cycles(drawn: Prediction, most: int | None = None) -> Prediction:
    """A few whole cycles from the middle of a test, of at most about `most` samples."""
    window = zoom_window(drawn.test.displacement)
    every = 1 if most is None else max(1, (window.stop - window.start) // most)
    part = drawn.test.part(window.start, window.stop, every)
    return Prediction(test=part, model_force=drawn.model_force[window.start : window.stop : every])


def _shade_window(axes: Axes, test: DamperTest) -> None:
    """Shade the part of a record that another panel enlarges."""
    window = zoom_window(test.displacement)
    ends = test.time[window.start], test.time[window.stop - 1]
    axes.axvspan(*ends, color=style.WINDOW, linewidth=0, zorder=-1)


def draw_command(figure: Figure, column: int, drawn: Prediction, unit: str) -> None:
    """A varying command over the whole record; the part of `draw_cycles` is shaded."""
    axes = commands(drawn, _axes(figure, column, canvas.BOTTOM, style.PANEL_HEIGHT - canvas.TOP))
    finish_signed(axes)
    _shade_window(axes, drawn.test)
    axes.set_xlim(float(drawn.test.time[0]), float(drawn.test.time[-1]))


def draw_loop(over: Motion, figure: Figure, column: int, drawn: Prediction, unit: str) -> None:
    """Force against displacement or velocity."""
    axes = _axes(figure, column, canvas.BOTTOM, style.PANEL_HEIGHT - canvas.TOP)
    axes.grid(True, axis="both")
    loops(drawn, axes, over=over, unit=unit)
    limit_force(axes, drawn, unit)
    finish_signed(axes)


@style.drawn_in_style()
def small_loop(drawn: Prediction, unit: str, *, over: Motion, height: float = canvas.SMALL_HEIGHT) -> Figure:
    """Force over displacement or velocity in a few cycles, as one of four columns."""
    figure, axes = canvas.small_axes(labelled=True, height=height)
    loops(few_cycles(drawn, _SMALL_SAMPLES), axes, over=over, unit=unit, legend=False)
    limit_force(axes, drawn, unit)
    canvas.name_above(axes)
    return figure


def _axes(figure: Figure, column: int, bottom: float, top: float, sharex: Axes | None = None) -> Axes:
    left, right = column * style.PANEL_WIDTH + canvas.LEFT, (column + 1) * style.PANEL_WIDTH - canvas.RIGHT
    return axes_between(figure, left=left, right=right, bottom=bottom, top=top, sharex=sharex)


def limit_force(axes: Axes, drawn: Prediction, unit: str) -> None:
    """The range of the data as the ordinate, opened for the model by half of that range at most on either side.

    A model far from the data must not compress them.
    """
    factor = style.force_unit(0.0, unit).factor
    low, high = _range(drawn.test.force * factor)
    spread = (high - low) or 1.0
    model = drawn.model_force[np.isfinite(drawn.model_force)] * factor
    if model.size:
        least, most = _range(model)
        low, high = max(min(low, least), low - spread / 2), min(max(high, most), high + spread / 2)
    margin = 0.06 * spread
    axes.set_ylim(low - margin, high + margin)


def _range(values: Floats) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))
