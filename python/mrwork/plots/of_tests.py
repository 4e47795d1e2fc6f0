"""Figures of the tests of a fit: a test beside the force of its model, the samples that are drawn, and the drawings.

Figures are matplotlib `Figure` objects without global state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit, FitQuality
from mrwork.identification.result import free_run
from mrwork.plots import canvas, style
from mrwork.plots.canvas import axes_between, draw_points, finish_signed, legend
from mrwork.plots.style import DisplayUnit
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import upward_crossings
from mrwork.uncertainty.bands.prediction import Prediction


@array_dataclass()
class Comparison:
    """A test, the free-run `model_force` [N] on its samples, shape (n_time,), and how well they agree."""

    test: DamperTest
    model_force: Floats
    quality: FitQuality

    def __post_init__(self) -> None:
        expected = (self.test.n_time,)
        if self.model_force.shape != expected:
            raise SettingError(
                f"`model_force` has shape {self.model_force.shape}, test {self.test.name!r} has {expected}; "
                "simulate the model on the samples of that test"
            )

    @property
    def residual(self) -> Floats:
        """Measured minus model force [N], shape (n_time,)."""
        return self.test.force - self.model_force


def comparisons_of(fit: Fit, tests: Sequence[DamperTest]) -> tuple[Comparison, ...]:
    """The tests of a fit, each with the force that its model gives; simulated where the fit was read from its file."""
    theta = np.array(fit.theta)
    tests = [fit.observed(test) for test in tests]
    forces = fit.forces or tuple(
        free_run(fit.spec, theta, test, nuisances=fit.nuisances)[0] for test in tests
    )
    return tuple(
        Comparison(test=test, model_force=force, quality=quality)
        for test, force, quality in zip(tests, forces, fit.quality, strict=True)
    )


Simulated = Comparison | Prediction
"""A test with the force of a model on it."""


def data_label(test: DamperTest) -> str:
    """Name of the data of a test in a legend; synthetic data are never called measured."""
    return "synthetic" if test.synthetic else "measured"


def name_of(test: DamperTest) -> str:
    """Name of a test, which says where its data are synthetic."""
    return test.name + (" (synthetic)" if test.synthetic else "")


def envelope(time: Floats, signal: Floats, bins: int) -> tuple[Floats, Floats]:
    """The minimum and the maximum of a signal in each of `bins` intervals, in their order; keeps the peaks."""
    length = len(time) // bins
    if length < 3:
        return time, signal
    whole = length * bins
    parts = signal[:whole].reshape(bins, length)
    at = np.sort(np.stack([parts.argmin(axis=1), parts.argmax(axis=1)], axis=1), axis=1)
    index = np.append((at + length * np.arange(bins)[:, None]).ravel(), np.arange(whole, len(time)))
    return time[index], signal[index]


def strong_part(time: Floats, signal: Floats, seconds: float) -> slice:
    """The samples of an interval of `seconds` around the peak of a signal."""
    at = time[int(np.abs(signal).argmax())]
    end = min(max(at + seconds / 2.0, time[0] + seconds), time[-1])
    first, last = np.searchsorted(time, [end - seconds, end])
    return slice(int(first), int(last) + 1)


CYCLES_SHOWN = 3

_GOLDEN = 0.6180339887498949


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Samples start..stop-1 of a record; `first_cycle` counts from 1 and is `None` without cycles."""

    start: int
    stop: int
    first_cycle: int | None
    n_cycles: int

    @property
    def samples(self) -> slice:
        """The window as a slice."""
        return slice(self.start, self.stop)

    @property
    def in_words(self) -> str:
        """Numbers of the cycles."""
        if self.first_cycle is None:
            return "Middle of the record"
        last = self.first_cycle + self.n_cycles - 1
        return f"Cycles {self.first_cycle} to {last}" if self.n_cycles > 1 else f"Cycle {last}"


