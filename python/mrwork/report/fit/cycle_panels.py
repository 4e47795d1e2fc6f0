"""Energy, equivalent stiffness and damping of each cycle of a test, with their bands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.report import numbers, style
from mrwork.report.fit.canvas import small_axes
from mrwork.report.fit.coverage import JUDGED
from mrwork.report.fit.section import Panel, panel
from mrwork.uncertainty.bands.band import Band, parameter_band
from mrwork.uncertainty.bands.cycle import (
    QUANTITIES,
    CycleQuantity,
    cycle_band,
    cycles_of,
    errors_over_cycles,
)
from mrwork.uncertainty.bands.prediction import Prediction

Array = NDArray[np.float64]

_QUANTITIES: dict[CycleQuantity, tuple[str, float]] = {
    "energy": ("Energy per cycle (J)", 1.0),
    "stiffness": ("Stiffness (N/mm)", 1e-3),
    "damping": ("Damping (N s/mm)", 1e-3),
}


def cycle_panels(
    identifier: str, prediction: Prediction, others: Sequence[Prediction], forces: Array | None
) -> tuple[Panel, ...]:
    """Energy, stiffness and damping of each cycle; none where the test has no whole cycle."""
    test = prediction.test
    try:
        measured, model = cycles_of(test, test.force), cycles_of(test, prediction.model_force)
    except RecordError:
        return ()
    drawn = [] if forces is None else [cycles_of(test, force) for force in forces]
    panels = []
    for name in QUANTITIES:
        title, factor = _QUANTITIES[name]
        bands: list[Band] = []
        scores = [_errors(each, name) for each in others]
        scores = [each for each in scores if each.size]
        if scores:
            bands.append(cycle_band(prediction, name, scores, JUDGED))
        if drawn:
            bands.append(parameter_band(np.array([each.quantity(name) for each in drawn]), JUDGED))
        values = measured.quantity(name)
        figure = _figure(title, values, model.quantity(name), bands, factor)
        kinds = " and ".join(band.kind for band in bands) or "no"
        panels.append(
            panel(
                f"{identifier}-{name}",
                "",
                figure,
                f"{title} of each cycle of test {test.name} with {kinds} band, mean "
                f"{numbers.significant(float(values.mean()) * factor, 3)}",
            )
        )
    return tuple(panels)


def _errors(prediction: Prediction, name: CycleQuantity) -> Array:
    try:
        return errors_over_cycles(prediction, name)
    except RecordError:
        return np.empty(0)


def _figure(title: str, measured: Array, model: Array, bands: Sequence[Band], factor: float) -> Figure:
    """A quantity of each cycle, shape (n_cycles,), times `factor`, with its bands: bars, narrower for parameters."""
    number = np.arange(1, measured.size + 1)
    with style.drawn_in_style():
        figure, axes = small_axes(labelled=True)
        for band in bands:
            lower, upper = band.lower * factor, band.upper * factor
            wide = band.kind == "prediction"
            axes.bar(
                number,
                upper - lower,
                bottom=lower,
                width=0.84 if wide else 0.4,
                color=style.BAND if wide else style.PARAMETER_BAND,
                edgecolor=style.BAND_EDGE if wide else style.PARAMETER_BAND,
                linewidth=0.7,
            )
        axes.plot(number, model * factor, linestyle="none", marker="_", markersize=9, color=style.MODEL)
        axes.plot(
            number,
            measured * factor,
            linestyle="none",
            marker="o",
            markersize=3.6,
            markerfacecolor=style.INK,
            markeredgewidth=0,
        )
        axes.set_title(title, loc="left", pad=6)
        axes.use_sticky_edges = False
        axes.autoscale_view()
        axes.set_xlim(0.3, measured.size + 0.7)
        axes.xaxis.set_major_locator(MaxNLocator(nbins=4, integer=True))
        axes.set_xlabel("Cycle")
    return figure
