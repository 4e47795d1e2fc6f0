"""The cross-section of a design: to scale, labelled, with text as text."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.path import Path
from matplotlib.text import Annotation, Text

from mrwork.dampers.design import DamperDesign, fluid, steel, twenty_ton_damper
from mrwork.drawing.canvas import svg_bytes
from mrwork.report import cross_section_figure

LARGE = twenty_ton_damper()
# Of a passenger car: slender, one coil.
SLENDER = DamperDesign(
    fluid=fluid("MRF-132DG"),
    steel=steel("AISI 1010"),
    bore=0.036,
    wall=0.005,
    rod=0.01,
    gap=0.0008,
    stages=1,
    pole_length=0.008,
    coil_length=0.012,
    coil_depth=0.008,
    coil_clearance=0.001,
    turns=120,
    wire_gauge=24,
    largest_current=1.5,
    stroke=0.02,
    velocity=0.1,
)
# Many short coils and poles, whose dimensions leave no room for a text.
SHORT = replace(
    SLENDER,
    bore=0.025,
    wall=0.001,
    rod=0.0025,
    gap=0.0005,
    stages=4,
    pole_length=0.0033,
    coil_length=0.0029,
    coil_depth=0.0077,
    turns=90,
    wire_gauge=26,
)
DESIGNS = pytest.mark.parametrize("design", [LARGE, SLENDER, SHORT], ids=["large", "slender", "short"])


def boxes(figure: Figure, axes: int) -> list[tuple[float, float, float, float]]:
    return [
        (*each.get_xy(), each.get_width(), each.get_height())
        for each in figure.axes[axes].patches
        if isinstance(each, Rectangle)
    ]


@DESIGNS
def test_parts_have_their_dimensions(design: DamperDesign) -> None:
    sizes = {
        (round(width, 9), round(height, 9)) for _, _, width, height in boxes(cross_section_figure(design), 0)
    }
    winding = design.coil_depth - design.coil_clearance
    for length, radial in (
        (design.chamber_length, design.wall),
        (design.pole_length, design.coil_depth),
        (design.coil_length, winding),
        (design.piston_length, design.core_radius - design.rod / 2.0),
        (design.chamber_length + 2.0 * design.stroke, design.rod),
    ):
        assert (round(length, 9), round(radial, 9)) in sizes


@DESIGNS
def test_every_coil_has_a_winding_and_two_poles_on_either_side(design: DamperDesign) -> None:
    heights = [round(height, 9) for _, _, _, height in boxes(cross_section_figure(design), 0)]
    assert heights.count(round(design.coil_depth, 9)) == 4 * design.stages
    assert heights.count(round(design.coil_depth - design.coil_clearance, 9)) == 2 * design.stages


@DESIGNS
def test_drawings_are_to_scale(design: DamperDesign) -> None:
    figure = cross_section_figure(design)
    for axes in figure.axes:
        place = axes.get_position()
        inches = np.array([place.width, place.height]) * figure.get_size_inches()
        span = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())])
        scale = span / inches
        assert scale[0] == pytest.approx(scale[1])


@DESIGNS
def test_labels_are_legible(design: DamperDesign) -> None:
    figure = cross_section_figure(design)
    figure.draw_without_rendering()
    texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    # With the leaders, a text would be as large as its line.
    extents = [Text.get_window_extent(text) for text in texts]
    frame = figure.bbox
    for extent in extents:
        assert frame.x0 <= extent.x0
        assert extent.x1 <= frame.x1
        assert frame.y0 <= extent.y0
        assert extent.y1 <= frame.y1
    for one, other in combinations(extents, 2):
        assert not one.overlaps(other)


@DESIGNS
def test_leaders_pass_beside_the_other_labels(design: DamperDesign) -> None:
    figure = cross_section_figure(design)
    figure.draw_without_rendering()
    leaders = [each for each in figure.findobj(Annotation) if each.get_text()]
    extents = {each: Text.get_window_extent(each) for each in leaders}
    for leader in leaders:
        middle = np.mean(extents[leader].get_points(), axis=0)
        line = Path([middle, leader.axes.transData.transform(leader.xy)])
        for other in leaders:
            assert other is leader or not line.intersects_bbox(extents[other], filled=True), (
                leader.get_text(),
                other.get_text(),
            )


def test_labels_say_the_numbers() -> None:
    texts = [text.get_text() for text in cross_section_figure(LARGE).findobj(Text)]
    for wanted in ("gap 2 mm", "pole 14 mm", "coil 65 mm", "3 coils of 1050 turns", "439 mm between covers"):
        assert wanted in texts
    assert "1 coil of 120 turns" in [text.get_text() for text in cross_section_figure(SLENDER).findobj(Text)]


def test_equal_designs_are_equal_files() -> None:
    first, second = svg_bytes(cross_section_figure(LARGE)), svg_bytes(cross_section_figure(LARGE))
    assert first == second
    assert first != svg_bytes(cross_section_figure(replace(LARGE, gap=0.003)))
