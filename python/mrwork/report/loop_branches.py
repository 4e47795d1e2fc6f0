"""Thickness and mean of force loops over velocity or displacement, in the form of figures 5.6 and 5.7 of the thesis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import checked
from mrwork.errors import SettingError
from mrwork.records import Branches, DamperTest, branches
from mrwork.records.loop_branches import Abscissa
from mrwork.report import canvas, style

# Inches of a panel, of a line of the legend, and of a letter and a mark in it.
_PANEL, _LINE, _LETTER, _MARK = 2.4, 0.18, 0.07, 0.42
# Points of a curve, of which every other is drawn as such.
_POINTS, _EVERY = 81, 2


@checked
@style.drawn_in_style()
def branches_figure(
    tests: Sequence[DamperTest], forces: Sequence[ArrayLike] | None = None, *, over: Abscissa = "velocity"
) -> Figure:
    """Thickness of the loops of tests, and the mean of their branches, see `mr.records.branches`.

    Points are means over the cycles of a test, in a band of one standard deviation of a cycle; lines are a model.

    Parameters
    ----------
    tests
        Periodic tests of constant command, the first in the lightest tone.
    forces
        Forces of a model on the motions of the tests, as recorded, shape (n_time,) [N] each; none if `None`.
    over
        The abscissa of both panels.

    Raises
    ------
    RecordError, SettingError
        As `mr.records.branches`; the latter also without tests, or without a force for each.
    """
    if not tests:
        raise SettingError("a figure of branches shows one test or more, `tests` is empty")
    if forces is not None and len(forces) != len(tests):
        raise SettingError(f"`forces` has {len(forces)} entries for {len(tests)} tests; give one for each")
    loops = [branches(test, over=over, points=_POINTS) for test in tests]
    pairs = () if forces is None else zip(tests, forces, strict=True)
    lines = [branches(test, over=over, points=_POINTS, force=force) for test, force in pairs]
    tones = [to_hex(style.TONES(number / max(len(tests) - 1, 1))) for number in range(len(tests))]
    names = [_name(test) for test in tests]
    entry = _MARK + _LETTER * max(map(len, names))
    columns = max(1, min(len(names), int((style.PANEL_WIDTH - canvas.LEFT) / entry)))
    heading = _LINE * -(-len(names) // columns)
    height = heading + 2.0 * (canvas.TOP + _PANEL) + canvas.BOTTOM
    figure = Figure(figsize=(style.PANEL_WIDTH, height))
    figure.legend(
        handles=[
            Line2D([], [], color=tone, linewidth=3.0, label=name)
            for name, tone in zip(names, tones, strict=True)
        ],
        loc="upper left",
        bbox_to_anchor=(canvas.LEFT / style.PANEL_WIDTH, 1.0 - 0.05 / height),
        ncols=columns,
    )
    unit = style.force_unit(max(float(np.abs(loop.mean).max()) for loop in loops))
    for row, (quantity, title) in enumerate((("thickness", "Thickness"), ("mean", "Mean of the branches"))):
        top = height - heading - canvas.TOP - row * (_PANEL + canvas.TOP)
        axes = canvas.axes_between(
            figure, left=canvas.LEFT, right=style.PANEL_WIDTH - canvas.RIGHT, bottom=top - _PANEL, top=top
        )
        for loop, tone in zip(loops, tones, strict=True):
            _add_cycles(axes, loop, unit.factor * getattr(loop, quantity), tone)
        for line, tone in zip(lines, tones, strict=False):
            force = unit.factor * getattr(line, quantity).mean(axis=0)
            axes.plot(1e3 * line.abscissa, force, color=tone, linewidth=1.2)
        abscissa = "Velocity (mm/s)" if over == "velocity" else "Displacement (mm)"
        canvas.finish_signed(axes, f"{title} ({unit.symbol})", abscissa if row else "")
        axes.tick_params(labelbottom=bool(row))
    return figure


def _add_cycles(axes: Axes, loop: Branches, forces: NDArray[np.float64], tone: str) -> None:
    """Mean over the cycles as points, and the standard deviation of a cycle as a band."""
    mean, deviation = forces.mean(axis=0), forces.std(axis=0, ddof=1)
    at = 1e3 * loop.abscissa
    axes.fill_between(at, mean - deviation, mean + deviation, color=tone, alpha=0.25, linewidth=0)
    canvas.draw_points(axes, at[::_EVERY], mean[::_EVERY], size=3.0, colour=tone)


def _name(test: DamperTest) -> str:
    """The command of a test, or its name where that is unknown."""
    return ", ".join(f"{command:g} {unit}" for command, unit in test.commands) or test.name
