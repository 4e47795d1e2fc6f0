"""What the figures of the studies have in common, in the style of the reports."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from mrwork.report import style

# Sizes in inches: one of several side by side, and one that fills the page.
SMALL = (3.7, 2.8)
WIDE = (style.PANEL_WIDTH, style.PANEL_HEIGHT)
_LOOP_POINTS = 80


def blank(size: tuple[float, float]) -> tuple[Figure, Axes]:
    """An empty figure and its axes."""
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.add_subplot()


def finish(axes: Axes, title: str, abscissa: str) -> None:
    """Name both axes and give them few, round ticks; the ordinate stands above."""
    axes.set_title(title, loc="left", pad=7)
    axes.set_xlabel(abscissa)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))


def finish_loop(axes: Axes, *, over_velocity: bool) -> None:
    """The same for a force loop."""
    finish(axes, "Force (N)", "Velocity (mm/s)" if over_velocity else "Displacement (mm)")


def tested_points(
    axes: Axes, abscissa: NDArray[np.float64], force: NDArray[np.float64], cycle: slice
) -> None:
    """One cycle of a test as points, thinned until they can be told apart."""
    drawn = slice(cycle.start, cycle.stop, max(1, (cycle.stop - cycle.start) // _LOOP_POINTS))
    axes.plot(
        abscissa[drawn],
        force[drawn],
        linestyle="none",
        marker="o",
        markersize=4.5,
        markerfacecolor=style.DATA,
        markeredgewidth=0,
    )
