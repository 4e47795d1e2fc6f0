"""The figure of thickness and mean: what is drawn is what the branches are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.records import branches
from mrwork.report import branches_figure

TEST = mr.synthetic_test("rd1005_1a")


@pytest.mark.parametrize("over", ["velocity", "displacement"])
def test_the_panels_are_thickness_and_mean_of_test_and_model(over: str) -> None:
    force = 0.5 * TEST.force
    figure = branches_figure([TEST], [force], over=over)
    loop, model = branches(TEST, over=over), branches(TEST, over=over, force=force)
    for axes, quantity in zip(figure.axes, ("thickness", "mean"), strict=True):
        points, line = axes.lines[0].get_xydata(), axes.lines[1].get_xydata()
        np.testing.assert_allclose(points.T[1], getattr(loop, quantity).mean(axis=0)[::2])
        np.testing.assert_allclose(line.T[0], 1e3 * model.abscissa)
        np.testing.assert_allclose(line.T[1], getattr(model, quantity).mean(axis=0))
        band = axes.collections[0].get_paths()[0].vertices
        deviation = getattr(loop, quantity).std(axis=0, ddof=1)
        assert np.ptp(band[:, 1]) >= np.ptp(points.T[1]) + deviation.min()


def test_tests_are_named_by_their_command_in_tones_of_their_own() -> None:
    tests = [replace(TEST, current=current) for current in (0.0, 0.5, None)]
    legend = branches_figure(tests).legends[0]
    assert [text.get_text() for text in legend.get_texts()] == ["0 A", "0.5 A", TEST.name]
    assert len({line.get_color() for line in legend.get_lines()}) == 3


def test_what_cannot_be_drawn_is_refused(refused: Refused) -> None:
    refused(branches_figure, [])
    refused(branches_figure, [TEST], [TEST.force, TEST.force])
