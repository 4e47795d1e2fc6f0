"""Figures of what was measured, predicted or simulated over time: histories, loops, residuals and commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from mrwork.base.arguments import Whole
from mrwork.base.keys import check_known
from mrwork.base.values import Floats
from mrwork.closed_loop.responses import COMMAND_UNIT, History, axis_of, description_of, unit_of
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import reopen
from mrwork.motions.ground_motion import GroundMotion
from mrwork.plots import style
from mrwork.plots.canvas import include_zero
from mrwork.plots.fit_drawing import add_residual_points, with_unit
from mrwork.plots.of_tests import (
    AXES,
    Motion,
    add_command,
    add_loop,
    add_record,
    add_residual,
    axis_name,
    axis_values,
    comparisons_of,
)
from mrwork.plots.sheet import (
    axes_for,
    check_number,
    chosen,
    figure,
    finished,
    shown_unit_of,
)
from mrwork.records.damper_test import DamperTest
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.prediction import Prediction

Pair = tuple[DamperTest, Floats | None]
"""A test and the force of a model on it, if there is a model."""


@figure
def histories(
    result: Fit | StoredRun | Prediction | DamperTest | History | GroundMotion,
    ax: Axes | None = None,
    *,
    test: str | int | None = None,
    signal: str = "drift",
    legend: bool = True,
) -> Axes:
    """Force of a test and its model over time; a signal of a closed loop; a ground acceleration.

    Parameters
    ----------
    result
        What is drawn.
    ax
        Axes to draw into; by default those of a new figure.
    test
        Name or number of the test of a fit, by default the first.
    signal
        Signal of a history of a closed loop, such as "drift", "acceleration", "force", "ground_acceleration".
    legend
        Whether to name the curves above the axes, where a title would stand.

    Raises
    ------
    SettingError
        If the fit was read from its file and has no tests, or there is no test of this number.
    UnknownNameError
        If there is no test, or a history has no signal, of this name.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.synthetic_test("spencer1997").plot.histories()
    >>> axes.get_ylabel()
    'Force (N)'
    """
    if isinstance(result, GroundMotion | History):
        return _signals(result, ax, signal, legend=legend)
    pair = _one(result, test)
    axes, unit = axes_for(ax), _force_unit([pair])
    add_record(axes, *pair, unit)
    return finished(axes, "Time (s)", f"Force ({unit.symbol})", legend=legend)


@figure
def loops(
    result: Fit | StoredRun | Prediction | DamperTest | History,
    ax: Axes | None = None,
    *,
    over: Motion = "displacement",
    test: str | int | None = None,
    device: Whole = 0,
    legend: bool = True,
) -> Axes:
    """Force over displacement or velocity: points of a test, the line of its model; or a damper in a building.

    Parameters
    ----------
    result, ax, legend
        As in `histories`.
    over
        The abscissa.
    test
        Name or number of the test of a fit; by default all of them, in tones from light to dark.
    device
        Number of the damper of a history of a closed loop.

    Raises
    ------
    SettingError
        As `histories`; also if the closed loop has no such damper.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.synthetic_test("spencer1997").plot.loops(over="velocity")
    >>> axes.get_xlabel()
    'Velocity (mm/s)'
    """
    if isinstance(result, History):
        return _loop_of_device(result, ax, over, device)
    pairs = _pairs(result) if test is None else [_one(result, test)]
    axes, unit = axes_for(ax), _force_unit(pairs)
    for number, (each, model_force) in enumerate(pairs):
        tone = to_hex(style.TONES(number / max(len(pairs) - 1, 1)))
        abscissa, label = axis_values(each, over)
        if len(pairs) == 1:
            add_loop(axes, abscissa, each, model_force, unit)
        else:
            add_loop(axes, abscissa, each, model_force, unit, colours=(tone, tone), labels=(each.name, ""))
            if model_force is not None:
                axes.get_lines()[-1].set_gid(f"{each.name}, model")
    return finished(axes, label, f"Force ({unit.symbol})", legend=legend)


@figure
def residuals(
    result: Fit | StoredRun | Prediction,
    ax: Axes | None = None,
    *,
    over: Literal["time", "displacement", "velocity"] = "time",
    test: str | int | None = None,
    legend: bool = True,
) -> Axes:
    """Measured minus model force: a line over time, or points over the motion with their mean.

    Parameters
    ----------
    result, ax, test, legend
        As in `histories`.
    over
        The abscissa. Over the motion, the samples that are compared are drawn.

    Raises
    ------
    SettingError
        As `histories`.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.identify("bingham", mr.synthetic_test("spencer1997")).plot.residuals(over="velocity")
    >>> mr.plots.drawn_data(axes)["curve"].unique().tolist()
    ['residual', 'mean', 'curve 3']
    """
    record, model_force = _one(result, test)
    assert model_force is not None  # a result of these types has a model
    residual = record.force - model_force
    counted = slice(None) if over == "time" else record.counted
    axes, (abscissa, label) = axes_for(ax), axis_values(record, over)
    unit = style.residual_unit(_largest(residual), style.force_unit(_largest(record.force)))
    if over == "time":
        add_residual(axes, abscissa, residual * unit.factor)
    else:
        add_residual_points(axes, abscissa[counted], residual[counted] * unit.factor)
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)
    return finished(axes, label, f"Residual ({unit.symbol})", legend=legend)


@figure
def commands(
    result: Fit | StoredRun | Prediction | DamperTest | History,
    ax: Axes | None = None,
    *,
    test: str | int | None = None,
    device: Whole = 0,
    legend: bool = True,
) -> Axes:
    """Command of a test over time, held between samples; of a closed loop also the command behind the driver's lag.

    Parameters
    ----------
    result, ax, test, legend
        As in `histories`.
    device
        Number of the damper of a history of a closed loop.

    Raises
    ------
    SettingError
        If the command of the test is unknown; also as `loops`.

    Examples
    --------
    >>> import mrwork as mr
    >>> known = mr.synthetic_test("spencer1997")
    >>> columns = (known.time, known.displacement, known.force)
    >>> test = mr.test_from_arrays(*columns, command=1.5, command_unit="A", name="mine")
    >>> float(mr.plots.drawn_data(test.plot.commands())["y"].max())
    1.5
    """
    if isinstance(result, History):
        time, symbol = result.time, COMMAND_UNIT
        lines = _of_device(result, device, "command", "current")
    else:
        record, _ = _one(result, test)
        if not record.commands:
            raise SettingError(
                f"the command of {record.label} is unknown; give it where the test is read, as `command` of "
                "`mr.test_from_arrays`"
            )
        time, (command, symbol) = record.time, record.commands[0]
        lines = {"command": np.broadcast_to(command, time.shape)}
    axes = axes_for(ax)
    add_command(axes, time, lines["command"])
    if "current" in lines:
        axes.get_lines()[-1].set_label("command sent")
        label = "behind the driver's lag"
        axes.plot(time, lines["current"], color=style.MODEL, linewidth=0.9, label=label)
    include_zero(axes, np.stack([*lines.values()]))
    return finished(axes, "Time (s)", with_unit("Command", symbol), legend=legend)


def _signals(result: GroundMotion | History, ax: Axes | None, signal: str, *, legend: bool) -> Axes:
    """A ground acceleration, or a signal of a closed loop at every storey, floor or damper."""
    if isinstance(result, GroundMotion):
        signal = "ground_acceleration"
        result = History(time=result.time, numbers={signal: np.asarray(result.acceleration)})
    check_known(signal, result.numbers, f"a history has no signal {signal!r}")
    words = description_of(signal)
    values = np.asarray(result.numbers[signal])
    axes, unit = axes_for(ax), shown_unit_of(unit_of(signal), _largest(values))
    columns = values.reshape(len(values), -1).T * unit.factor
    for number, column in enumerate(columns):
        tone = to_hex(style.TONES(0.5 if len(columns) == 1 else number / (len(columns) - 1)))
        label = f"{axis_of(signal)} {number + 1}" if values.ndim > 1 else words
        axes.plot(result.time, column, color=tone, linewidth=0.9, label=label)
    return finished(
        axes, "Time (s)", with_unit(f"{words[:1].upper()}{words[1:]}", unit.symbol), legend=legend
    )


def _loop_of_device(history: History, ax: Axes | None, over: Motion, device: int) -> Axes:
    deformation, rate, force = _of_device(history, device, "deformation", "rate", "force").values()
    axes, unit = axes_for(ax), style.force_unit(_largest(force))
    across = deformation if over == "displacement" else rate
    axes.plot(across * AXES[over].factor, force * unit.factor, color=style.MODEL, linewidth=0.7)
    return finished(axes, axis_name(over), f"Force ({unit.symbol})")


def _of_device(history: History, device: int, *names: str) -> dict[str, Floats]:
    """Signals of one damper by their names, each of shape (n_time,)."""
    check_number(device, history.numbers["force"].shape[1], "damper")
    return {name: np.asarray(history.numbers[name][:, device]) for name in names}


def _pairs(result: Fit | StoredRun | Prediction | DamperTest) -> list[Pair]:
    """Tests with the forces of the model, if there is one."""
    if isinstance(result, DamperTest):
        return [(result, None)]
    if isinstance(result, Prediction):
        return [(result.test, result.model_force)]
    if isinstance(result, StoredRun):
        opened = reopen(result.place)
        fit, tests = opened.fit, opened.tests
    else:
        fit, tests = result, result.tests
    if not tests:
        raise SettingError(
            f"the fit of {fit.model} was read from its file and has no tests; draw its run, "
            "`mr.load(folder).plot`, or a prediction, `mr.predict(fit, test).plot`"
        )
    return [(each.test, each.model_force) for each in comparisons_of(fit, tests)]


def _one(result: Fit | StoredRun | Prediction | DamperTest, test: str | int | None) -> Pair:
    pairs = _pairs(result)
    return pairs[chosen(test, [each.name for each, _ in pairs], "test")]


def _force_unit(pairs: Sequence[Pair]) -> style.DisplayUnit:
    return style.force_unit(max(_largest(test.force) for test, _ in pairs))


def _largest(values: Floats) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))
