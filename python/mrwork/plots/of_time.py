"""Figures of what was measured, predicted or simulated over time: histories, loops, residuals and commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from mrwork.base.arguments import Whole
from mrwork.base.keys import check_known
from mrwork.base.labelled import NamedArray, NamedArrays, labels_of, number_labels, over_axis, time_labels
from mrwork.base.values import Floats
from mrwork.closed_loop.responses import COMMAND_UNIT, History, axis_of, description_of, unit_of
from mrwork.drawing import style
from mrwork.drawing.canvas import include_zero
from mrwork.drawing.of_fits import add_residual_points
from mrwork.drawing.of_tests import (
    Motion,
    add_command,
    add_loop,
    add_record,
    add_residual,
    axis_values,
    comparisons_of,
)
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import reopen
from mrwork.motions.ground_motion import GroundMotion
from mrwork.plots.sheet import (
    add_key,
    axes_for,
    chosen,
    figure,
    motion_columns,
    name_axes,
    shown_unit_of,
)
from mrwork.records.damper_test import DamperTest
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.prediction import Prediction

if TYPE_CHECKING:
    from mrwork.base.labelled import DataFrame

Pair = tuple[DamperTest, Floats | None]
"""A test and the force of a model on it, if there is a model."""

_TIME = ("Time", "s")


@figure
def histories(
    result: Fit | StoredRun | Prediction | DamperTest | History | GroundMotion,
    ax: Axes | None = None,
    *,
    test: str | int | None = None,
    signal: str = "drift",
    data: bool = False,
) -> Axes | DataFrame:
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
    data
        Whether to return the table behind the figure instead.

    Raises
    ------
    SettingError
        If the fit was read from its file and has no tests, or there is no test of this number.
    UnknownNameError
        If there is no test, or a history has no signal, of this name.

    Examples
    --------
    >>> import mrwork as mr
    >>> test = mr.synthetic_test("spencer1997")
    >>> test.plot.histories(data=True).shape
    (2001, 3)
    """
    if isinstance(result, GroundMotion | History):
        return _signals(result, ax, signal, data=data)
    pair = _one(result, test)
    if data:
        return _table([pair], ("force",)).to_pandas()
    axes, (record, model_force) = axes_for(ax), pair
    unit = _force_unit([pair])
    add_record(axes, record, model_force, unit)
    name_axes(axes, _TIME, ("Force", unit.symbol))
    add_key(axes)
    return axes


@figure
def loops(
    result: Fit | StoredRun | Prediction | DamperTest | History,
    ax: Axes | None = None,
    *,
    over: Motion = "displacement",
    test: str | int | None = None,
    device: Whole = 0,
    data: bool = False,
) -> Axes | DataFrame:
    """Force over displacement or velocity: points of a test, the line of its model; or a damper in a building.

    Parameters
    ----------
    result, ax, data
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
    >>> test = mr.synthetic_test("spencer1997")
    >>> list(test.plot.loops(data=True).columns)
    ['test', 'time', 'displacement', 'velocity', 'force']
    """
    if isinstance(result, History):
        return _loop_of_device(result, ax, over, device, data=data)
    pairs = _pairs(result)
    if test is not None:
        pairs = [_choose(pairs, test)]
    if data:
        return _table(pairs, ("displacement", "velocity", "force")).to_pandas()
    axes, unit = axes_for(ax), _force_unit(pairs)
    for number, (each, model_force) in enumerate(pairs):
        tone = to_hex(style.TONES(number / max(len(pairs) - 1, 1)))
        abscissa, label = axis_values(each, over)
        if len(pairs) == 1:
            add_loop(axes, abscissa, each, model_force, unit)
        else:
            add_loop(axes, abscissa, each, model_force, unit, colours=(tone, tone), labels=(each.name, ""))
        axes.set_xlabel(label)
    axes.set_ylabel(f"Force ({unit.symbol})")
    add_key(axes)
    return axes


@figure
def residuals(
    result: Fit | StoredRun | Prediction,
    ax: Axes | None = None,
    *,
    over: Literal["time", "displacement", "velocity"] = "time",
    test: str | int | None = None,
    data: bool = False,
) -> Axes | DataFrame:
    """Measured minus model force: a line over time, or points over the motion with their mean.

    Parameters
    ----------
    result, ax, test, data
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
    >>> fit = mr.identify("bingham", mr.synthetic_test("spencer1997"))
    >>> float(fit.plot.residuals(data=True)["residual"].std()) < 1.1 * fit.rmse_n
    True
    """
    record, model_force = _one(result, test)
    assert model_force is not None  # a result of these types has a model
    residual = record.force - model_force
    counted = slice(None) if over == "time" else record.counted
    if data:
        columns = {
            **motion_columns(record.displacement[counted], record.velocity[counted]),
            "residual": (residual[counted], "N", "measured minus model force"),
        }
        time = time_labels(record.time[counted])
        return over_axis(f"Residual of {record.name}", "time", time, columns).to_pandas()
    axes = axes_for(ax)
    unit = style.residual_unit(_largest(residual), style.force_unit(_largest(record.force)))
    if over == "time":
        add_residual(axes, record.time, residual * unit.factor)
        axes.set_xlabel("Time (s)")
    else:
        abscissa, label = axis_values(record, over)
        add_residual_points(axes, abscissa[counted], residual[counted] * unit.factor)
        axes.set_xlabel(label)
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)
    axes.set_ylabel(f"Residual ({unit.symbol})")
    add_key(axes)
    return axes


