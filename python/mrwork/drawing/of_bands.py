"""Drawing of bands: the force of one cycle with the bands around it, and its error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.drawing import style
from mrwork.drawing.canvas import column_axes, draw_points, finish_signed, legend
from mrwork.drawing.of_tests import Motion, axis_values, data_label, even_samples
from mrwork.drawing.style import DisplayUnit
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.bands.band import Band
from mrwork.uncertainty.bands.prediction import Prediction

_POINTS = 130
_BAND_POINTS = 260
_ASPECT = 1.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Banded:
    """A test with the model force and the bands around it, over the samples that count; a band may be missing."""

    prediction: Prediction
    predicted: Band | None = None
    parameters: Band | None = None


def add_bands(axes: Axes, banded: Banded, unit: DisplayUnit, over: Motion | None = None) -> None:
    """Force over one cycle with the bands that exist, over time or along the loop over displacement or velocity."""
    samples, test = middle_cycle(banded.prediction), banded.prediction.test
    across = (test.time if over is None else axis_values(test, over)[0])[test.counted][samples]
    if over is None:
        _fill_over(axes, across, banded, samples, unit, np.zeros(across.size))
    elif banded.predicted is not None:
        _fill_loop(axes, across, banded.predicted, samples, unit)
    _draw_lines(axes, across, banded, samples, unit)


@style.drawn_in_style()
def error_figure(banded: Banded, unit: DisplayUnit) -> Figure:
    """Force minus model force over one cycle from the middle of the record, with the bands that exist."""
    samples, test = middle_cycle(banded.prediction), banded.prediction.test
    time = test.time[test.counted][samples]
    # Four entries of the legend need a second line.
    figure, axes = column_axes(top=0.56)
    residual = banded.prediction.residual[samples]
    ends = [end for band in (banded.predicted, banded.parameters) if band for end in (band.lower, band.upper)]
    largest = max(
        float(np.abs(end - banded.prediction.force).max()) for end in [*ends, banded.prediction.measured]
    )
    unit = style.residual_unit(largest, unit)
    _fill_over(axes, time, banded, samples, unit, banded.prediction.force[samples])
    drawn = _thin(time.size)
    axes.plot(
        time[drawn],
        residual[drawn] * unit.factor,
        color=style.INK,
        linewidth=1.0,
        label=data_label(test),
    )
    finish_signed(axes, f"Force minus model ({unit.symbol})", "Time (s)")
    axes.set_xlim(float(time[0]), float(time[-1]))
    legend(axes, columns=2)
    return figure


def middle_cycle(prediction: Prediction) -> slice:
    """The whole cycle in the middle of the samples that count; all of them where there is none."""
    cycles = whole_cycles(prediction.test.displacement[prediction.test.counted])
    if not cycles:
        return slice(0, prediction.force.size)
    chosen = cycles[len(cycles) // 2]
    return slice(chosen.start, chosen.stop + 1)


@style.drawn_in_style()
def loop_figure(banded: Banded, unit: DisplayUnit, over: Motion) -> Figure:
    """Force over displacement or velocity, one cycle, with its prediction band."""
    figure, axes = column_axes()
    axes.grid(True, axis="both")
    add_bands(axes, banded, unit, over)
    finish_signed(axes, f"Force ({unit.symbol})", axis_values(banded.prediction.test, over)[1])
    legend(axes)
    return figure


def _fill_over(
    axes: Axes, time: Floats, banded: Banded, samples: slice, unit: DisplayUnit, origin: Floats
) -> None:
    """Bands over time, less `origin` [N]."""
    drawn = _thin(time.size)
    for band, colour, width, zorder in (
        (banded.predicted, style.BAND, 0.0, 1.0),
        (banded.parameters, style.PARAMETER_BAND, 0.8, 2.1),
    ):
        if band is None:
            continue
        lower, upper = ((end[samples] - origin)[drawn] * unit.factor for end in (band.lower, band.upper))
        label = _legend_label(band)
        axes.fill_between(
            time[drawn], lower, upper, color=colour, linewidth=width, label=label, zorder=zorder
        )
        for end in (lower, upper) if band is banded.predicted else ():
            axes.plot(time[drawn], end, color=style.BAND_EDGE, linewidth=0.9, linestyle=style.DASHED)


def _fill_loop(axes: Axes, across: Floats, band: Band, samples: slice, unit: DisplayUnit) -> None:
    """A band along the loop: a polygon between each two samples, all of one colour."""
    drawn = _along(across, band.upper[samples])
    lower, upper = (end[samples][drawn] * unit.factor for end in (band.lower, band.upper))
    x = across[drawn]
    # All polygons have the same orientation: overlaps of opposite ones would leave holes.
    left = np.where(x[:-1] <= x[1:], np.arange(x.size - 1), np.arange(1, x.size))
    right = np.where(x[:-1] <= x[1:], np.arange(1, x.size), np.arange(x.size - 1))
    corners = [(left, lower), (right, lower), (right, upper), (left, upper), (left, lower)]
    vertices = np.stack([np.stack([x[at], end[at]], axis=-1) for at, end in corners], axis=1)
    codes = np.tile(
        np.array([Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY], dtype=np.uint8),
        len(left),
    )
    axes.add_patch(
        PathPatch(
            Path(vertices.reshape(-1, 2), codes),
            facecolor=style.BAND,
            edgecolor=style.BAND,
            linewidth=0.6,
            label=_legend_label(band),
        )
    )


def _draw_lines(axes: Axes, across: Floats, banded: Banded, samples: slice, unit: DisplayUnit) -> None:
    measured = banded.prediction.measured[samples] * unit.factor
    model = banded.prediction.force[samples] * unit.factor
    line = _along(across, model)
    axes.plot(across[line], model[line], color=style.MODEL, linewidth=1.2, label="model", zorder=2.3)
    drawn = even_samples(across, measured, _POINTS, aspect=_ASPECT)
    label = data_label(banded.prediction.test)
    draw_points(axes, across[drawn], measured[drawn], size=2.6, colour=style.INK, label=label, zorder=2.2)


def _along(across: Floats, up: Floats) -> NDArray[np.intp]:
    """Samples at equal steps along a line, with its end, so that a loop closes."""
    return np.union1d(even_samples(across, up, _BAND_POINTS, aspect=_ASPECT), [across.size - 1])


def _legend_label(band: Band) -> str:
    return f"{100 * band.level:.0f} % {'prediction' if band.kind == 'prediction' else 'parameters'}"


def _thin(count: int) -> NDArray[np.intp]:
    return np.unique(np.linspace(0, count - 1, min(count, _BAND_POINTS)).astype(np.intp))