def zoom_window(displacement: Floats) -> Window:
    """A few whole cycles from the middle of a record, or its middle third where it has none.

    At most half of the cycles are shown, so that the window enlarges the record.
    """
    n_time = displacement.size
    crossings = upward_crossings(displacement)
    complete = crossings.size - 1
    shown = min(CYCLES_SHOWN, (complete + 1) // 2)
    if shown < 1:
        third = n_time // 3
        return Window(start=third, stop=max(n_time - third, third + 1), first_cycle=None, n_cycles=0)
    first = (complete - shown) // 2
    return Window(
        start=int(crossings[first]),
        stop=int(crossings[first + shown]) + 1,
        first_cycle=first + 1,
        n_cycles=shown,
    )


def even_samples(abscissa: Floats, ordinate: Floats, most: int, *, aspect: float) -> NDArray[np.intp]:
    """At most `most` samples at equal steps along the drawn curve, shape (n_drawn,).

    Equal steps in time would crowd where the curve is flat and leave gaps where it is steep. `aspect`
    is the width of the drawing over its height.
    """
    return _nearest_samples(abscissa, ordinate, np.arange(most) / most, aspect)


def scattered_samples(abscissa: Floats, ordinate: Floats, most: int) -> NDArray[np.intp]:
    """At most `most` samples spread along a loop that is passed many times, shape (n_drawn,).

    Equal steps can coincide with the cycles and draw the same few points repeatedly; a reproducible
    golden-ratio jitter within each step avoids that.
    """
    number = np.arange(most)
    return _nearest_samples(abscissa, ordinate, (number + number * _GOLDEN % 1.0) / most, 1.0)


def _nearest_samples(abscissa: Floats, ordinate: Floats, shares: Floats, aspect: float) -> NDArray[np.intp]:
    """The samples at `shares` of the length of the curve, each sample once."""
    if ordinate.size <= shares.size:
        return np.arange(ordinate.size)
    across = aspect * np.diff(abscissa) / (float(np.ptp(abscissa)) or 1.0)
    up = np.diff(ordinate) / (float(np.ptp(ordinate)) or 1.0)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(across, up))))
    return np.unique(np.minimum(np.searchsorted(along, shares * along[-1]), ordinate.size - 1))


POINTS_IN_WINDOW = 150
POINTS_IN_LOOP = 600
POINTS_IN_SMALL_LOOP = 400

# Inches between a force history and its residual below, the residual's share of the height, and a line of heading.
_BETWEEN = 0.42
_RESIDUAL_SHARE = 0.3
_HEADING = 0.34
# The panels of a history are wide for their height.
_HISTORY_ASPECT = 3.0
_POINT = 2.8

Motion = Literal["displacement", "velocity"]
"""What a force is drawn against."""
Abscissa = Literal["time"] | Motion
AXES: dict[Abscissa, DisplayUnit] = {
    "time": DisplayUnit(symbol="s", factor=1.0),
    "displacement": style.MILLIMETRE,
    "velocity": style.MILLIMETRE_PER_SECOND,
}

Drawing = Callable[[Figure, int, Comparison, DisplayUnit], None]
"""Draws a test into the column of a figure with this number."""


def common_force_unit(comparisons: Sequence[Simulated]) -> DisplayUnit:
    """One unit for all tests of a report, so that their figures are comparable."""
    peaks = [float(np.nanmax(np.abs(comparison.test.force))) for comparison in comparisons]
    return style.force_unit(max(peaks, default=0.0))


def force_history(comparison: Comparison, unit: DisplayUnit | None = None) -> Figure:
    """Force against time with the residual below: the whole record, and a few cycles of it enlarged."""
    return _with_heading(comparison, unit, draw_record, draw_cycles)


def hysteresis_loops(comparison: Comparison, unit: DisplayUnit | None = None) -> Figure:
    """Force against displacement and against velocity: points of the test, line of the model."""
    return _with_heading(comparison, unit, partial(draw_loop, "displacement"), partial(draw_loop, "velocity"))


@style.drawn_in_style()
def repair_panel(test: DamperTest, original: DamperTest, unit: DisplayUnit) -> Figure:
    """Force against displacement before and after the repair of a test, as one column."""
    figure, axes = canvas.column_axes()
    axes.grid(True, axis="both")
    scale = style.MILLIMETRE
    for drawn, colour, width, label in (
        (original, style.DATA, 1.6, "as recorded"),
        (test, style.RESIDUAL, 0.9, "repaired"),
    ):
        stroke, force = drawn.displacement * scale.factor, drawn.force * unit.factor
        axes.plot(stroke, force, color=colour, linewidth=width, label=label)
    finish_signed(axes, f"Force ({unit.symbol})", f"Displacement ({scale.symbol})")
    legend(axes)
    return figure


@style.drawn_in_style()
def figure_of_test(
    comparison: Comparison, unit: DisplayUnit, *drawings: Drawing, heading: str = ""
) -> Figure:
    """Drawings of a test as a figure, a column each, below its heading if it has one."""
    width, room = len(drawings) * style.PANEL_WIDTH, _HEADING if heading else 0.0
    figure = Figure(figsize=(width, style.PANEL_HEIGHT + room))
    if heading:
        top = 1 - 0.12 / figure.get_figheight()
        figure.text(canvas.LEFT / width, top, heading, va="top", fontweight="bold")
    for column, draw in enumerate(drawings):
        draw(figure, column, comparison, unit)
    return figure


