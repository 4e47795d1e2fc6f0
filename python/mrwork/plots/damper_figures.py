"""Figures of one damper: cross-section of a design, effects of parameters on loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.numbers import counted, shortest
from mrwork.base.values import Floats
from mrwork.dampers.design import DamperDesign
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.simulation import Loading, Outcome, simulate_forces
from mrwork.dampers.spec import DamperSpec
from mrwork.drawing import canvas, style
from mrwork.errors import SettingError, SimulationError

_STEEL, _ROD, _COIL, _FLUID = "#b9c2c9", "#e3e7ea", "#e3a66a", "#bcd6ea"
_MM = style.MILLIMETRE.factor
# Inches: the figure, room above and below a drawing for labels, height of the detail, steps from a drawing to its lines
# of labels and dimensions.
_WIDTH, _EDGE, _ABOVE, _BELOW = 1.6 * style.PANEL_WIDTH, 0.2, 0.62, 0.42
_DETAIL_HEIGHT, _STEP = 2.6, 0.2
# Width of the text of a dimension, and step to a second line of them.
_TEXT, _SECOND = 1.05, 0.26
# Share of the width of the whole drawing beside the rod, for the outer diameter.
_BESIDE = 0.13

_ARROW = {"arrowstyle": "<->", "color": style.FAINT_INK, "linewidth": 0.7}

Label = tuple[str, tuple[float, float]]
"""A text, and the point [mm] that it names."""


@checked
@style.drawn_in_style()
def cross_section_figure(design: DamperDesign) -> Figure:
    """Cross-section through the axis of a damper, to scale, with its first coil enlarged below.

    The dashed line is the path of the flux around that coil. The covers are no part of a design; lines stand for them.
    """
    reach = _MM * (design.chamber_length / 2.0 + design.stroke)
    outer = _MM * design.outer_diameter / 2.0
    inner_width = _WIDTH - 2.0 * _EDGE
    span = 2.0 * reach / (1.0 - _BESIDE)
    height = inner_width * 2.0 * outer / span
    # The dimensions of a short coil take two lines.
    below = _BELOW + _SECOND
    bottom = below + _DETAIL_HEIGHT + _ABOVE + _BELOW
    figure = Figure(figsize=(_WIDTH, bottom + height + _ABOVE))
    whole, detail = (
        canvas.axes_between(figure, left=_EDGE, right=_WIDTH - _EDGE, bottom=low, top=high)
        for low, high in ((bottom, bottom + height), (below, below + _DETAIL_HEIGHT))
    )
    whole.set_xlim(-reach, span - reach)
    whole.set_ylim(-outer, outer)
    _show_coil(detail, design, inner_width / _DETAIL_HEIGHT)
    for axes in (whole, detail):
        axes.set_axis_off()
        _draw(axes, design)
    _label_whole(whole, design, span / inner_width)
    low, high = detail.get_xlim()
    _label_detail(detail, design, (high - low) / inner_width)
    return figure


def _show_coil(axes: Axes, design: DamperDesign, ratio: float) -> None:
    """Limits around the first coil, from below its groove to the outside of the cylinder, on one scale."""
    left = -_MM * design.piston_length / 2.0
    length = _MM * (2.0 * design.pole_length + design.coil_length)
    top = _MM * design.outer_diameter / 2.0
    bottom = _MM * (design.core_radius - 0.4 * design.coil_depth)
    height = max(top - bottom, 1.2 * length / ratio)
    axes.set_ylim(top - height, top)
    middle = left + length / 2.0
    axes.set_xlim(middle - ratio * height / 2.0, middle + ratio * height / 2.0)


def _draw(axes: Axes, design: DamperDesign) -> None:
    """All parts within the limits of the axes, upper and lower half."""
    bore, outer, rod = (_MM * each / 2.0 for each in (design.bore, design.outer_diameter, design.rod))
    piston, core = _MM * design.piston_radius, _MM * design.core_radius
    winding = piston - _MM * design.coil_clearance
    end, half = _MM * design.chamber_length / 2.0, _MM * design.piston_length / 2.0
    reach = end + _MM * design.stroke
    _box(axes, (-end, end), (0.0, bore), _FLUID)
    _box(axes, (-end, end), (bore, outer), _STEEL)
    _box(axes, (-half, half), (rod, core), _STEEL)
    for pole, coil in _stages(design):
        for left in (pole, coil + _MM * design.coil_length):
            _box(axes, (left, left + _MM * design.pole_length), (core, piston), _STEEL)
        _box(axes, (coil, coil + _MM * design.coil_length), (core, winding), _COIL)
    _box(axes, (-reach, reach), (0.0, rod), _ROD)
    for side in (-1.0, 1.0):
        axes.plot([side * end, side * end], [-outer, outer], color=style.INK, linewidth=1.2)
    axes.plot([-reach, reach], [0, 0], color=style.FAINT_INK, linewidth=0.6, linestyle=(0, (12, 3, 2, 3)))
    pole, coil = _stages(design)[0]
    left, right = (each + _MM * design.pole_length / 2.0 for each in (pole, coil + _MM * design.coil_length))
    inner, back = (rod + core) / 2.0, (bore + outer) / 2.0
    axes.plot(
        [left, right, right, left, left],
        [inner, inner, back, back, inner],
        color=style.RESIDUAL,
        linewidth=1.0,
        linestyle=style.DASHED,
    )


def _stages(design: DamperDesign) -> list[tuple[float, float]]:
    """Left ends [mm] of the first pole and of the groove of each coil."""
    length = 2.0 * design.pole_length + design.coil_length
    starts = [number * length - design.piston_length / 2.0 for number in range(design.stages)]
    return [(_MM * start, _MM * (start + design.pole_length)) for start in starts]


def _box(axes: Axes, x: tuple[float, float], y: tuple[float, float], colour: str) -> None:
    """A part between these ends and radii [mm], on both sides of the axis; without an edge where it meets the other."""
    for low, high in ((y[0], y[1]), (-y[1], -y[0])):
        low, high = (low, high) if y[0] > 0.0 else (-y[1], y[1])
        axes.add_patch(
            Rectangle(
                (x[0], low), x[1] - x[0], high - low, facecolor=colour, edgecolor=style.INK, linewidth=0.5
            )
        )


def _label_whole(axes: Axes, design: DamperDesign, inch: float) -> None:
    """Labels of the parts, and outer dimensions; `inch` is an inch in millimetres of the drawing."""
    bore, outer, rod = (_MM * each / 2.0 for each in (design.bore, design.outer_diameter, design.rod))
    end, half = _MM * design.chamber_length / 2.0, _MM * design.piston_length / 2.0
    _, coil = _stages(design)[-1]
    core, winding = design.core_radius, design.piston_radius - design.coil_clearance
    _leaders(
        axes,
        [
            (f"rod {_mm(design.rod)}", (-end - 0.5 * _MM * design.stroke, 0.7 * rod)),
            (f"fluid, {design.fluid.name}", (-(end + half) / 2.0, (rod + bore) / 2.0)),
            (f"core, {design.steel.name}", (-0.85 * half, (2.0 * rod + _MM * core) / 3.0)),
            (
                f"{counted(design.stages, 'coil')} of {design.turns} turns",
                (coil + _MM * design.coil_length / 2.0, _MM * (core + winding) / 2.0),
            ),
            (f"cylinder, wall {_mm(design.wall)}", ((end + half) / 2.0, (bore + outer) / 2.0)),
        ],
        inch,
    )
    _dimension(axes, (-end, end), -outer - _STEP * inch, f"{_mm(design.chamber_length)} between covers", inch)
    x = end + _MM * design.stroke + 0.5 * inch
    for name, diameter, align, beside in (
        ("outer", design.outer_diameter, "right", -0.05),
        ("bore", design.bore, "left", 0.05),
    ):
        y, text = _MM * diameter / 2.0, f"{name} {_mm(diameter)}"
        axes.annotate("", (x, -y), (x, y), arrowprops=_ARROW, annotation_clip=False)
        axes.text(
            x + beside * inch, 0.0, text, rotation=90, va="center", ha=align, fontsize=style.SMALL_TEXT_SIZE
        )
        x += 0.22 * inch


def _label_detail(axes: Axes, design: DamperDesign, inch: float) -> None:
    """Dimensions of poles, groove and slot."""
    pole, coil = _stages(design)[0]
    length, coil_length = _MM * design.pole_length, _MM * design.coil_length
    piston, bore, outer = (
        _MM * each for each in (design.piston_radius, design.bore / 2.0, design.outer_diameter / 2.0)
    )
    core, winding = _MM * design.core_radius, piston - _MM * design.coil_clearance
    middle = coil + coil_length / 2.0
    _leaders(
        axes,
        [
            ("path of the flux", (pole + 0.5 * length, (bore + outer) / 2.0)),
            (f"gap {_mm(design.gap)}", (pole + 0.3 * length, (piston + bore) / 2.0)),
            (
                f"winding {_mm(design.coil_clearance)} below the poles",
                (middle, (winding + bore) / 2.0),
            ),
            (f"groove {_mm(design.coil_depth)} deep", (coil + 0.8 * coil_length, (core + winding) / 2.0)),
            (f"wall {_mm(design.wall)}", (coil + coil_length + length, (bore + 2.0 * outer) / 3.0)),
        ],
        inch,
    )
    y = axes.get_ylim()[0] - 0.1 * inch
    # Of short parts, the texts of the poles go outwards and that of the coil below them.
    apart = length + coil_length
    wide = apart > _TEXT * inch
    pole_text = f"pole {_mm(design.pole_length)}"
    _dimension(axes, (pole, coil), y, pole_text, inch, align="center" if wide else "right")
    _dimension(
        axes,
        (coil, coil + coil_length),
        y if apart > 2.0 * _TEXT * inch else y - _SECOND * inch,
        f"coil {_mm(design.coil_length)}",
        inch,
    )
    right = coil + coil_length
    _dimension(axes, (right, right + length), y, pole_text, inch, align="center" if wide else "left")


def _leaders(axes: Axes, labels: Sequence[Label], inch: float) -> None:
    """Labels in a line above the drawing, in the order of their points, with lines to these."""
    low, high = axes.get_xlim()
    step = (high - low) / len(labels)
    y = axes.get_ylim()[1] + _STEP * inch
    for number, (text, point) in enumerate(sorted(labels, key=lambda each: each[1][0])):
        axes.annotate(
            text,
            point,
            (low + (number + 0.5) * step, y + (number % 2) * _STEP * inch),
            ha="center",
            fontsize=style.SMALL_TEXT_SIZE,
            arrowprops={"arrowstyle": "-", "color": style.INK, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0},
            annotation_clip=False,
        )


def _dimension(
    axes: Axes,
    ends: tuple[float, float],
    y: float,
    text: str,
    inch: float,
    *,
    align: Literal["left", "center", "right"] = "center",
) -> None:
    """A horizontal dimension with its text below, which ends or begins with it, or stands in its middle."""
    arrow = _ARROW | {"shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (ends[0], y), (ends[1], y), arrowprops=arrow, annotation_clip=False)
    x = {"left": ends[0], "center": sum(ends) / 2.0, "right": ends[1]}[align]
    axes.text(x, y - 0.05 * inch, text, ha=align, va="top", fontsize=style.SMALL_TEXT_SIZE)


def _mm(length: float) -> str:
    return f"{_MM * length:.3g} mm"


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
    candidates = np.concatenate([_vary_parameter(spec, given, number) for number in range(given.size)])
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


def _vary_parameter(spec: DamperSpec, given: Floats, number: int) -> Floats:
    """The parameters with one of them changed, shape (3, n_params)."""
    parameter = spec.parameters[number]
    rows = np.tile(given, (len(_FACTORS), 1))
    rows[:-1, number] = np.clip(np.array(_FACTORS[:-1]) * given[number], parameter.lower, parameter.upper)
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
