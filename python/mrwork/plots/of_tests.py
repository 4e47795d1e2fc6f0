"""Figures of what was measured, predicted or simulated: histories, loops, residuals, commands, nominal loops."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from mrwork.base.arguments import Whole
from mrwork.base.keys import check_known
from mrwork.base.values import Floats
from mrwork.closed_loop.responses import COMMAND_UNIT, History, Quantity, quantity_named
from mrwork.dampers.simulation import LoopAmplitude, LoopFrequency, simulate_force, sinusoid
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import reopen
from mrwork.motions.ground_motion import GroundMotion
from mrwork.plots import canvas, style
from mrwork.plots.canvas import draw_points, include_zero
from mrwork.plots.samples import CYCLES_SHOWN, scattered_samples
from mrwork.plots.sheet import (
    Ax,
    Legend,
    axes_for,
    check_number,
    chosen_number,
    figure,
    finished,
    shown_unit_of,
)
from mrwork.plots.style import DisplayUnit, with_unit
from mrwork.records.damper_test import DamperTest
from mrwork.records.motion import whole_cycles
from mrwork.records.read import test_from_arrays
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.bands.prediction import Prediction, predictions_of

Motion = Literal["displacement", "velocity"]
"""What a force is drawn against."""
Abscissa = Literal["time"] | Motion
AXES: dict[Abscissa, DisplayUnit] = {
    "time": DisplayUnit(symbol="s", factor=1.0),
    "displacement": style.MILLIMETRE,
    "velocity": style.MILLIMETRE_PER_SECOND,
}

# Points of a loop and of a residual, their sizes [pt], and bins of the mean of a residual.
_LOOP_POINTS, _RESIDUAL_POINTS, _POINT, _SMALL_POINT, _BINS = 600, 350, 2.8, 2.6, 24


def data_label(test: DamperTest) -> str:
    """Name of the data of a test in a legend; synthetic data are never called measured."""
    return "synthetic" if test.synthetic else "measured"


def axis_name(over: Abscissa) -> str:
    """Label of an axis: its quantity and the unit that it is drawn in, as "Time (s)"."""
    return f"{over.capitalize()} ({AXES[over].symbol})"


def axis_values(test: DamperTest, over: Abscissa) -> tuple[Floats, str]:
    """Time or motion of a test in units of its name on an axis, shape (n_time,), and that name."""
    return getattr(test, over) * AXES[over].factor, axis_name(over)


@figure
def histories(
    result: Fit | StoredRun | Prediction | DamperTest | History | GroundMotion,
    ax: Ax = None,
    *,
    test: str | int | None = None,
    signal: str = "drift",
    unit: str | None = None,
    legend: Legend = True,
) -> Axes:
    """Force of a test and its model over time; a signal of a closed loop; a ground acceleration, or forces on floors.

    Parameters
    ----------
    result
        What is drawn.
    test
        Name or number of the test of a fit, by default the first.
    signal
        Signal of a history of a closed loop, such as "drift", "acceleration", "force", "ground_acceleration".
    unit
        Unit of a force, such as "kN", where figures are compared; by default one that suits its peak.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.synthetic_test("spencer1997").plot.histories()
    >>> axes.get_ylabel()
    'Force (N)'
    """
    if isinstance(result, GroundMotion | History):
        return _signals(result, ax, signal, legend=legend)
    record, model_force = _test_and_force(_one(result, test))
    shown, axes = style.force_unit(_largest(record.force), unit), axes_for(ax)
    force = record.force * shown.factor
    axes.plot(record.time, force, color=style.DATA, linewidth=1.7, label=data_label(record))
    if model_force is not None:
        axes.plot(record.time, model_force * shown.factor, color=style.MODEL, linewidth=0.8, label="model")
    return finished(axes, "Time (s)", f"Force ({shown.symbol})", legend=legend)


@figure
def loops(
    result: Fit | StoredRun | Prediction | DamperTest | History,
    ax: Ax = None,
    *,
    over: Motion = "displacement",
    test: str | int | None = None,
    device: Whole = 0,
    unit: str | None = None,
    legend: Legend = True,
) -> Axes:
    """Force over displacement or velocity: a test, and the line of its model; or a damper in a building.

    Points are drawn of a test of many cycles, a line of one of three or less.

    Parameters
    ----------
    result, unit
        As in `histories`.
    over
        The abscissa.
    test
        Name or number of the test of a fit; by default all of them, in tones from light to dark.
    device
        Number of the damper of a history of a closed loop.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.synthetic_test("spencer1997").plot.loops(over="velocity")
    >>> axes.get_xlabel()
    'Velocity (mm/s)'
    """
    if isinstance(result, History):
        signals = _of_device(result, device, "deformation", "rate", "force")
        shown, axes = style.force_unit(_largest(signals["force"]), unit), axes_for(ax)
        across = signals["deformation" if over == "displacement" else "rate"] * AXES[over].factor
        axes.plot(across, signals["force"] * shown.factor, color=style.MODEL, linewidth=0.7)
        return finished(axes, axis_name(over), f"Force ({shown.symbol})")
    several = [_test_and_force(item) for item in (_drawn(result) if test is None else [_one(result, test)])]
    shown = style.force_unit(max(_largest(record.force) for record, _ in several), unit)
    axes = axes_for(ax)
    for number, (record, model_force) in enumerate(several):
        if len(several) == 1:
            colours, labels = (style.DATA, style.MODEL), (data_label(record), "model")
        else:
            tone = to_hex(style.TONES(number / (len(several) - 1)))
            colours, labels = (tone, tone), (record.name, "")
        across, force = axis_values(record, over)[0], record.force * shown.factor
        if len(whole_cycles(record.displacement)) > CYCLES_SHOWN:
            points = scattered_samples(across, force, _LOOP_POINTS)
            draw_points(axes, across[points], force[points], size=_POINT, colour=colours[0], label=labels[0])
        else:
            axes.plot(across, force, color=colours[0], linewidth=2.2, label=labels[0])
        if model_force is not None:
            force = model_force * shown.factor
            (line,) = axes.plot(across, force, color=colours[1], linewidth=1.1, label=labels[1])
            line.set_gid(f"{record.name}, model")
    return finished(axes, axis_name(over), f"Force ({shown.symbol})", legend=legend)


@figure
def residuals(
    result: Fit | StoredRun | Prediction,
    ax: Ax = None,
    *,
    over: Literal["time", "displacement", "velocity", "phase"] = "time",
    test: str | int | None = None,
    unit: str | None = None,
    legend: Legend = True,
) -> Axes:
    """Measured minus model force: a line over time, or points over the motion with their mean.

    Parameters
    ----------
    result, test, unit
        As in `histories`; a residual far below the unit is drawn in a smaller one.
    over
        The abscissa. Over the motion, or its phase, the samples that are compared are drawn. The phase is 0 at full
        extension, and 90 degrees at the largest outward velocity.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.identify("bingham", mr.synthetic_test("spencer1997")).plot.residuals(over="velocity")
    >>> mr.plots.drawn_data(axes)["curve"].unique().tolist()
    ['residual', 'mean', 'curve 3']
    """
    drawn = _one(result, test)
    assert isinstance(drawn, Prediction)  # a result of these types has a model
    record = drawn.test
    residual = record.force - drawn.model_force
    shown = style.residual_unit(_largest(residual), style.force_unit(_largest(record.force), unit))
    residual, axes = residual * shown.factor, axes_for(ax)
    if over == "phase":
        label, across = "Phase of the motion (°)", np.degrees(drawn.phase)
    else:
        across, label = axis_values(record, over)
    if over == "time":
        axes.plot(across, residual, color=style.RESIDUAL, linewidth=0.8)
    else:
        residual = residual[record.counted]
        across = across if over == "phase" else across[record.counted]
        points = scattered_samples(across, residual, _RESIDUAL_POINTS)
        draw_points(axes, across[points], residual[points], size=_SMALL_POINT, label="residual")
        axes.plot(*_means(across, residual), color=style.RESIDUAL, linewidth=1.8, label="mean")
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)
    return finished(axes, label, f"Residual ({shown.symbol})", legend=legend)


def _means(across: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Mean residual in equal bins of the abscissa that have samples."""
    edges = np.linspace(across.min(), across.max(), _BINS + 1)
    index = np.clip(np.searchsorted(edges, across, side="right") - 1, 0, _BINS - 1)
    count = np.bincount(index, minlength=_BINS)
    total = np.bincount(index, weights=residual, minlength=_BINS)
    filled = count > 0
    return 0.5 * (edges[:-1] + edges[1:])[filled], total[filled] / count[filled]


