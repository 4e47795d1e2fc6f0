"""The figures of an identification: results in, a matplotlib `Figure` out, nothing global."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.identification.fit import Fit, SearchTrace
from mrwork.records.damper_test import DamperTest
from mrwork.report import style
from mrwork.report.comparison import Comparison
from mrwork.report.cycles import zoom_window
from mrwork.report.panels import (
    draw_convergence,
    draw_force,
    draw_loop,
    draw_repair,
    draw_residual,
    mark_window,
)
from mrwork.report.style import DisplayUnit

# Margins in inches: the same in every panel, so that panels set side by side share their axes' edges.
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.62, 0.20, 0.34, 0.5
_BETWEEN = 0.42
_RESIDUAL_SHARE = 0.3
_HEADING = 0.34


def common_force_unit(comparisons: Sequence[Comparison]) -> DisplayUnit:
    """One unit for all tests of a report, so that they can be compared by eye."""
    peaks = [float(np.nanmax(np.abs(comparison.test.force))) for comparison in comparisons]
    return style.force_unit(max(peaks, default=0.0))


def force_history(comparison: Comparison, unit: DisplayUnit | None = None) -> Figure:
    """Force against time with the residual below: the whole record, and a few cycles of it enlarged."""
    unit = unit or common_force_unit([comparison])
    with style.drawn_in_style():
        figure = _blank(columns=2, heading=_heading(comparison))
        _draw_record(figure, comparison, unit, column=0, columns=2)
        _draw_cycles(figure, comparison, unit, column=1, columns=2)
    return figure


def record_panel(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """The whole record and its residual, as one column."""
    with style.drawn_in_style():
        figure = _blank(columns=1)
        _draw_record(figure, comparison, unit, column=0, columns=1)
    return figure


def cycles_panel(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """A few cycles from the middle of the record and their residual, as one column."""
    with style.drawn_in_style():
        figure = _blank(columns=1)
        _draw_cycles(figure, comparison, unit, column=0, columns=1)
    return figure


def hysteresis_loops(comparison: Comparison, unit: DisplayUnit | None = None) -> Figure:
    """Force against displacement and against velocity: points of the test, line of the model."""
    unit = unit or common_force_unit([comparison])
    with style.drawn_in_style():
        figure = _blank(columns=2, heading=_heading(comparison))
        _draw_displacement_loop(_axes(figure, 0, 2), comparison, unit)
        _draw_velocity_loop(_axes(figure, 1, 2), comparison, unit)
    return figure


def displacement_loop(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """Force against displacement, as one column."""
    with style.drawn_in_style():
        figure = _blank(columns=1)
        _draw_displacement_loop(_axes(figure, 0, 1), comparison, unit)
    return figure


def velocity_loop(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """Force against velocity, as one column."""
    with style.drawn_in_style():
        figure = _blank(columns=1)
        _draw_velocity_loop(_axes(figure, 0, 1), comparison, unit)
    return figure


def repair_panel(test: DamperTest, original: DamperTest, unit: DisplayUnit) -> Figure:
    """Force against displacement before and after the repair of a test, as one column."""
    with style.drawn_in_style():
        figure = _blank(columns=1)
        draw_repair(_axes(figure, 0, 1), test, original, unit)
    return figure


def convergence(trace: SearchTrace, refined: float | None = None) -> Figure:
    """Best and median NRMSE of the population against evaluations, and where the refinement ended."""
    with style.drawn_in_style():
        figure = _blank(columns=1)
        draw_convergence(_axes(figure, 0, 1), trace, refined)
    return figure


def search_figure(fit: Fit) -> Figure:
    """The convergence of a fit's search, with its refined misfit if it was refined."""
    return convergence(fit.trace, fit.nrmse if fit.refinement_steps else None)


