"""Axes drawn with a single tick each, which is moved from place to place.

Matplotlib makes a tick of two texts and three lines for every place of every axis, and measures each several times; a
page of many figures would spend half of its time there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axis import Axis, XAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

# Share of an axis by which a tick may lie outside, by rounding.
_ROUNDING = 1e-10


@contextmanager
def single_ticks(figure: Figure) -> Iterator[None]:
    """Draw the axes of a figure so, but those whose ticks differ from each other or are needed for the layout."""
    stand_ins = []
    if figure.get_layout_engine() is None:
        for axes in figure.axes:
            stand_ins += [_SingleTick(axis) for axis in (axes.xaxis, axes.yaxis) if _is_plain(axis)]
    for each in stand_ins:
        each.take_over()
    try:
        yield
    finally:
        for each in stand_ins:
            each.give_back()


def _is_plain(axis: Axis) -> bool:
    """Whether all ticks are alike and on one side, and the name of the axis is below them or missing."""
    named = bool(axis.get_label_text())
    below = isinstance(axis, XAxis) and axis.get_label_position() == "bottom"
    (tick,) = axis.get_major_ticks(1)
    return (
        axis.get_visible()
        and axis.axes.axison
        and len(axis.majorTicks) == 1
        and isinstance(axis.get_minor_locator(), NullLocator)
        and not tick.label2.get_visible()
        and (not named or (below and tick.label1.get_visible()))
    )


class _SingleTick(Artist):
    """Draws an axis in its place."""

    def __init__(self, axis: Axis) -> None:
        super().__init__()
        self._axis = axis
        self.set_zorder(axis.get_zorder())

    def take_over(self) -> None:
        self._axis.axes.add_artist(self)
        self._axis.set_visible(False)

    def give_back(self) -> None:
        self.remove()
        self._axis.set_visible(True)

    def draw(self, renderer: RendererBase) -> None:
        """Ticks with their labels and grid lines, and the name of the axis below them."""
        axis = self._axis
        formatter = axis.get_major_formatter()
        places = np.asarray(axis.get_majorticklocs(), dtype=np.float64).tolist()
        labels = formatter.format_ticks(places)
        if formatter.get_offset() or any("\n" in label for label in labels):
            # A factor of all labels, or labels of different heights.
            axis.set_visible(True)
            axis.draw(renderer)
            axis.set_visible(False)
            return
        (tick,) = axis.get_major_ticks(1)
        shown = _inside(axis, places)
        for place, label, is_shown in zip(places, labels, shown, strict=True):
            if is_shown:
                tick.update_position(place)
                tick.label1.set_text(label)
                tick.draw(renderer)
        if axis.get_label_text():
            lowest = axis.axes.bbox.y0
            if any(shown):
                # All tick labels are of one height.
                lowest = min(lowest, tick.label1.get_window_extent(renderer).y0)
            axis.label.set_y(lowest - renderer.points_to_pixels(axis.labelpad))
            axis.label.draw(renderer)


def _inside(axis: Axis, places: Sequence[float]) -> list[bool]:
    """Which places are between the ends of an axis."""
    scale = axis.get_transform()
    low, high = np.sort(scale.transform(np.asarray(axis.get_view_interval())))
    at = scale.transform(np.asarray(places))
    slack = _ROUNDING * (high - low)
    inside: list[bool] = ((low - slack <= at) & (at <= high + slack)).tolist()
    return inside
