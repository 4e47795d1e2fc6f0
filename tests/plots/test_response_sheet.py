"""Sheets of runs: what is drawn is the history, of one motion, without and with control."""

from __future__ import annotations

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep

import mrwork as mr
from mrwork.control import lyapunov_function, plant_of
from mrwork.motions import GroundMotion
from mrwork.report import response_sheet_figure

FRAME = five_storeys()
MOTION = sweep(4.0)


def run(current: float, motion: GroundMotion = MOTION) -> mr.closed_loop.History:
    law = mr.ControlLaw(name="passive", gains={"command": [current]})
    found = mr.simulate_loop(
        FRAME, devices(rd1005(), second=False), law, [motion], histories=True, threads=1
    ).histories
    assert found is not None
    return found[0]


ON, OFF = run(1.0), run(0.0)


def test_every_panel_shows_both_runs_to_their_peaks() -> None:
    figure = response_sheet_figure(ON, OFF, FRAME, floor=2, seconds=10.0)
    ground, *panels = figure.axes
    assert np.abs(ground.lines[0].get_ydata()).max() == np.abs(ON.ground_acceleration).max()
    energy = lyapunov_function(plant_of(FRAME, FRAME.storeys[:1]))
    wanted = [
        (ON.current[:, 0], OFF.current[:, 0]),
        (ON.force[:, 0], OFF.force[:, 0]),
        (energy.value(ON.state), energy.value(OFF.state)),
        (1e3 * ON.displacement[:, 2], 1e3 * OFF.displacement[:, 2]),
        (1e3 * ON.state[:, 7], 1e3 * OFF.state[:, 7]),
        (ON.acceleration[:, 2], OFF.acceleration[:, 2]),
    ]
    for panel, (controlled, reference) in zip(panels, wanted, strict=True):
        dotted, solid = panel.lines
        assert dotted.is_dashed()
        assert not solid.is_dashed()
        for line, signal in ((dotted, reference), (solid, controlled)):
            assert np.abs(line.get_ydata()).max() == pytest.approx(np.abs(signal).max(), rel=1e-12)
