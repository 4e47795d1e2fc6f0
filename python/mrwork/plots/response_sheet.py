"""Sheet of one run: ground, current, force, Lyapunov function and motion of a floor, with control and without.

In the form of figures 6.3 to 6.10 of the thesis, for any building and any control law.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.arguments import Positive, Whole, checked
from mrwork.base.values import Floats
from mrwork.buildings.matrices import Building
from mrwork.closed_loop.responses import History
from mrwork.control.laws.lyapunov import lyapunov_function
from mrwork.control.linear.plant import plant_of
from mrwork.drawing import style
from mrwork.drawing.canvas import axes_between, legend, name_ordinate, symmetric
from mrwork.drawing.of_tests import envelope, strong_part
from mrwork.errors import SettingError
from mrwork.plots.sheet import check_number, shown_unit_of

# Inches: height of a panel, of the title above it, of the labels of the time below it, and the margins at the sides.
_PANEL, _TITLE, _TIME, _LEFT, _RIGHT = 0.86, 0.34, 0.42, 0.62, 0.16
_BINS = 300

_Signal = tuple[str, str, Callable[[History], Floats], bool]
"""A quantity, its unit, its values in a run, shape (n_time,), and whether these are of both signs."""


@checked
@style.drawn_in_style()
def response_sheet_figure(
    controlled: History,
    reference: History,
    building: Building,
    *,
    device: Whole = 0,
    floor: Whole = 0,
    command_unit: Literal["A", "V"] = "A",
    seconds: Positive = 12.0,
) -> Figure:
    """Sheet of a run with control (solid) and without (dotted), as figures 6.3 to 6.10 of the thesis.

    From top to bottom: the whole ground motion; command behind the lag of the driver, force, Lyapunov function,
    displacement, velocity relative to the ground and absolute acceleration. All but the first are drawn in an interval,
    shaded in the first, about the largest displacement without control. The Lyapunov function V = s'P s / 2 is that of
    the building with its energy as weight, which does not depend on the law.

    Parameters
    ----------
    controlled, reference
        Histories of the same motion and the same building.
    device, floor
        Numbers of the damper and of the floor, from 0.
    command_unit
        Unit of the command.
    seconds
        Length of the interval [s]; a motion that is not longer is drawn whole.

    Raises
    ------
    SettingError
        If the histories are not of one motion and this building, or there is no such damper or floor.
    """
    _check(controlled, reference, building)
    check_number(device, min(each.force.shape[1] for each in (controlled, reference)), "damper")
    check_number(floor, len(building.floors), "floor")
    time = controlled.time
    shown = strong_part(time, reference.displacement[:, floor], float(seconds))
    signals = _signals(building, device, floor, command_unit)
    figure, (whole, *panels) = _empty(1 + len(signals))
    whole.plot(*envelope(time, controlled.ground_acceleration, _BINS), color=style.INK, linewidth=0.7)
    whole.axvspan(time[shown.start], time[shown.stop - 1], color=style.WINDOW, zorder=0.5, linewidth=0.0)
    name_ordinate(whole, "Ground acceleration (m/s²)")
    runs = (
        (reference, style.INK, style.DOTTED, "without control"),
        (controlled, style.MODEL, "-", "controlled"),
    )
    for axes, (title, unit_of_values, values, is_signed) in zip(panels, signals, strict=True):
        unit = shown_unit_of(unit_of_values, max(float(np.abs(values(run)).max()) for run, *_ in runs))
        for run, colour, pattern, label in runs:
            line = envelope(time[shown], unit.factor * values(run)[shown], _BINS)
            axes.plot(*line, color=colour, linewidth=0.9, linestyle=pattern, label=label)
        if is_signed:
            symmetric(axes)
        name_ordinate(axes, f"{title} ({unit.symbol})")
    legend(panels[0], columns=2)
    return figure


def _check(controlled: History, reference: History, building: Building) -> None:
    if not np.array_equal(controlled.ground_acceleration, reference.ground_acceleration):
        raise SettingError(
            f"the histories are of {len(controlled.time)} and {len(reference.time)} samples of different motions; give "
            "two runs of one motion at one sample time"
        )
    for history in (controlled, reference):
        if history.state.shape[1] != 2 * building.n_coordinates:
            raise SettingError(
                f"a history is of {history.state.shape[1] // 2} coordinates, and {building.name} has "
                f"{building.n_coordinates}; give the building that was simulated"
            )


def _signals(building: Building, device: int, floor: int, command_unit: str) -> list[_Signal]:
    n, of_floor = building.n_coordinates, building.floor_names[floor]
    energy = lyapunov_function(plant_of(building, building.storeys[:1]))
    current = "Coil current" if command_unit == "A" else "Voltage"
    return [
        (current, command_unit, lambda run: run.current[:, device], False),
        ("Damper force", "N", lambda run: run.force[:, device], True),
        ("Lyapunov function", "J", lambda run: energy.value(run.state), False),
        (f"Displacement, {of_floor}", "m", lambda run: run.displacement[:, floor], True),
        (f"Velocity, {of_floor}", "m/s", lambda run: run.state[:, n:] @ building.floors[floor], True),
        (f"Absolute acceleration, {of_floor}", "m/s^2", lambda run: run.acceleration[:, floor], True),
    ]


def _empty(count: int) -> tuple[Figure, list[Axes]]:
    """Axes one below the other; all but the first share their time, which is labelled below the first and the last."""
    row = _TITLE + _PANEL
    height = count * row + 2.0 * _TIME
    figure = Figure(figsize=(style.PANEL_WIDTH, height))
    panels: list[Axes] = []
    for number in range(count):
        top = height - number * row - _TITLE - (_TIME if number else 0.0)
        axes = axes_between(
            figure,
            left=_LEFT,
            right=style.PANEL_WIDTH - _RIGHT,
            bottom=top - _PANEL,
            top=top,
            sharex=panels[1] if number > 1 else None,
        )
        axes.yaxis.set_major_locator(MaxNLocator(nbins=3, steps=[1, 2, 2.5, 5, 10]))
        axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
        axes.tick_params(labelbottom=number in (0, count - 1))
        axes.margins(x=0.0)
        panels.append(axes)
    panels[-1].set_xlabel("Time (s)")
    return figure, panels