def _with_heading(comparison: Comparison, unit: DisplayUnit | None, *drawings: Drawing) -> Figure:
    unit = unit or common_force_unit([comparison])
    return figure_of_test(comparison, unit, *drawings, heading=name_of(comparison.test))


def draw_record(figure: Figure, column: int, comparison: Comparison, unit: DisplayUnit) -> None:
    """The whole record as lines; the part that the next panel enlarges is shaded."""
    test = comparison.test
    upper, lower = _history_axes(figure, column)
    add_record(upper, test, comparison.model_force, unit)
    _finish_force(upper, comparison, unit)
    _draw_residual(lower, comparison, unit, slice(0, test.n_time), linewidth=0.8)
    for axes in (upper, lower):
        _shade_window(axes, test)


def _shade_window(axes: Axes, test: DamperTest) -> None:
    """Shade the part of a record that another panel enlarges."""
    window = zoom_window(test.displacement)
    ends = test.time[window.start], test.time[window.stop - 1]
    axes.axvspan(*ends, color=style.WINDOW, linewidth=0, zorder=-1)


def add_record(axes: Axes, test: DamperTest, model_force: Floats | None, unit: DisplayUnit) -> None:
    """Lines of the force of a whole record and, where there is one, of the model."""
    axes.plot(test.time, test.force * unit.factor, color=style.DATA, linewidth=1.7, label=data_label(test))
    if model_force is not None:
        axes.plot(test.time, model_force * unit.factor, color=style.MODEL, linewidth=0.8, label="model")


def draw_cycles(figure: Figure, column: int, comparison: Comparison, unit: DisplayUnit) -> None:
    """A few cycles: points of the record under the line of the model."""
    test, window = comparison.test, zoom_window(comparison.test.displacement)
    upper, lower = _history_axes(figure, column)
    time = test.time[window.samples]
    measured = test.force[window.samples] * unit.factor
    drawn = even_samples(time, measured, POINTS_IN_WINDOW, aspect=_HISTORY_ASPECT)
    draw_points(upper, time[drawn], measured[drawn], size=_POINT, label=data_label(test))
    model = comparison.model_force[window.samples] * unit.factor
    upper.plot(time, model, color=style.MODEL, linewidth=1.4, label="model")
    _finish_force(upper, comparison, unit)
    _draw_residual(lower, comparison, unit, window.samples, linewidth=1.1)


def draw_command(figure: Figure, column: int, comparison: Comparison, unit: DisplayUnit) -> None:
    """A varying command over the whole record, held between samples; the part of `draw_cycles` is shaded."""
    test = comparison.test
    axes = _axes(figure, column, canvas.BOTTOM, style.PANEL_HEIGHT - canvas.TOP)
    command, symbol = next(command for command in test.commands if command.varies)
    add_command(axes, test.time, np.asarray(command))
    finish_signed(axes, f"Command ({symbol})", "Time (s)")
    _shade_window(axes, test)
    axes.set_xlim(float(test.time[0]), float(test.time[-1]))


def add_command(axes: Axes, time: Floats, command: Floats) -> None:
    """Line of a command that is held between samples."""
    axes.plot(time, command, color=style.DATA, linewidth=1.1, drawstyle="steps-post")


def _draw_residual(
    axes: Axes, comparison: Comparison, unit: DisplayUnit, samples: slice, *, linewidth: float
) -> None:
    """Measured minus model force against time, on one scale for every window of a record."""
    time = comparison.test.time[samples]
    unit = style.residual_unit(_largest(comparison.residual), unit)
    residual = comparison.residual * unit.factor
    add_residual(axes, time, residual[samples], linewidth=linewidth)
    largest = _largest(residual) or 1.0
    axes.set_ylim(-1.1 * largest, 1.1 * largest)
    finish_signed(axes, f"Residual ({unit.symbol})", "Time (s)", y_bins=3)
    margin = 0.0 if time.size > 1 else 0.5
    axes.set_xlim(float(time[0]) - margin, float(time[-1]) + margin)


def add_residual(axes: Axes, time: Floats, residual: Floats, *, linewidth: float = 0.8) -> None:
    """Line of a residual over time."""
    axes.plot(time, residual, color=style.RESIDUAL, linewidth=linewidth)


def axis_values(test: DamperTest, over: Abscissa) -> tuple[Floats, str]:
    """Time or motion of a test in units of its name on an axis, shape (n_time,), and that name."""
    return getattr(test, over) * AXES[over].factor, axis_name(over)


def axis_name(over: Abscissa) -> str:
    """Name of an axis with its unit."""
    return f"{over.capitalize()} ({AXES[over].symbol})"


