"""Figures of residuals: autocorrelation, normal quantiles, and residuals over what they may depend on."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator
from numpy.typing import NDArray

from mrwork.report import style
from mrwork.report.comparison import Comparison
from mrwork.report.cycles import scattered_samples
from mrwork.report.fit.canvas import column_axes
from mrwork.report.fit.residual_tests import autocorrelation
from mrwork.report.panels import finish, legend
from mrwork.report.style import DisplayUnit
from mrwork.uncertainty.bands.prediction import Prediction, mean_cycle

Array = NDArray[np.float64]

_POINTS = 350
_QUANTILES = 120
_BINS = 24
_LEAST_LAGS = 40
_LINE_POINTS = 300


def autocorrelation_figure(comparison: Comparison) -> Figure:
    """Autocorrelation over a cycle and a half, with the limits within which 95 % of that of white noise lies."""
    test = comparison.test
    residual = comparison.residual[test.counted]
    cycle = mean_cycle(test)
    lags = int(min(max(1.5 * cycle, _LEAST_LAGS), residual.size // 2))
    rho = autocorrelation(residual, lags)
    drawn = np.unique(np.linspace(0, lags, _LINE_POINTS).astype(int))
    limit = 1.96 / np.sqrt(residual.size)
    with style.drawn_in_style():
        figure, axes = column_axes()
        axes.axhspan(-limit, limit, color=style.BAND, linewidth=0, label="95 % of white noise")
        axes.plot(drawn * test.dt, rho[drawn], color=style.RESIDUAL, linewidth=1.4, label="residual")
        if cycle < lags:
            axes.axvline(cycle * test.dt, color=style.FAINT_INK, linewidth=0.9, linestyle=(0, (1.2, 1.8)))
            axes.text(
                cycle * test.dt, 1.13, "one cycle", ha="center", va="top", fontsize=style.SMALL_TEXT_SIZE
            )
        axes.set_ylim(min(-0.25, float(rho.min()) - 0.08), 1.12)
        axes.set_xlim(0.0, lags * test.dt)
        finish(axes, "Autocorrelation")
        axes.set_xlabel("Lag (s)")
        legend(axes)
    return figure


def quantile_figure(comparison: Comparison) -> Figure:
    """Sorted residuals, in their deviation, against what normal ones would be."""
    from scipy.special import ndtr, ndtri

    residual = np.sort(comparison.residual[comparison.test.counted])
    share = (np.arange(residual.size) + 0.5) / residual.size
    ends = np.asarray(ndtri(share[[0, -1]]))
    drawn = np.unique(
        np.searchsorted(share, ndtr(np.linspace(ends[0], ends[1], _QUANTILES))).clip(0, residual.size - 1)
    )
    expected = ndtri(share[drawn])
    found = (residual[drawn] - residual.mean()) / (float(np.std(residual)) or 1.0)
    with style.drawn_in_style():
        figure, axes = column_axes()
        axes.plot(ends, ends, color=style.FAINT_INK, linewidth=1.0, label="normal")
        axes.plot(
            expected,
            found,
            linestyle="none",
            marker="o",
            markersize=3.2,
            markerfacecolor=style.RESIDUAL,
            markeredgewidth=0,
            label="residual",
        )
        finish(axes, "Residual / deviation")
        axes.set_xlabel("Normal quantile")
        legend(axes)
    return figure


def phase_figure(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """Residual over the phase of the motion, 0 where it is farthest out."""
    prediction = Prediction(test=comparison.test, model_force=comparison.model_force)
    return _over(np.degrees(prediction.phase), "Phase of the motion (°)", comparison, unit, degrees=True)


def displacement_figure(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """Residual over displacement."""
    x = comparison.test.displacement[comparison.test.counted] * style.MILLIMETRE.factor
    return _over(x, f"Displacement ({style.MILLIMETRE.symbol})", comparison, unit)


def velocity_figure(comparison: Comparison, unit: DisplayUnit) -> Figure:
    """Residual over velocity."""
    scale = style.MILLIMETRE_PER_SECOND
    v = comparison.test.velocity[comparison.test.counted] * scale.factor
    return _over(v, f"Velocity ({scale.symbol})", comparison, unit)


def _over(
    abscissa: Array, label: str, comparison: Comparison, unit: DisplayUnit, *, degrees: bool = False
) -> Figure:
    residual = comparison.residual[comparison.test.counted]
    unit = style.residual_unit(float(np.max(np.abs(residual), initial=0.0)), unit)
    residual = residual * unit.factor
    drawn = scattered_samples(abscissa, residual, _POINTS)
    centre, mean = _means(abscissa, residual)
    with style.drawn_in_style():
        figure, axes = column_axes()
        axes.plot(
            abscissa[drawn],
            residual[drawn],
            linestyle="none",
            marker="o",
            markersize=2.6,
            markerfacecolor=style.DATA,
            markeredgewidth=0,
            label="residual",
        )
        axes.plot(centre, mean, color=style.RESIDUAL, linewidth=1.8, label="mean")
        finish(axes, f"Residual ({unit.symbol})")
        if degrees:
            axes.set_xlim(-180, 180)
            axes.xaxis.set_major_locator(FixedLocator([-180, -90, 0, 90, 180]))
        axes.set_xlabel(label)
        legend(axes)
    return figure


def _means(abscissa: Array, residual: Array) -> tuple[Array, Array]:
    """Mean residual in equal bins of the abscissa that have samples."""
    edges = np.linspace(abscissa.min(), abscissa.max(), _BINS + 1)
    index = np.clip(np.searchsorted(edges, abscissa, side="right") - 1, 0, _BINS - 1)
    count = np.bincount(index, minlength=_BINS)
    total = np.bincount(index, weights=residual, minlength=_BINS)
    filled = count > 0
    return 0.5 * (edges[:-1] + edges[1:])[filled], total[filled] / count[filled]
