"""Marks in the key of a study's page, and loops of tests in its figures."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mrwork.report import draw_points, finish

Floats = NDArray[np.float64]

_LOOP_POINTS = 80

# Stroke width and dash pattern of the lines a key can show.
_STROKES = {
    "line": (1.6, ""),
    "dotted": (1.6, "2 2.5"),
    "dashed": (1.6, "6 3"),
    "wide": (6.0, ""),
}


def swatch(colour: str, kind: str) -> Markup:
    """A sample of a mark for a key: "point", "line", "dotted", "dashed" or "wide"."""
    if kind == "point":
        mark = Markup('<circle cx="11" cy="4.5" r="3.5" fill="{}"/>').format(colour)
    else:
        width, pattern = _STROKES[kind]
        dash = Markup(' stroke-dasharray="{}"').format(pattern) if pattern else ""
        mark = Markup('<path d="M0 4.5H22" stroke="{}" stroke-width="{}"{}/>').format(colour, width, dash)
    return Markup('<svg viewBox="0 0 22 9" aria-hidden="true">{}</svg>').format(mark)


def finish_loop(axes: Axes, *, over_velocity: bool) -> None:
    """Name the axes of a force loop in N and mm, or N and mm/s."""
    finish(axes, "Force (N)", "Velocity (mm/s)" if over_velocity else "Displacement (mm)")


def tested_points(axes: Axes, abscissa: Floats, force: Floats, cycle: slice) -> None:
    """One cycle of a test as points, thinned so that they can be distinguished."""
    drawn = slice(cycle.start, cycle.stop, max(1, (cycle.stop - cycle.start) // _LOOP_POINTS))
    draw_points(axes, abscissa[drawn], force[drawn], size=4.5)
