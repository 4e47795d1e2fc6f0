"""What figures of users share: their form as functions, their axes, names, units and keys."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Concatenate, ParamSpec, Protocol, TypeVar, cast

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mrwork.base.arguments import checked
from mrwork.base.hints import Says
from mrwork.base.keys import check_known
from mrwork.base.numbers import counted
from mrwork.errors import SettingError
from mrwork.plots import canvas, style
from mrwork.plots.style import DisplayUnit

if TYPE_CHECKING:
    from mrwork.base.plotted import Plots

P = ParamSpec("P")
ResultT = TypeVar("ResultT")
ResultT_contra = TypeVar("ResultT_contra", contravariant=True)
DrawnT = TypeVar("DrawnT")
DrawnT_co = TypeVar("DrawnT_co", covariant=True)

GivenAxes = Axes | Iterable[Axes] | None
Ax = Annotated[Axes | None, Says("axes to draw into; by default a new figure's")]
Legend = Annotated[bool, Says("whether to name the curves above the axes, where a title would stand")]
"""Axes of a figure of several panels: as many as it has, or `None` for new ones."""

Panels = NDArray[np.object_]
"""Axes of a figure of several panels, as `matplotlib.pyplot.subplots` returns them."""

_COLUMNS = 3
PANEL = (2.6, 2.3)

_DISPLAY_UNITS = {
    "m": style.MILLIMETRE,
    "m/s": style.MILLIMETRE_PER_SECOND,
    "m/s^2": DisplayUnit(symbol="m/s²", factor=1.0),
}


class FigureFunction(Protocol[ResultT_contra, P, DrawnT_co]):
    """A function of `mr.plots`, which is a method of the attribute `plot` of the results that it takes, too."""

    def __call__(self, result: ResultT_contra, /, *args: P.args, **named: P.kwargs) -> DrawnT_co:
        """Draw the figure of a result."""
        ...

    def __get__(self, plots: Plots[ResultT_contra], kind: type, /) -> Callable[P, DrawnT_co]: ...


def figure(function: Callable[Concatenate[ResultT, P], DrawnT]) -> FigureFunction[ResultT, P, DrawnT]:
    """A function of `mr.plots`: its arguments are checked, and it draws in the style of the package."""
    return checked(style.drawn_in_style()(function))


def shown_unit_of(unit: str, peak: float) -> DisplayUnit:
    """The unit in which numbers with this SI unit are drawn, of which the largest is `peak`."""
    if unit in ("N", "N m"):
        force = style.force_unit(peak)
        return DisplayUnit(symbol=unit.replace("N", force.symbol), factor=force.factor)
    if unit == "J" and peak >= 1e4:
        return DisplayUnit(symbol="kJ", factor=1e-3)
    return _DISPLAY_UNITS.get(unit, DisplayUnit(symbol=unit, factor=1.0))


def axes_for(ax: Axes | None, *, rows: int = 0) -> Axes:
    """The axes that were given, or of a new figure of pyplot; `rows` is the number of bars, if there are any."""
    if ax is not None:
        return ax
    height = style.PANEL_HEIGHT if not rows else 1.1 + 0.26 * rows
    return cast(Axes, _new_axes(1, 1, (style.PANEL_WIDTH, height))[0, 0])


def panels_for(
    ax: GivenAxes, count: int, figure: str, *, columns: int = _COLUMNS, size: tuple[float, float] = PANEL
) -> Panels:
    """The axes that were given, or of a new figure of pyplot with at most so many columns, shape (count,)."""
    if ax is not None:
        panels = np.array([ax] if isinstance(ax, Axes) else list(ax), dtype=object).reshape(-1)
        if panels.size != count or not all(isinstance(value, Axes) for value in panels):
            raise SettingError(
                f"`ax` of {figure} has {panels.size} entries where {count} axes were expected; give as many, or choose "
                "by `parameters`"
            )
        return panels
    columns = min(columns, count)
    panels = _new_axes(-(-count // columns), columns, size).reshape(-1)
    for spare in panels[count:]:
        spare.remove()
    return panels[:count]


def chosen_number(name: str | int | None, names: Sequence[str], what: str) -> int:
    """Number of the one that is asked for by its name or number, the first by default."""
    if isinstance(name, str):
        check_known(name, names, f"there is no {what} {name!r}", otherwise="there is")
        return names.index(name)
    return check_number(name or 0, len(names), what)


def all_chosen(asked: Sequence[str | int], names: Iterable[str], what: str) -> list[int]:
    """Numbers of the ones that are asked for by their names or numbers, by default of all."""
    known = [*names]
    return [chosen_number(name, known, what) for name in asked] or [*range(len(known))]


def check_number(number: int, count: int, what: str) -> int:
    """The number of one of `count` things, counted from 0, of which there is one."""
    if not 0 <= number < count:
        there_are = f"there {'is' if count == 1 else 'are'} {counted(count, what)}"
        raise SettingError(f"{there_are}, counted from 0; give one of them, not {number}")
    return number


def finished(axes: Axes, abscissa: str, ordinate: str, *, legend: bool = False) -> Axes:
    """The axes with their names and, where it is wanted and there is something to tell apart, their legend."""
    axes.set(xlabel=abscissa, ylabel=ordinate)
    if legend and len(axes.get_legend_handles_labels()[1]) > 1:
        canvas.legend(axes)
    return axes


def _new_axes(rows: int, columns: int, size: tuple[float, float]) -> Panels:
    """Axes of a new figure of pyplot, shape (rows, columns), each of this size [in]."""
    # It chooses a way to show figures, which whoever gives axes has done.
    from matplotlib import pyplot

    with style.drawn_in_style():
        made = pyplot.figure(figsize=(columns * size[0], rows * size[1]), layout="constrained")
        panels = np.array(made.subplots(rows, columns, squeeze=False), dtype=object)
        for axes in panels.flat:
            # Ticks are made when the figure is shown, out of this style.
            axes.tick_params(color=style.FAINT_INK, labelcolor=style.INK, labelsize=style.SMALL_TEXT_SIZE)
            axes.tick_params(grid_color=style.RULE, grid_linewidth=0.6)
            axes.tick_params(axis="y", length=0.0)
            if rows * columns > 1:
                canvas.few_ticks(axes)
    return panels