def run_figures(fit: Fit, comparisons: Sequence[Comparison]) -> dict[str, Figure]:
    """Every figure of a run by the name of its file; with several tests the name starts with the test's."""
    unit = common_force_unit(comparisons)
    figures = {"convergence": search_figure(fit)}
    for number, comparison in enumerate(comparisons, start=1):
        prefix = "" if len(comparisons) == 1 else f"{number:02d}_{_file_stem(comparison.test.name)}_"
        figures[f"{prefix}force_history"] = force_history(comparison, unit)
        figures[f"{prefix}hysteresis_loops"] = hysteresis_loops(comparison, unit)
        if comparison.test.original is not None:
            figures[f"{prefix}repair"] = repair_panel(comparison.test, comparison.test.original, unit)
    return figures


def _draw_record(
    figure: Figure, comparison: Comparison, unit: DisplayUnit, *, column: int, columns: int
) -> None:
    window = zoom_window(comparison.test.displacement)
    upper, lower = _history_axes(figure, column, columns)
    draw_force(upper, comparison, unit, None)
    draw_residual(lower, comparison, unit, None)
    mark_window(upper, comparison, window)
    mark_window(lower, comparison, window)


def _draw_cycles(
    figure: Figure, comparison: Comparison, unit: DisplayUnit, *, column: int, columns: int
) -> None:
    window = zoom_window(comparison.test.displacement)
    upper, lower = _history_axes(figure, column, columns)
    draw_force(upper, comparison, unit, window)
    draw_residual(lower, comparison, unit, window)


def _draw_displacement_loop(axes: Axes, comparison: Comparison, unit: DisplayUnit) -> None:
    scale = style.MILLIMETRE
    displacement = comparison.test.displacement * scale.factor
    draw_loop(axes, displacement, f"Displacement ({scale.symbol})", comparison, unit)


def _draw_velocity_loop(axes: Axes, comparison: Comparison, unit: DisplayUnit) -> None:
    scale = style.MILLIMETRE_PER_SECOND
    velocity = comparison.test.velocity * scale.factor
    draw_loop(axes, velocity, f"Velocity ({scale.symbol})", comparison, unit)


def _blank(*, columns: int, heading: str = "") -> Figure:
    height = style.PANEL_HEIGHT + (_HEADING if heading else 0.0)
    figure = Figure(figsize=(columns * style.PANEL_WIDTH, height))
    if heading:
        figure.text(
            _LEFT / (columns * style.PANEL_WIDTH), 1 - 0.12 / height, heading, va="top", fontweight="bold"
        )
    return figure


def _axes(figure: Figure, column: int, columns: int) -> Axes:
    return figure.add_axes(_rectangle(figure, column, columns, _BOTTOM, style.PANEL_HEIGHT - _TOP))


def _history_axes(figure: Figure, column: int, columns: int) -> tuple[Axes, Axes]:
    free = style.PANEL_HEIGHT - _TOP - _BOTTOM - _BETWEEN
    split = _BOTTOM + _RESIDUAL_SHARE * free
    lower = figure.add_axes(_rectangle(figure, column, columns, _BOTTOM, split))
    upper = figure.add_axes(
        _rectangle(figure, column, columns, split + _BETWEEN, style.PANEL_HEIGHT - _TOP), sharex=lower
    )
    upper.tick_params(labelbottom=False)
    return upper, lower


def _rectangle(
    figure: Figure, column: int, columns: int, bottom: float, top: float
) -> tuple[float, float, float, float]:
    """Axes from `bottom` to `top` [in] in one of the equal columns, as fractions of the figure."""
    width, height = columns * style.PANEL_WIDTH, float(figure.get_figheight())
    left = column * style.PANEL_WIDTH + _LEFT
    across = style.PANEL_WIDTH - _LEFT - _RIGHT
    return left / width, bottom / height, across / width, (top - bottom) / height


def _heading(comparison: Comparison) -> str:
    return comparison.test.name + (" (synthetic)" if comparison.test.synthetic else "")


def _file_stem(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._") or "test"
