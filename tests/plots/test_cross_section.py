"""The cross-section of a design: to scale, labelled, with text as text."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from mrwork.dampers.design import DamperDesign, fluid, steel, twenty_ton_damper
from mrwork.report import cross_section_figure

LARGE = twenty_ton_damper()
# Of a passenger car: many short coils and poles, whose dimensions leave no room for a text.
SHORT = DamperDesign(
    fluid=fluid("MRF-132DG"),
    steel=steel("AISI 1010"),
    bore=0.025,
    wall=0.001,
    rod=0.0025,
    gap=0.0005,
    stages=4,
    pole_length=0.0033,
    coil_length=0.0029,
    coil_depth=0.0077,
    coil_clearance=0.001,
    turns=90,
    wire_gauge=26,
    largest_current=1.5,
    stroke=0.02,
    velocity=0.1,
)
DESIGNS = pytest.mark.parametrize("design", [LARGE, SHORT], ids=["large", "short"])


@DESIGNS
def test_parts_have_their_dimensions_and_are_drawn_to_scale(design: DamperDesign) -> None:
    figure = cross_section_figure(design)
    sizes = [
        (round(each.get_width(), 9), round(each.get_height(), 9))
        for each in figure.axes[0].patches
        if isinstance(each, Rectangle)
    ]
    winding = design.coil_depth - design.coil_clearance
    for length, radial in (
        (design.chamber_length, design.wall),
        (design.pole_length, design.coil_depth),
        (design.coil_length, winding),
        (design.piston_length, design.core_radius - design.rod / 2.0),
        (design.chamber_length + 2.0 * design.stroke, design.rod),
    ):
        assert (round(length, 9), round(radial, 9)) in sizes
    heights = [height for _, height in sizes]
    assert heights.count(round(design.coil_depth, 9)) == 4 * design.stages
    assert heights.count(round(winding, 9)) == 2 * design.stages
    for axes in figure.axes:
        place = axes.get_position()
        inches = np.array([place.width, place.height]) * figure.get_size_inches()
        scale = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())]) / inches
        assert scale[0] == pytest.approx(scale[1])
