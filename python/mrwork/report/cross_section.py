"""Cross-section of a designed damper, to scale: the whole, and one coil enlarged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mrwork.arguments import checked
from mrwork.dampers.design import DamperDesign
from mrwork.report import style
from mrwork.report.canvas import axes_between

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
        axes_between(figure, left=_EDGE, right=_WIDTH - _EDGE, bottom=low, top=high)
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
                f"{_number(design.stages, 'coil')} of {design.turns} turns",
                (coil + _MM * design.coil_length / 2.0, _MM * (core + winding) / 2.0),
            ),
            (f"cylinder, wall {_mm(design.wall)}", ((end + half) / 2.0, (bore + outer) / 2.0)),
        ],
        inch,
    )
    _dimension(axes, (-end, end), -outer - _STEP * inch, f"{_mm(design.chamber_length)} between covers", inch)
    x = end + _MM * design.stroke + 0.5 * inch
    for y, name in ((outer, design.outer_diameter), (bore, design.bore)):
        axes.annotate(
            "", (x, -y), (x, y), arrowprops={"arrowstyle": "<->", "color": style.FAINT_INK, "linewidth": 0.7},
            annotation_clip=False,
        )  # fmt: skip
        axes.text(
            x - 0.05 * inch if y == outer else x + 0.05 * inch,
            0.0,
            f"{'outer' if y == outer else 'bore'} {_mm(name)}",
            rotation=90,
            va="center",
            ha="right" if y == outer else "left",
            fontsize=style.SMALL_TEXT_SIZE,
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
    axes.annotate(
        "", (ends[0], y), (ends[1], y),
        arrowprops={"arrowstyle": "<->", "color": style.FAINT_INK, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 0},
        annotation_clip=False,
    )  # fmt: skip
    x = {"left": ends[0], "center": sum(ends) / 2.0, "right": ends[1]}[align]
    axes.text(x, y - 0.05 * inch, text, ha=align, va="top", fontsize=style.SMALL_TEXT_SIZE)


def _mm(length: float) -> str:
    return f"{_MM * length:.3g} mm"


def _number(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