@figure
def commands(
    result: Fit | StoredRun | Prediction | DamperTest | History,
    ax: Axes | None = None,
    *,
    test: str | int | None = None,
    device: Whole = 0,
    data: bool = False,
) -> Axes | DataFrame:
    """Command of a test over time, held between samples; of a closed loop also the command behind the driver's lag.

    Parameters
    ----------
    result, ax, test, data
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
    >>> float(test.plot.commands(data=True)["command"].max())
    1.5
    """
    if isinstance(result, History):
        _check_device(result, device)
        time, symbol = result.time, COMMAND_UNIT
        lines = {
            name: (np.asarray(result.numbers[name][:, device]), symbol, description_of(name))
            for name in ("command", "current")
        }
    else:
        record, _ = _one(result, test)
        if not record.commands:
            raise SettingError(
                f"the command of {record.label} is unknown; give it where the test is read, as `command` of "
                "`mr.test_from_arrays`"
            )
        command, symbol = record.commands[0]
        time = record.time
        lines = {"command": (np.broadcast_to(command, time.shape), symbol, "command")}
    if data:
        return over_axis("Command", "time", time_labels(time), lines).to_pandas()
    axes = axes_for(ax)
    add_command(axes, time, lines["command"][0])
    if "current" in lines:
        axes.get_lines()[-1].set_label("command sent")
        axes.plot(
            time, lines["current"][0], color=style.MODEL, linewidth=0.9, label="behind the driver's lag"
        )
    include_zero(axes, np.stack([values for values, *_ in lines.values()]))
    name_axes(axes, _TIME, ("Command", symbol))
    add_key(axes)
    return axes


def _signals(result: GroundMotion | History, ax: Axes | None, signal: str, *, data: bool) -> Axes | DataFrame:
    """A ground acceleration, or a signal of a closed loop at every storey, floor or damper."""
    if isinstance(result, GroundMotion):
        signal, time, values = "ground_acceleration", result.time, result.acceleration
    else:
        check_known(signal, result.numbers, f"a history has no signal {signal!r}")
        time, values = result.time, np.asarray(result.numbers[signal])
    columns = values.reshape(len(time), -1)
    words, axis = description_of(signal), axis_of(signal)
    if data:
        return NamedArrays(
            title=words,
            rows=("time",),
            labels={
                "time": time_labels(time),
                **({} if values.ndim == 1 else {axis: labels_of(np.arange(1, columns.shape[1] + 1))}),
            },
            arrays={
                signal: NamedArray.of(
                    values,
                    *(("time",) if values.ndim == 1 else ("time", axis)),
                    unit=unit_of(signal),
                    long_name=words,
                )
            },
        ).to_pandas()
    axes, unit = axes_for(ax), shown_unit_of(unit_of(signal), _largest(values))
    for number, column in enumerate(columns.T):
        tone = style.TONES(0.5 if len(columns.T) == 1 else number / (len(columns.T) - 1))
        label = f"{axis} {number + 1}" if values.ndim > 1 else words
        axes.plot(time, column * unit.factor, color=to_hex(tone), linewidth=0.9, label=label)
    name_axes(axes, _TIME, (f"{words[:1].upper()}{words[1:]}", unit.symbol))
    add_key(axes)
    return axes


def _loop_of_device(
    history: History, ax: Axes | None, over: Motion, device: int, *, data: bool
) -> Axes | DataFrame:
    _check_device(history, device)
    force, deformation, rate = (
        np.asarray(history.numbers[name][:, device]) for name in ("force", "deformation", "rate")
    )
    if data:
        columns = {**motion_columns(deformation, rate), "force": (force, "N", "damper force")}
        time = time_labels(history.time)
        return over_axis(f"Loop of damper {device}", "time", time, columns).to_pandas()
    axes, unit = axes_for(ax), style.force_unit(_largest(force))
    across = deformation if over == "displacement" else rate
    scale = style.MILLIMETRE if over == "displacement" else style.MILLIMETRE_PER_SECOND
    axes.plot(across * scale.factor, force * unit.factor, color=style.MODEL, linewidth=0.7)
    name_axes(axes, (over.capitalize(), scale.symbol), ("Force", unit.symbol))
    return axes


def _check_device(history: History, device: int) -> None:
    count = history.numbers["force"].shape[1]
    if device >= count:
        raise SettingError(f"the history has {count} dampers, counted from 0; give one of them, not {device}")


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


def _choose(pairs: Sequence[Pair], test: str | int | None) -> Pair:
    return pairs[chosen(test, [each.name for each, _ in pairs], "test")]


def _one(result: Fit | StoredRun | Prediction | DamperTest, test: str | int | None) -> Pair:
    return _choose(_pairs(result), test)


def _force_unit(pairs: Sequence[Pair]) -> style.DisplayUnit:
    return style.force_unit(max(_largest(test.force) for test, _ in pairs))


def _largest(values: Floats) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


def _table(pairs: Sequence[Pair], channels: Sequence[str]) -> NamedArrays:
    """Channels of tests with the force of the model: over time, or of several tests one below the other."""
    units = {"displacement": "m", "velocity": "m/s", "force": "N"}
    columns = {
        name: (np.concatenate([getattr(test, name) for test, _ in pairs]), units[name], f"damper {name}")
        for name in channels
    }
    forces = [force for _, force in pairs if force is not None]
    if forces:
        columns["model_force"] = np.concatenate(forces), "N", "force of the model"
    time = np.concatenate([test.time for test, _ in pairs])
    names = np.concatenate([np.full(test.n_time, test.name) for test, _ in pairs])
    return replace(
        over_axis("Damper tests", "sample", number_labels(len(names)), columns),
        along={
            "test": NamedArray.of(names, "sample", long_name="test"),
            "time": NamedArray.of(time, "sample", unit="s", long_name="time"),
        },
    )
