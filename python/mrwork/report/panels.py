"""What is drawn into one set of axes: a force history, its residual, a loop, the search."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from mrwork.identification.fit import SearchTrace
from mrwork.records.damper_test import DamperTest
from mrwork.report import style
from mrwork.report.comparison import Comparison
from mrwork.report.cycles import Window, even_samples, scattered_samples
from mrwork.report.style import DisplayUnit

POINTS_IN_WINDOW = 150
POINTS_IN_LOOP = 600

# The panels of a history are wide for their height; see the sizes in `figures`.
_HISTORY_ASPECT = 3.0
_LEGEND_GAP = 0.07

_NO_BREAK_SPACE = "\N{NO-BREAK SPACE}"


def draw_force(axes: Axes, comparison: Comparison, unit: DisplayUnit, window: Window | None) -> None:
    """Force against time: the whole record as lines, or the points of `window` under the model line."""
    test = comparison.test
    samples = slice(0, test.n_time) if window is None else window.samples
    time = test.time[samples]
    measured = test.force[samples] * unit.factor
    model = comparison.model_force[samples] * unit.factor
    if window is None:
        axes.plot(time, measured, color=style.DATA, linewidth=1.7, label=comparison.data_label)
        axes.plot(time, model, color=style.MODEL, linewidth=0.8, label="model")
    else:
        drawn = even_samples(time, measured, POINTS_IN_WINDOW, aspect=_HISTORY_ASPECT)
        _draw_points(axes, time[drawn], measured[drawn], comparison.data_label)
        axes.plot(time, model, color=style.MODEL, linewidth=1.4, label="model")
    axes.set_ylim(*_limits_of(comparison, unit))
    finish(axes, f"Force ({unit.symbol})")
    legend(axes)


def draw_residual(axes: Axes, comparison: Comparison, unit: DisplayUnit, window: Window | None) -> None:
    """Measured minus model force against time, on one scale for every window of a record."""
    test = comparison.test
    samples = slice(0, test.n_time) if window is None else window.samples
    unit = style.residual_unit(_largest(comparison.residual), unit)
    residual = comparison.residual * unit.factor
    axes.plot(
        test.time[samples], residual[samples], color=style.RESIDUAL, linewidth=0.8 if window is None else 1.1
    )
    largest = _largest(residual) or 1.0
    axes.set_ylim(-1.1 * largest, 1.1 * largest)
    finish(axes, f"Residual ({unit.symbol})", y_bins=3)
    axes.set_xlabel("Time (s)")
    axes.set_xlim(*_span(test.time[samples]))


def mark_window(axes: Axes, comparison: Comparison, window: Window) -> None:
    """A faint band over the part of the record that another panel enlarges."""
    time = comparison.test.time
    axes.axvspan(time[window.start], time[window.stop - 1], color=style.WINDOW, linewidth=0, zorder=-1)


def draw_loop(
    axes: Axes,
    abscissa: NDArray[np.float64],
    label: str,
    comparison: Comparison,
    unit: DisplayUnit,
) -> None:
    """Force against `abscissa`, shape (n_time,), in the units of its `label`: points and model line."""
    axes.grid(True, axis="both")
    measured = comparison.test.force * unit.factor
    drawn = scattered_samples(abscissa, measured, POINTS_IN_LOOP)
    _draw_points(axes, abscissa[drawn], measured[drawn], comparison.data_label)
    axes.plot(abscissa, comparison.model_force * unit.factor, color=style.MODEL, linewidth=1.1, label="model")
    axes.set_ylim(*_limits_of(comparison, unit))
    finish(axes, f"Force ({unit.symbol})")
    axes.set_xlabel(label)
    legend(axes)


def draw_repair(axes: Axes, test: DamperTest, original: DamperTest, unit: DisplayUnit) -> None:
    """Loops of a test before and after its repair, as lines."""
    axes.grid(True, axis="both")
    scale = style.MILLIMETRE
    for drawn, colour, width, label in (
        (original, style.DATA, 1.6, "as it came"),
        (test, style.RESIDUAL, 0.9, "repaired"),
    ):
        axes.plot(
            drawn.displacement * scale.factor,
            drawn.force * unit.factor,
            color=colour,
            linewidth=width,
            label=label,
        )
    finish(axes, f"Force ({unit.symbol})")
    axes.set_xlabel(f"Displacement ({scale.symbol})")
    legend(axes)


def draw_convergence(axes: Axes, trace: SearchTrace, refined: float | None) -> None:
    """Best and median misfit against evaluations, logarithmic; a dotted line marks the refined misfit."""
    evaluations = np.asarray(trace.evaluations, dtype=np.float64)
    best, median = _positive(trace.best), _positive(trace.median)
    marker = "o" if evaluations.size < 2 else ""
    axes.plot(
        evaluations, median, color=style.DATA, linewidth=1.5, marker=marker, markersize=4, label="median"
    )
    axes.plot(evaluations, best, color=style.MODEL, linewidth=1.7, marker=marker, markersize=4, label="best")
    seen = [best[np.isfinite(best)], median[np.isfinite(median)]]
    if refined is not None and np.isfinite(refined) and refined > 0:
        axes.axhline(refined, color=style.RESIDUAL, linewidth=1.2, linestyle=(0, (1.2, 1.8)), label="refined")
        seen.append(np.asarray([refined]))
    axes.set_title("NRMSE", loc="left", pad=7)
    axes.set_xlabel("Simulated candidates")
    axes.set_xlim(0, 1.04 * float(evaluations.max(initial=1)))
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))
    axes.xaxis.set_major_formatter(FuncFormatter(_count))
    logarithmic(axes, np.concatenate(seen))
    if evaluations.size == 0:
        axes.text(0.5, 0.5, "no generation was finished", transform=axes.transAxes, ha="center")
    legend(axes)


def _count(value: float, _: int | None) -> str:
    # The figure fonts have the wide no-break space; not all have the narrow one.
    text = f"{value:,.0f}"
    return text.replace(",", _NO_BREAK_SPACE if value >= 1e4 else "")


def logarithmic(axes: Axes, values: NDArray[np.float64]) -> None:
    """A logarithmic ordinate for positive `values`, with ticks wherever they are."""
    axes.set_yscale("log")
    low, high = (float(values.min()), float(values.max())) if values.size else (0.1, 1.0)
    margin = (high / low) ** 0.08 if high > low else 1.2
    low, high = low / margin, high * margin
    axes.set_ylim(low, high)
    decades = np.log10(high / low)
    if decades < 0.7:
        # 1-2-5 ticks may miss so short a range altogether: even ticks read well on it.
        ticks = MaxNLocator(nbins=4, steps=[1, 2, 5, 10]).tick_values(low, high)
        axes.yaxis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    else:
        subdivisions = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
        axes.yaxis.set_major_locator(LogLocator(subs=subdivisions, numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_points(axes: Axes, abscissa: NDArray[np.float64], force: NDArray[np.float64], label: str) -> None:
    axes.plot(
        abscissa,
        force,
        linestyle="none",
        marker="o",
        markersize=2.8,
        markerfacecolor=style.DATA,
        markeredgewidth=0,
        label=label,
    )


def finish(axes: Axes, title: str, y_bins: int = 6) -> None:
    """Title, ticks and a line at zero."""
    axes.set_title(title, loc="left", pad=7)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=y_bins, steps=[1, 2, 2.5, 5, 10], symmetric=y_bins == 3))
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)


def legend(axes: Axes, columns: int = 3) -> None:
    """A legend above the axes, at their right."""
    figure = cast(Figure, axes.get_figure(root=True))
    height = axes.get_position().height * figure.get_figheight()
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0 + _LEGEND_GAP / height), ncols=columns)


def _limits_of(comparison: Comparison, unit: DisplayUnit) -> tuple[float, float]:
    """The range of the data, opened for the model by half of that range at most on either side.

    A model that is far off must not flatten the data it is compared with.
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


def _largest(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.abs(finite).max()) if finite.size else 0.0


def _span(time: NDArray[np.float64]) -> tuple[float, float]:
    if time.size < 2:
        return float(time[0]) - 0.5, float(time[0]) + 0.5
    return float(time[0]), float(time[-1])


def _positive(values: Sequence[float]) -> NDArray[np.float64]:
    """Misfits that a logarithmic axis can show; the others leave a gap."""
    misfits = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(misfits) & (misfits > 0), misfits, np.nan)
