"""Drawing of the prediction band: the force of one cycle with the band around it, over time or along its loop."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from mrwork.base.values import Floats
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, draw_points, finish_signed, legend
from mrwork.plots.of_tests import Motion, axis_values, data_label, even_samples
from mrwork.plots.style import DisplayUnit
from mrwork.records.motion import whole_cycles
from mrwork.uncertainty.bands.band import Band
from mrwork.uncertainty.bands.prediction import Prediction

_POINTS = 130
_BAND_POINTS = 260
_ASPECT = 1.4


def add_bands(
    axes: Axes, prediction: Prediction, band: Band, unit: DisplayUnit, over: Motion | None = None
) -> None:
    """Force over one cycle with its prediction band, over time or along the loop over displacement or velocity."""
    samples, test = middle_cycle(prediction), prediction.test
    across = (test.time if over is None else axis_values(test, over)[0])[test.counted][samples]
    measured, model, lower, upper = (
        force[samples] * unit.factor
        for force in (prediction.measured, prediction.force, band.lower, band.upper)
    )
    label = f"{100 * band.level:.0f} % prediction"
    if over is None:
        drawn = np.unique(np.linspace(0, across.size - 1, min(across.size, _BAND_POINTS)).astype(np.intp))
        ends = lower[drawn], upper[drawn]
        axes.fill_between(across[drawn], *ends, color=style.BAND, linewidth=0.0, label=label, zorder=1.0)
        for end in ends:
            axes.plot(across[drawn], end, color=style.BAND_EDGE, linewidth=0.9, linestyle=style.DASHED)
    else:
        drawn = _along(across, upper)
        _fill_loop(axes, across[drawn], lower[drawn], upper[drawn], label)
    line = _along(across, model)
    axes.plot(across[line], model[line], color=style.MODEL, linewidth=1.2, label="model", zorder=2.3)
    drawn = even_samples(across, measured, _POINTS, aspect=_ASPECT)
    points = across[drawn], measured[drawn]
    draw_points(axes, *points, size=2.6, colour=style.INK, label=data_label(test), zorder=2.2)


def middle_cycle(prediction: Prediction) -> slice:
    """The whole cycle in the middle of the samples that count; all of them where there is none."""
    cycles = whole_cycles(prediction.test.displacement[prediction.test.counted])
    if not cycles:
        return slice(0, prediction.force.size)
    chosen = cycles[len(cycles) // 2]
    return slice(chosen.start, chosen.stop + 1)


@style.drawn_in_style()
def loop_figure(prediction: Prediction, band: Band, unit: DisplayUnit, over: Motion) -> Figure:
    """Force over displacement or velocity, one cycle, with its prediction band."""
    figure, axes = column_axes()
    axes.grid(True, axis="both")
    add_bands(axes, prediction, band, unit, over)
    finish_signed(axes, f"Force ({unit.symbol})", axis_values(prediction.test, over)[1])
    legend(axes)
    return figure


def _fill_loop(axes: Axes, across: Floats, lower: Floats, upper: Floats, label: str) -> None:
    """A band along the loop: a polygon between each two samples, all of one colour."""
    first = np.arange(across.size - 1)
    # All polygons have the same orientation: overlaps of opposite ones would leave holes.
    rising = across[:-1] <= across[1:]
    left, right = np.where(rising, first, first + 1), np.where(rising, first + 1, first)
    corners = [(left, lower), (right, lower), (right, upper), (left, upper), (left, lower)]
    vertices = np.stack([np.stack([across[at], end[at]], axis=-1) for at, end in corners], axis=1)
    codes = np.tile(np.array([Path.MOVETO, *[Path.LINETO] * 3, Path.CLOSEPOLY], dtype=np.uint8), len(left))
    outline = Path(vertices.reshape(-1, 2), codes)
    patch = PathPatch(outline, facecolor=style.BAND, edgecolor=style.BAND, linewidth=0.6, label=label)
    axes.add_patch(patch)


def _along(across: Floats, up: Floats) -> NDArray[np.intp]:
    """Samples at equal steps along a line, with its end, so that a loop closes."""
    return np.union1d(even_samples(across, up, _BAND_POINTS, aspect=_ASPECT), [across.size - 1])
