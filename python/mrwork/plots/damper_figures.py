"""Figures of one damper: cross-section of a design, effects of parameters on loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from mrwork.base.arguments import NotNegative, Positive, checked
from mrwork.base.numbers import counted, shortest
from mrwork.dampers.design import DamperDesign
from mrwork.dampers.simulation import Outcome, simulate_forces
from mrwork.dampers.spec import DamperSpec
from mrwork.drawing import canvas, style
from mrwork.drawing.of_fits import shown_unit
from mrwork.errors import SettingError, SimulationError
from mrwork.uncertainty.candidate_tests import Candidate, harmonic_motion

_STEEL, _ROD, _COIL, _FLUID = "#b9c2c9", "#e3e7ea", "#e3a66a", "#bcd6ea"
# Inches: the figure, room above and below a drawing for labels, height of the detail, steps from a drawing to its lines
# of labels and dimensions.
_WIDTH, _EDGE, _ABOVE, _BELOW = 1.6 * style.PANEL_WIDTH, 0.2, 0.62, 0.42
_DETAIL_HEIGHT, _STEP = 2.6, 0.2
_INNER_WIDTH = _WIDTH - 2.0 * _EDGE
# Width of the text of a dimension, and step to a second line of them.
_TEXT, _SECOND = 1.05, 0.26
# Share of the width of the whole drawing beside the rod, for the outer diameter.
_BESIDE = 0.13

_Align = Literal["left", "center", "right"]
_ARROW = {"arrowstyle": "<->", "color": style.FAINT_INK, "linewidth": 0.7}


@checked
@style.drawn_in_style()
def cross_section_figure(design: DamperDesign) -> Figure:
    """Cross-section through the axis of a damper, to scale, with its first coil enlarged below.

    The dashed line is the path of the flux around that coil. The covers are no part of a design; lines stand for them.
    """
    reach, outer = design.chamber_length / 2.0 + design.stroke, design.outer_diameter / 2.0
    span = 2.0 * reach / (1.0 - _BESIDE)
    height = _INNER_WIDTH * 2.0 * outer / span
    # The dimensions of a short coil take two lines.
    below = _BELOW + _SECOND
    bottom = below + _DETAIL_HEIGHT + _ABOVE + _BELOW
    figure = Figure(figsize=(_WIDTH, bottom + height + _ABOVE))
    whole, detail = (
        canvas.axes_between(figure, left=_EDGE, right=_WIDTH - _EDGE, bottom=low, top=high)
        for low, high in ((bottom, bottom + height), (below, below + _DETAIL_HEIGHT))
    )
    whole.set(xlim=(-reach, span - reach), ylim=(-outer, outer))
    _show_coil(detail, design)
    for axes, label in ((whole, _label_whole), (detail, _label_detail)):
        axes.set_axis_off()
        _draw(axes, design)
        label(axes, design)
    return figure


def _show_coil(axes: Axes, design: DamperDesign) -> None:
    """Limits around the first coil, from below its groove to the outside of the cylinder, on one scale."""
    ratio = _INNER_WIDTH / _DETAIL_HEIGHT
    length, top = 2.0 * design.pole_length + design.coil_length, design.outer_diameter / 2.0
    height = max(top - design.core_radius + 0.4 * design.coil_depth, 1.2 * length / ratio)
    middle, half = (length - design.piston_length) / 2.0, ratio * height / 2.0
    axes.set(xlim=(middle - half, middle + half), ylim=(top - height, top))


def _draw(axes: Axes, design: DamperDesign) -> None:
    """All parts within the limits of the axes, upper and lower half."""
    bore, outer, rod = design.bore / 2.0, design.outer_diameter / 2.0, design.rod / 2.0
    piston, core = design.piston_radius, design.core_radius
    end, half = design.chamber_length / 2.0, design.piston_length / 2.0
    reach = end + design.stroke
    _box(axes, (-end, end), (0.0, bore), _FLUID)
    _box(axes, (-end, end), (bore, outer), _STEEL)
    _box(axes, (-half, half), (rod, core), _STEEL)
    for pole, coil in _stages(design):
        for left in (pole, coil + design.coil_length):
            _box(axes, (left, left + design.pole_length), (core, piston), _STEEL)
        _box(axes, (coil, coil + design.coil_length), (core, piston - design.coil_clearance), _COIL)
    _box(axes, (-reach, reach), (0.0, rod), _ROD)
    for x in (-end, end):
        axes.plot([x, x], [-outer, outer], color=style.INK, linewidth=1.2)
    axes.plot([-reach, reach], [0, 0], color=style.FAINT_INK, linewidth=0.6, linestyle=(0, (12, 3, 2, 3)))
    pole, coil = _stages(design)[0]
    left, right = (each + design.pole_length / 2.0 for each in (pole, coil + design.coil_length))
    inner, back = (rod + core) / 2.0, (bore + outer) / 2.0
    around = [left, right, right, left, left], [inner, inner, back, back, inner]
    axes.plot(*around, color=style.RESIDUAL, linewidth=1.0, linestyle=style.DASHED)


def _stages(design: DamperDesign) -> list[tuple[float, float]]:
    """Left ends [m] of the first pole and of the groove of each coil."""
    length = 2.0 * design.pole_length + design.coil_length
    starts = [number * length - design.piston_length / 2.0 for number in range(design.stages)]
    return [(start, start + design.pole_length) for start in starts]


def _box(axes: Axes, x: tuple[float, float], y: tuple[float, float], colour: str) -> None:
    """A part between these ends and radii [m], on both sides of the axis; without an edge where it meets the other."""
    for low, high in (y, (-y[1], -y[0])) if y[0] > 0.0 else ((-y[1], y[1]),):
        corner, width, height = (x[0], low), x[1] - x[0], high - low
        axes.add_patch(Rectangle(corner, width, height, facecolor=colour, edgecolor=style.INK, linewidth=0.5))


def _label_whole(axes: Axes, design: DamperDesign) -> None:
    """Labels of the parts, and outer dimensions."""
    bore, outer, rod = design.bore / 2.0, design.outer_diameter / 2.0, design.rod / 2.0
    end, half, inch = design.chamber_length / 2.0, design.piston_length / 2.0, _inch(axes)
    _, coil = _stages(design)[-1]
    core, winding = design.core_radius, design.piston_radius - design.coil_clearance
    coils = f"{counted(design.stages, 'coil')} of {design.turns} turns"
    labels = {
        f"rod {_mm(design.rod)}": (-end - 0.5 * design.stroke, 0.7 * rod),
        f"fluid, {design.fluid.name}": (-(end + half) / 2.0, (rod + bore) / 2.0),
        f"core, {design.steel.name}": (-0.85 * half, (2.0 * rod + core) / 3.0),
        coils: (coil + design.coil_length / 2.0, (core + winding) / 2.0),
        f"cylinder, wall {_mm(design.wall)}": ((end + half) / 2.0, (bore + outer) / 2.0),
    }
    _leaders(axes, labels)
    _dimension(axes, (-end, end), -outer - _STEP * inch, f"{_mm(design.chamber_length)} between covers")
    x = end + design.stroke + 0.5 * inch
    for name, y, align, beside in (("outer", outer, "right", -0.05), ("bore", bore, "left", 0.05)):
        axes.annotate("", (x, -y), (x, y), arrowprops=_ARROW, annotation_clip=False)
        place, text = (x + beside * inch, 0.0), f"{name} {_mm(2.0 * y)}"
        axes.text(*place, text, rotation=90, va="center", ha=align, fontsize=style.SMALL_TEXT_SIZE)
        x += 0.22 * inch


def _label_detail(axes: Axes, design: DamperDesign) -> None:
    """Dimensions of poles, groove and slot."""
    pole, coil = _stages(design)[0]
    length, coil_length, inch = design.pole_length, design.coil_length, _inch(axes)
    piston, bore, outer = design.piston_radius, design.bore / 2.0, design.outer_diameter / 2.0
    core, winding, right = design.core_radius, piston - design.coil_clearance, coil + coil_length
    below_poles = f"winding {_mm(design.coil_clearance)} below the poles"
    labels = {
        "path of the flux": (pole + 0.5 * length, (bore + outer) / 2.0),
        f"gap {_mm(design.gap)}": (pole + 0.3 * length, (piston + bore) / 2.0),
        below_poles: (coil + coil_length / 2.0, (winding + bore) / 2.0),
        f"groove {_mm(design.coil_depth)} deep": (coil + 0.8 * coil_length, (core + winding) / 2.0),
        f"wall {_mm(design.wall)}": (right + length, (bore + 2.0 * outer) / 3.0),
    }
    _leaders(axes, labels)
    # Of short parts, the texts of the poles go outwards and that of the coil below them.
    apart, y = length + coil_length, axes.get_ylim()[0] - 0.1 * inch
    wide, pole_text = apart > _TEXT * inch, f"pole {_mm(length)}"
    below = y if apart > 2.0 * _TEXT * inch else y - _SECOND * inch
    _dimension(axes, (pole, coil), y, pole_text, "center" if wide else "right")
    _dimension(axes, (coil, right), below, f"coil {_mm(coil_length)}")
    _dimension(axes, (right, right + length), y, pole_text, "center" if wide else "left")


def _inch(axes: Axes) -> float:
    """Length [m] that an inch of the drawing shows."""
    low, high = axes.get_xlim()
    return (high - low) / _INNER_WIDTH


def _leaders(axes: Axes, labels: Mapping[str, tuple[float, float]]) -> None:
    """Labels in a line above the drawing, in the order of the points [m] that they name, with lines to these."""
    low, high = axes.get_xlim()
    step, row = (high - low) / len(labels), _STEP * _inch(axes)
    for number, (text, point) in enumerate(sorted(labels.items(), key=lambda each: each[1][0])):
        axes.annotate(
            text,
            point,
            (low + (number + 0.5) * step, axes.get_ylim()[1] + (1 + number % 2) * row),
            ha="center",
            fontsize=style.SMALL_TEXT_SIZE,
            arrowprops={"arrowstyle": "-", "color": style.INK, "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0},
            annotation_clip=False,
        )


def _dimension(axes: Axes, ends: tuple[float, float], y: float, text: str, align: _Align = "center") -> None:
    """A horizontal dimension with its text below, which ends or begins with it, or stands in its middle."""
    arrow = _ARROW | {"shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (ends[0], y), (ends[1], y), arrowprops=arrow, annotation_clip=False)
    x = {"left": ends[0], "center": sum(ends) / 2.0, "right": ends[1]}[align]
    axes.text(x, y - 0.05 * _inch(axes), text, ha=align, va="top", fontsize=style.SMALL_TEXT_SIZE)


def _mm(length: float) -> str:
    return f"{style.MILLIMETRE.factor * length:.3g} mm"


# Half, double and as given, which is drawn above the others.
_LINES = (
    (0.5, style.RESIDUAL, 1.1, "half"),
    (2.0, style.MODEL, 1.1, "double"),
    (1.0, style.INK, 1.4, "as given"),
)
# Samples of a cycle, and how many of them there are between points of the last, which is drawn.
_PER_CYCLE, _THINNED = 2000, 5
# Panels side by side, and inches of one.
_COLUMNS, _PANEL = 4, (2.55, 2.1)


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
    motion = Candidate(
        amplitude=amplitude, frequency=frequency, command=None if spec.current is None else command or 0.0
    )
    loading, _ = harmonic_motion(motion, spec, _PER_CYCLE)
    candidates = np.tile(given, (given.size, len(_LINES), 1))
    for number, parameter in enumerate(spec.parameters):
        varied = given[number] * np.array([factor for factor, *_ in _LINES[:-1]])
        candidates[number, :-1, number] = np.clip(varied, parameter.lower, parameter.upper)
    simulated = simulate_forces(spec, candidates.reshape(-1, given.size), loading.history())
    finished = (simulated.outcome == Outcome.FINISHED).reshape(given.size, len(_LINES))
    imposed = f"{1e3 * amplitude:g} mm at {frequency:g} Hz"
    if not finished[0, -1]:
        raise SimulationError(
            f"{spec.name} cannot be simulated with these parameters under {imposed}; "
            "move them towards their nominal values"
        )
    last = slice(-_PER_CYCLE - 1, None, _THINNED)
    forces = simulated.force[:, last].reshape(*finished.shape, -1)
    unit = style.force_unit(float(np.abs(forces[finished]).max()))
    figure, panels = canvas.grid_of_axes(2 * given.size, _COLUMNS, _PANEL)
    across = (loading.displacement, "Displacement (mm)"), (loading.velocity, "Velocity (mm/s)")
    for number, parameter in enumerate(spec.parameters):
        value = f"{parameter.name} = {shortest(float(given[number]), 3)} {shown_unit(parameter.unit)}"
        titles = value.rstrip(), f"Force ({unit.symbol})"
        for axes, title, (values, name) in zip(panels[2 * number :], titles, across, strict=False):
            for row, (_, colour, width, _) in enumerate(_LINES):
                if finished[number, row]:
                    force = forces[number, row] * unit.factor
                    axes.plot(np.asarray(values)[last] * 1e3, force, color=colour, linewidth=width)
            canvas.few_ticks(axes)
            canvas.name_small_axes(axes, title, name)
    figure.legend(
        handles=[Line2D([], [], color=colour, linewidth=1.6, label=label) for _, colour, _, label in _LINES],
        loc="outside upper left",
        ncols=len(_LINES),
        title=f"{spec.title}, {imposed}",
        title_fontproperties={"weight": "bold"},
        borderaxespad=0.6,
        alignment="left",
    )
    return figure