@figure
def commands(
    result: Fit | StoredRun | Prediction | DamperTest | History,
    ax: Ax = None,
    *,
    test: str | int | None = None,
    device: Whole = 0,
    legend: Legend = True,
) -> Axes:
    """Command of a test over time, held between samples; of a closed loop also the command behind the driver's lag.

    Parameters
    ----------
    result, test
        As in `histories`.
    device
        Number of the damper of a history of a closed loop.

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
        record, _ = _test_and_force(_one(result, test))
        if not record.commands:
            raise SettingError(
                f"the command of {record.label} is unknown; give it where the test is read, as `command` of "
                "`mr.test_from_arrays`"
            )
        varying = (command for command in record.commands if command.varies)
        time, (command, symbol) = record.time, next(varying, record.commands[0])
        lines = {"command": np.broadcast_to(command, time.shape)}
    axes = axes_for(ax)
    label = "command sent" if "current" in lines else None
    axes.plot(time, lines["command"], color=style.DATA, linewidth=1.1, drawstyle="steps-post", label=label)
    if "current" in lines:
        label = "behind the driver's lag"
        axes.plot(time, lines["current"], color=style.MODEL, linewidth=0.9, label=label)
    include_zero(axes, np.stack([*lines.values()]))
    return finished(axes, "Time (s)", with_unit("Command", symbol), legend=legend)


_FORCES = Quantity(name="forces", axis="floor", unit="N", description="force on the floor")


def _signals(result: GroundMotion | History, ax: Axes | None, signal: str, *, legend: bool) -> Axes:
    """A ground acceleration, forces, or a signal of a closed loop at every storey, floor or damper."""
    if isinstance(result, GroundMotion):
        signal = "forces" if result.forces.size and not result.peak else "ground_acceleration"
        numbers = {"forces": result.forces.T, "ground_acceleration": result.acceleration}
        result = History(time=result.time, numbers={signal: np.asarray(numbers[signal])})
    check_known(signal, result.numbers, f"a history has no signal {signal!r}")
    of = _FORCES if signal == "forces" else quantity_named(signal)
    values = np.asarray(result.numbers[signal])
    axes, unit = axes_for(ax), shown_unit_of(of.unit, _largest(values))
    columns = values.reshape(len(values), -1).T * unit.factor
    for number, column in enumerate(columns):
        tone = to_hex(style.TONES(0.5 if len(columns) == 1 else number / (len(columns) - 1)))
        label = f"{of.axis} {number + 1}" if values.ndim > 1 else of.description
        axes.plot(result.time, column, color=tone, linewidth=0.9, label=label)
    return finished(
        axes,
        "Time (s)",
        with_unit(f"{of.description[:1].upper()}{of.description[1:]}", unit.symbol),
        legend=legend,
    )


def _of_device(history: History, device: int, *names: str) -> dict[str, Floats]:
    """Signals of one damper by their names, each of shape (n_time,)."""
    check_number(device, history.numbers["force"].shape[1], "damper")
    return {name: np.asarray(history.numbers[name][:, device]) for name in names}


def _drawn(result: Fit | StoredRun | Prediction | DamperTest) -> tuple[Prediction | DamperTest, ...]:
    """The tests of a result, with the forces of the model if there is one."""
    if isinstance(result, DamperTest | Prediction):
        return (result,)
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
    return predictions_of(fit, tests)


def _one(
    result: Fit | StoredRun | Prediction | DamperTest, test: str | int | None
) -> Prediction | DamperTest:
    several = _drawn(result)
    return several[chosen_number(test, [_test_and_force(item)[0].name for item in several], "test")]


def _test_and_force(drawn: Prediction | DamperTest) -> tuple[DamperTest, Floats | None]:
    """A test with the force of a model on it, if there is one."""
    return (drawn, None) if isinstance(drawn, DamperTest) else (drawn.test, drawn.model_force)


def _largest(values: Floats) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


# Cycles of a motion from rest, and samples of a cycle.
_CYCLES, _PER_CYCLE = 3, 1000


def nominal_test(
    spec: DamperSpec, *, amplitude: float, frequency: float, per_cycle: int, command: float = 0.0
) -> DamperTest:
    """The nominal force under a sinusoid [m, Hz], at this command where the model takes one."""
    unit = spec.command_unit
    level = None if unit is None else command
    loading = sinusoid(
        amplitude,
        2.0 * np.pi * frequency * amplitude,
        cycles=_CYCLES,
        per_cycle=per_cycle,
        command=level,
        command_unit=unit,
    )
    test = test_from_arrays(
        loading.dt * np.arange(len(loading.displacement)),
        loading.displacement,
        simulate_force(spec, spec.nominal, loading),
        velocity=loading.velocity,
        name="nominal",
        command=level,
        command_unit=unit,
    )
    return replace(test, synthetic=True)


@style.drawn_in_style()
def nominal_loops(
    spec: DamperSpec, *, amplitude: LoopAmplitude = 0.015, frequency: LoopFrequency = 2.5
) -> Figure:
    """Force over displacement and over velocity in the last cycle of a sinusoid, at zero command."""
    whole = nominal_test(spec, amplitude=amplitude, frequency=frequency, per_cycle=_PER_CYCLE)
    test = whole.part(whole.n_time - _PER_CYCLE - 1, whole.n_time)
    unit = style.force_unit(float(np.abs(test.force).max()))
    figure, panels = canvas.grid_of_axes(2, 2, canvas.SMALL)
    for axes, over in zip(panels, get_args(Motion), strict=True):
        across, name = axis_values(test, over)
        axes.plot(across, unit.factor * test.force, color=style.MODEL, linewidth=1.4)
        canvas.finish(axes, f"Force ({unit.symbol})", name)
    return figure
