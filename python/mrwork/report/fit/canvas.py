"""Empty axes of the dossier's figures: with the same margins in inches, so that neighbours line up."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.report import style

_LEFT, _RIGHT, _TOP, _BOTTOM = 0.62, 0.20, 0.34, 0.5
# Four small panels are as wide as two columns of the page.
_SMALL_WIDTH, _SMALL_HEIGHT = style.PANEL_WIDTH / 2.0, 1.9
_SMALL_TOP, _SMALL_BOTTOM, _SMALL_LEFT, _SMALL_RIGHT = 0.3, 0.3, 0.62, 0.14


def column_axes(
    *, left: float = _LEFT, top: float = _TOP, height: float = style.PANEL_HEIGHT
) -> tuple[Figure, Axes]:
    """Axes as wide as one of two columns; call it and draw in `style.drawn_in_style()`."""
    width = style.PANEL_WIDTH
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes(
        (
            left / width,
            _BOTTOM / height,
            (width - left - _RIGHT) / width,
            (height - top - _BOTTOM) / height,
        )
    )
    return figure, axes


def small_axes(*, labelled: bool = False) -> tuple[Figure, Axes]:
    """Axes as wide as one of four columns; `labelled` leaves room below for the name of the abscissa."""
    bottom = _SMALL_BOTTOM + (0.22 if labelled else 0.0)
    height = _SMALL_HEIGHT + (0.22 if labelled else 0.0)
    figure = Figure(figsize=(_SMALL_WIDTH, height))
    axes = figure.add_axes(
        (
            _SMALL_LEFT / _SMALL_WIDTH,
            bottom / height,
            (_SMALL_WIDTH - _SMALL_LEFT - _SMALL_RIGHT) / _SMALL_WIDTH,
            (height - _SMALL_TOP - bottom) / height,
        )
    )
    axes.xaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    return figure, axes
