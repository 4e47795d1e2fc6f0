"""Figures of draws: trace, ranks and pairs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator
from numpy.typing import NDArray

from mrwork.report import style
from mrwork.report.fit.canvas import small_axes
from mrwork.report.numbers import shortest
from mrwork.uncertainty.posterior.draws_file import StoredDraws

Array = NDArray[np.float64]

_POINTS = 120
_GROUPS = 4
_RANK_BINS = 16
_GROUP_COLOURS = (style.MODEL, style.RESIDUAL, style.FAINT_INK, style.PARAMETER_BAND)
# Of the corner: inches of a panel, cells of a density and their smoothing.
_SIDE, _EDGE = 1.35, 0.85
_CELLS = 32
_SMOOTH = 1.2


def trace_figure(name: str, chain: Array) -> Figure:
    """Quantiles of the walkers over the steps kept, and two of them, of draws (n_walkers, n_kept)."""
    kept = np.unique(np.linspace(0, chain.shape[1] - 1, _POINTS).astype(int))
    lower, median, upper = np.quantile(chain[:, kept], [0.05, 0.5, 0.95], axis=0)
    with style.drawn_in_style():
        figure, axes = small_axes()
        axes.fill_between(kept, lower, upper, color=style.BAND, linewidth=0)
        for walker in chain[[0, -1]]:
            axes.plot(kept, walker[kept], color=style.DATA, linewidth=0.6)
        axes.plot(kept, median, color=style.MODEL, linewidth=1.3)
        axes.set_xlim(0, max(int(kept[-1]), 1))
        _plain(axes, name)
    return figure


def rank_figure(name: str, chain: Array, ess: float) -> Figure:
    """Share of each sixteenth of the ranks in four groups of walkers, draws of shape (n_walkers, n_kept)."""
    from scipy.stats import rankdata

    rank = rankdata(chain).reshape(chain.shape) / chain.size
    groups = np.array_split(rank, _GROUPS)
    # A group has a fourth of the effective draws; their counts scatter as those of independent ones.
    spread = 1.96 * np.sqrt(_RANK_BINS / max(ess / _GROUPS, 1.0))
    with style.drawn_in_style():
        figure, axes = small_axes()
        axes.axhspan(1.0 - spread, 1.0 + spread, color=style.BAND, linewidth=0)
        for group, colour in zip(groups, _GROUP_COLOURS, strict=True):
            count, edges = np.histogram(group, bins=_RANK_BINS, range=(0.0, 1.0))
            axes.stairs(count * _RANK_BINS / group.size, edges, color=colour, linewidth=1.1, baseline=None)
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.0, 2.0)
        _plain(axes, name)
    return figure


def corner_figure(draws: StoredDraws, fitted: Mapping[str, float]) -> Figure:
    """Density of every parameter on the diagonal, of every pair below it; a cross where the fit is."""
    names = [each.name for each in draws.varied]
    values = [draws.chains[name].reshape(-1) for name in names]
    count = len(names)
    size = count * _SIDE + _EDGE
    # Outliers would press the rest into a corner.
    spans = [
        (float(low), float(high)) for low, high in (np.quantile(each, [0.002, 0.998]) for each in values)
    ]
    with style.drawn_in_style():
        figure = Figure(figsize=(size, size - _EDGE + 0.75))
        height = float(figure.get_figheight())
        for row in range(count):
            for column in range(row + 1):
                axes = figure.add_axes(
                    (
                        (_EDGE + column * _SIDE) / size,
                        (0.65 + (count - 1 - row) * _SIDE) / height,
                        (_SIDE - 0.1) / size,
                        (_SIDE - 0.1) / height,
                    )
                )
                if row == column:
                    _density(axes, values[row], spans[row], fitted.get(names[row]))
                else:
                    at = (fitted.get(names[column]), fitted.get(names[row]))
                    _pair(axes, values[column], values[row], spans[column], spans[row], at)
                _label(
                    axes, names[column] if row == count - 1 else "", names[row] if column == 0 < row else ""
                )
    return figure


def _density(axes: Axes, values: Array, span: tuple[float, float], fitted: float | None) -> None:
    count, edges = np.histogram(values, bins=_CELLS, range=span)
    axes.stairs(count, edges, fill=True, color=style.BAND_EDGE)
    if fitted is not None:
        axes.axvline(fitted, color=style.RESIDUAL, linewidth=1.0)
    axes.set_xlim(*span)
    axes.set_ylim(0.0, 1.08 * count.max())
    axes.yaxis.set_major_locator(NullLocator())


def _pair(
    axes: Axes,
    first: Array,
    second: Array,
    across: tuple[float, float],
    up: tuple[float, float],
    fitted: tuple[float | None, float | None],
) -> None:
    from scipy.ndimage import gaussian_filter

    count, x, y = np.histogram2d(first, second, bins=_CELLS, range=(across, up))
    smooth = gaussian_filter(count, _SMOOTH)
    ordered = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(held, share)]) for share in (0.9, 0.5)]
    if levels[0] < levels[1] < ordered[0]:
        centres = (0.5 * (x[:-1] + x[1:]), 0.5 * (y[:-1] + y[1:]))
        colours = ListedColormap([style.BAND, style.BAND_EDGE])
        axes.contourf(*centres, smooth.T, levels=[*levels, ordered[0] * 1.01], cmap=colours)
    if fitted[0] is not None and fitted[1] is not None:
        axes.plot(fitted[0], fitted[1], marker="+", markersize=8, markeredgewidth=1.2, color=style.RESIDUAL)
    axes.set_xlim(*across)
    axes.set_ylim(*up)


def _label(axes: Axes, below: str, left: str) -> None:
    axes.grid(False)
    axes.tick_params(labelbottom=bool(below), labelleft=bool(left))
    for axis, name in ((axes.xaxis, below), (axes.yaxis, left)):
        if name:
            axis.set_major_locator(MaxNLocator(nbins=2, steps=[1, 2, 4, 5, 10], prune="upper"))
            axis.set_major_formatter(FuncFormatter(lambda value, _: shortest(value)))
            axis.set_label_text(name)


def _plain(axes: Axes, name: str) -> None:
    axes.set_title(name, loc="left", pad=6)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: shortest(value, 5)))
