"""Loops of a model with each parameter changed: what is drawn is what the model computes."""

from __future__ import annotations

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.report import parameter_effects_figure


@pytest.mark.parametrize("name", [spec.name for spec in mr.damper_models()])
def test_every_parameter_of_every_model_is_halved_and_doubled(name: str) -> None:
    spec = mr.damper(name)
    figure = parameter_effects_figure(spec)
    assert len(figure.axes) == 2 * len(spec.parameters)
    for panel in figure.axes:
        assert len(panel.lines) == 3, panel.get_title(loc="left")
    for parameter, panel in zip(spec.parameters, figure.axes[::2], strict=True):
        assert panel.get_title(loc="left").startswith(f"{parameter.name} = ")


def test_a_loop_is_the_force_of_the_model() -> None:
    spec = mr.damper("bingham")
    force, scale, damping, offset = 700.0, 0.01, 4000.0, 20.0
    figure = parameter_effects_figure(spec, (force, scale, damping, offset), amplitude=0.01, frequency=1.0)
    for factor, drawn in zip((0.5, 2.0, 1.0), figure.axes[1].lines, strict=True):
        velocity, found = np.asarray(drawn.get_xydata()).T
        velocity = velocity / 1e3
        expected = factor * force * np.tanh(velocity / scale) + damping * velocity + offset
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert np.ptp(figure.axes[0].lines[2].get_xdata()) == pytest.approx(20.0, rel=1e-5)


def test_a_model_with_current_laws_is_drawn_at_its_command() -> None:
    spec = mr.damper("bingham").with_current_laws({"f_c": "linear"})
    theta = np.array(spec.nominal)
    theta[list(spec.names).index("f_c.0")], theta[list(spec.names).index("f_c.1")] = 100.0, 500.0
    tops = [
        float(np.max(parameter_effects_figure(spec, theta, command=command).axes[1].lines[2].get_ydata()))
        for command in (0.0, 1.0)
    ]
    assert tops[1] - tops[0] == pytest.approx(500.0, rel=0.05)


def test_what_cannot_be_drawn_is_refused(refused: Refused) -> None:
    spec = mr.damper("bingham")
    refused(parameter_effects_figure, spec, (1.0, 2.0))
    refused(parameter_effects_figure, spec, command=1.0)
    stiff = mr.damper("bouc_wen")
    theta = np.array(stiff.nominal)
    theta[list(stiff.names).index("A")] = 1e12
    refused(parameter_effects_figure, stiff, theta)
