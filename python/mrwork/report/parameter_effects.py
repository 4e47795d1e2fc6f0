"""Effect of every parameter of a damper model on its loops, read from the description of the model.

In the form of figures 4.6 and 4.7 of the thesis, for any model: each parameter is halved and doubled in turn, and the
others stay as they are.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import NotNegative, Positive, checked
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError, SimulationError
from mrwork.numbers import shortest
from mrwork.report import canvas, style
from mrwork.simulate import Loading, Outcome, simulate_forces

Floats = NDArray[np.float64]

# Half, as given, double: the last is drawn above the others.
_FACTORS = (0.5, 2.0, 1.0)
_LINES = ((style.RESIDUAL, 1.1, "half"), (style.MODEL, 1.1, "double"), (style.INK, 1.4, "as given"))
# Cycles of the motion, samples of each, and how many of them there are between points of the last, which is drawn.
_CYCLES, _PER_CYCLE, _THINNED = 3, 2000, 5
# Pairs of panels side by side; inches of a panel, of its margins, and of the heading.
_PAIRS = 2
_PANEL = (2.55, 2.1)
_LEFT, _RIGHT, _TOP, _BOTTOM = 0.62, 0.14, 0.34, 0.44
_HEADING = 0.5


@checked
@style.drawn_in_style()
def parameter_effects_figure(
    spec: DamperSpec,
    theta: ArrayLike | None = None,
    *,
    amplitude: Positive = 0.015,
    frequency: Positive = 2.5,
    command: NotNegative | None = None,
) -> Figure:
    """Loops of a model with each parameter halved and doubled: force over displacement and over velocity for each.

    A value that would leave the range of its parameter is its bound. A loop that cannot be simulated is left out.

    Parameters
    ----------
    theta
        Parameters in spec order, shape (n_params,); the nominal ones if `None`.
    amplitude, frequency
        Of the imposed sinusoid [m, Hz], of which the third cycle is drawn.
    command
        Constant command of a model with current laws, in its unit; zero if `None`.

    Raises
    ------
    SettingError
        If `theta` does not fit the model, or a command is given to a model without current laws.
    SimulationError
        If the model cannot be simulated with the parameters as they are given.
    """
    given = np.array(spec.nominal if theta is None else theta, dtype=np.float64)
    if given.shape != (len(spec.parameters),):
        raise SettingError(f"`theta` has shape {given.shape}, {spec.name} takes ({len(spec.parameters)},)")
    if spec.current is None and command is not None:
        raise SettingError(f"{spec.name} without current laws takes no command; leave it out")
    phase = 2.0 * np.pi * np.arange(_CYCLES * _PER_CYCLE + 1) / _PER_CYCLE
    displacement = amplitude * np.sin(phase)
    velocity = 2.0 * np.pi * frequency * amplitude * np.cos(phase)
    loading = Loading(
        dt=1.0 / (_PER_CYCLE * frequency),
        displacement=displacement,
        velocity=velocity,
        command=None if spec.current is None else command or 0.0,
        command_unit=None if spec.current is None else spec.current.unit,
    )
    candidates = np.concatenate([_varied(spec, given, number) for number in range(given.size)])
    simulated = simulate_forces(spec, candidates, loading.history())
    finished = simulated.outcome == Outcome.FINISHED
    if not finished[len(_FACTORS) - 1]:
        raise SimulationError(
            f"{spec.name} cannot be simulated with these parameters under {1e3 * amplitude:g} mm at {frequency:g} Hz; "
            "move them towards their nominal values"
        )
    last = slice(-_PER_CYCLE - 1, None, _THINNED)
    forces = simulated.force[:, last]
    unit = style.force_unit(float(np.abs(forces[finished]).max()))
    figure, panels = _panels(given.size)
    for number, parameter in enumerate(spec.parameters):
        left, right = panels[number]
        rows = range(number * len(_FACTORS), (number + 1) * len(_FACTORS))
        for row, (colour, width, _) in zip(rows, _LINES, strict=True):
            if finished[row]:
                force = forces[row] * unit.factor
                left.plot(displacement[last] * 1e3, force, color=colour, linewidth=width)
                right.plot(velocity[last] * 1e3, force, color=colour, linewidth=width)
        canvas.name_small_axes(left, _in_words(parameter, float(given[number])), "Displacement (mm)")
        canvas.name_small_axes(right, f"Force ({unit.symbol})", "Velocity (mm/s)")
    _add_heading(figure, f"{spec.title}, {1e3 * amplitude:g} mm at {frequency:g} Hz")
    return figure


def _varied(spec: DamperSpec, given: Floats, number: int) -> Floats:
    """The parameters with one of them changed, shape (3, n_params)."""
    parameter = spec.parameters[number]
    rows = np.tile(given, (len(_FACTORS), 1))
    changed = np.clip(np.array(_FACTORS[:-1]) * given[number], parameter.lower, parameter.upper)
    rows[:-1, number] = changed
    return rows


def _in_words(parameter: ParamSpec, value: float) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{parameter.name} = {shortest(value, 3)}{unit}"


def _panels(count: int) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """A pair of axes for each parameter, two pairs side by side below a heading."""
    rows = -(-count // _PAIRS)
    width, height = 2 * _PAIRS * _PANEL[0], rows * _PANEL[1] + _HEADING
    figure = Figure(figsize=(width, height))
    panels = []
    for number in range(count):
        row, pair = divmod(number, _PAIRS)
        bottom = height - _HEADING - (row + 1) * _PANEL[1]
        left, right = (
            canvas.axes_between(
                figure,
                left=column * _PANEL[0] + _LEFT,
                right=(column + 1) * _PANEL[0] - _RIGHT,
                bottom=bottom + _BOTTOM,
                top=bottom + _PANEL[1] - _TOP,
            )
            for column in (2 * pair, 2 * pair + 1)
        )
        for axes in (left, right):
            canvas.few_ticks(axes)
        panels.append((left, right))
    return figure, panels


def _add_heading(figure: Figure, text: str) -> None:
    """The model and its motion, and what the lines are."""
    width, height = figure.get_size_inches().tolist()
    figure.text(_LEFT / width, 1.0 - 0.14 / height, text, va="top", fontweight="bold")
    figure.legend(
        handles=[Line2D([], [], color=colour, linewidth=1.6, label=name) for colour, _, name in _LINES],
        loc="upper right",
        bbox_to_anchor=(1.0 - _RIGHT / width, 1.0 - 0.14 / height),
        ncols=len(_LINES),
    )