def draw_loop(over: Motion, figure: Figure, column: int, comparison: Comparison, unit: DisplayUnit) -> None:
    """Force against displacement or velocity: points of the record under the line of the model."""
    abscissa, label = axis_values(comparison.test, over)
    axes = _axes(figure, column, canvas.BOTTOM, style.PANEL_HEIGHT - canvas.TOP)
    axes.grid(True, axis="both")
    add_loop(axes, abscissa, comparison.test, comparison.model_force, unit)
    _finish_force(axes, comparison, unit)
    axes.set_xlabel(label)


def add_loop(
    axes: Axes,
    abscissa: Floats,
    test: DamperTest,
    model_force: Floats | None,
    unit: DisplayUnit,
    *,
    colours: tuple[str, str] = (style.DATA, style.MODEL),
    labels: tuple[str, str] | None = None,
) -> None:
    """Points of the force of a test over an abscissa, shape (n_time,), and the line of the model, if there is one."""
    data, model = labels or (data_label(test), "model")
    measured = test.force * unit.factor
    drawn = scattered_samples(abscissa, measured, POINTS_IN_LOOP)
    draw_points(axes, abscissa[drawn], measured[drawn], size=_POINT, colour=colours[0], label=data)
    if model_force is not None:
        axes.plot(abscissa, model_force * unit.factor, color=colours[1], linewidth=1.1, label=model)


def small_loops(
    comparisons: Sequence[Simulated],
    unit: DisplayUnit,
    *,
    over: Motion = "velocity",
    height: float = canvas.SMALL_HEIGHT,
) -> Iterator[Figure]:
    """Force over displacement or velocity in a few cycles as one of four columns: the data as a line under the model.

    A figure for each test, on the same axes, because new axes take longer than what is drawn on them: save a figure
    before the next is requested.
    """
    with style.drawn_in_style():
        figure, axes = canvas.small_axes(labelled=True, height=height)
        (data,) = axes.plot([], [], color=style.DATA, linewidth=2.2, label="data")
        (model,) = axes.plot([], [], color=style.MODEL, linewidth=0.9, label="model")
    for comparison in comparisons:
        samples = zoom_window(comparison.test.displacement).samples
        motion, name = axis_values(comparison.test, over)
        motion = motion[samples]
        with style.drawn_in_style():
            canvas.name_small_axes(axes, f"Force ({unit.symbol})", name)
        for line, force in ((data, comparison.test.force), (model, comparison.model_force)):
            shown = force[samples] * unit.factor
            drawn = even_samples(motion, shown, POINTS_IN_SMALL_LOOP, aspect=1.0)
            line.set_data(motion[drawn], shown[drawn])
        margin = 0.05 * (float(np.ptp(motion)) or 1.0)
        axes.set_xlim(float(motion.min()) - margin, float(motion.max()) + margin)
        axes.set_ylim(*_limits_of(comparison, unit))
        yield figure


def _finish_force(axes: Axes, comparison: Comparison, unit: DisplayUnit) -> None:
    axes.set_ylim(*_limits_of(comparison, unit))
    finish_signed(axes, f"Force ({unit.symbol})")
    legend(axes)


def _history_axes(figure: Figure, column: int) -> tuple[Axes, Axes]:
    """Axes of a force history and, below, of its residual."""
    free = style.PANEL_HEIGHT - canvas.TOP - canvas.BOTTOM - _BETWEEN
    split = canvas.BOTTOM + _RESIDUAL_SHARE * free
    lower = _axes(figure, column, canvas.BOTTOM, split)
    upper = _axes(figure, column, split + _BETWEEN, style.PANEL_HEIGHT - canvas.TOP, sharex=lower)
    upper.tick_params(labelbottom=False)
    return upper, lower


def _axes(figure: Figure, column: int, bottom: float, top: float, sharex: Axes | None = None) -> Axes:
    left, right = column * style.PANEL_WIDTH + canvas.LEFT, (column + 1) * style.PANEL_WIDTH - canvas.RIGHT
    return axes_between(figure, left=left, right=right, bottom=bottom, top=top, sharex=sharex)


def _limits_of(comparison: Simulated, unit: DisplayUnit) -> tuple[float, float]:
    """The range of the data, opened for the model by half of that range at most on either side.

    A model far from the data must not compress them.
    """
    measured = comparison.test.force * unit.factor
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    spread = (high - low) or 1.0
    model = comparison.model_force[np.isfinite(comparison.model_force)] * unit.factor
    if model.size:
        low = max(min(low, float(model.min())), low - spread / 2)
        high = min(max(high, float(model.max())), high + spread / 2)
    margin = 0.06 * spread
    return low - margin, high + margin


def _largest(values: Floats) -> float:
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
