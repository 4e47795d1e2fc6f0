"""Figures of a test beside its model on the page, from the figures of `mr.plots`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.plots import canvas, style
from mrwork.plots.canvas import finish_signed
from mrwork.plots.of_tests import Motion, commands, histories, loops, residuals
from mrwork.plots.samples import zoom_window
from mrwork.records.damper_test import DamperTest
from mrwork.uncertainty.bands.prediction import Prediction

# Inches between a force history and its residual below, the residual's share of the height; samples of a small loop.
_BETWEEN, _RESIDUAL_SHARE, _SMALL_SAMPLES = 0.42, 0.3, 400


def name_of(test: DamperTest) -> str:
    """Name of a test, which says where its data are synthetic."""
    return test.name + (" (synthetic)" if test.synthetic else "")


def common_unit(predictions: Sequence[Prediction]) -> str:
    """One unit of force for all tests of a report, so that their figures are comparable."""
    peaks = [float(np.nanmax(np.abs(prediction.test.force))) for prediction in predictions]
    return style.force_unit(max(peaks, default=0.0)).symbol


def repair_figure(test: DamperTest, original: DamperTest, unit: str) -> Figure:
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


def history_figure(drawn: Prediction, unit: str) -> Figure:
    """Force over time and, below, its residual."""
    figure, upper = canvas.column_axes()
    left, bottom, width, height = upper.get_position().bounds
    between = _BETWEEN / style.PANEL_HEIGHT
    split = _RESIDUAL_SHARE * (height - between)
    lower = figure.add_axes((left, bottom, width, split))
    upper.set_position((left, bottom + split + between, width, height - split - between))
    upper.sharex(lower)
    upper.tick_params(labelbottom=False)
    histories(drawn, upper, unit=unit)
    limit_force(upper, drawn, unit)
    finish_signed(upper)
    upper.set_xlabel("")
    residuals(drawn, lower, unit=unit)
    canvas.make_symmetric(lower)
    canvas.finish(lower, y_bins=3)
    time = drawn.test.time
    margin = 0.0 if time.size > 1 else 0.5
    lower.set_xlim(float(time[0]) - margin, float(time[-1]) + margin)
    return figure


def few_cycles(drawn: Prediction, most: int | None = None) -> Prediction:
    """A few whole cycles from the middle of a test, of at most about `most` samples."""
    window = zoom_window(drawn.test.displacement)
    every = 1 if most is None else max(1, (window.stop - window.start) // most)
    part = drawn.test.part(window.start, window.stop, every)
    return Prediction(test=part, model_force=drawn.model_force[window.start : window.stop : every])


def command_figure(drawn: Prediction) -> Figure:
    """A varying command over the whole record."""
    figure, axes = canvas.column_axes()
    commands(drawn, axes)
    finish_signed(axes)
    axes.set_xlim(float(drawn.test.time[0]), float(drawn.test.time[-1]))
    return figure


def shaded(figure: Figure, test: DamperTest) -> Figure:
    """A figure over the whole record with the part shaded that `few_cycles` enlarges."""
    window = zoom_window(test.displacement)
    for axes in figure.axes:
        ends = test.time[window.start], test.time[window.stop - 1]
        axes.axvspan(*ends, color=style.WINDOW, linewidth=0, zorder=-1)
    return figure


def loop_figure(drawn: Prediction, unit: str, over: Motion) -> Figure:
    """Force against displacement or velocity."""
    figure, axes = canvas.column_axes()
    axes.grid(True, axis="both")
    loops(drawn, axes, over=over, unit=unit)
    limit_force(axes, drawn, unit)
    finish_signed(axes)
    return figure


def small_loop(drawn: Prediction, unit: str, *, over: Motion, height: float = canvas.SMALL_HEIGHT) -> Figure:
    """Force over displacement or velocity in a few cycles, as one of four columns."""
    figure, axes = canvas.small_axes(height)
    loops(few_cycles(drawn, _SMALL_SAMPLES), axes, over=over, unit=unit, legend=False)
    limit_force(axes, drawn, unit)
    canvas.name_above(axes)
    return figure


def limit_force(axes: Axes, drawn: Prediction, unit: str) -> None:
    """The range of the data as the ordinate, opened for the model by half of that range at most on either side.

    A model far from the data must not compress them.
    """
    factor = style.force_unit(0.0, unit).factor
    force = drawn.test.force * factor
    low, high = float(np.nanmin(force)), float(np.nanmax(force))
    spread = (high - low) or 1.0
    model = drawn.model_force[np.isfinite(drawn.model_force)] * factor
    if model.size:
        least, most = float(model.min()), float(model.max())
        low, high = max(min(low, least), low - spread / 2), min(max(high, most), high + spread / 2)
    margin = 0.06 * spread
    axes.set_ylim(low - margin, high + margin)
