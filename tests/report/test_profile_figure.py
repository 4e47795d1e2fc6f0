"""Figures of profiles: a panel per parameter, the threshold in each, an arrow at an open end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrwork.drawing.canvas import svg_bytes
from mrwork.report.fit.parameters import profiles_figure
from mrwork.uncertainty import Profiles
from mrwork.uncertainty.identifiability.profile import Profile

STEP = np.linspace(-2.2, 2.2, 9)
CLOSED = Profile(
    name="k",
    unit="N/m",
    estimate=10.0,
    log=False,
    values=tuple((10.0 + STEP).tolist()),
    misfit=tuple((0.1 + 0.001 * STEP**2).tolist()),
    ratio=tuple((STEP**2).tolist()),
    lower=8.0,
    upper=12.0,
    lower_end="closed",
    upper_end="closed",
    verdict="identifiable",
    reason="",
)


def profiles(*made: Profile) -> Profiles:
    return Profiles(
        model="normalised_bouc_wen",
        level=0.95,
        threshold=3.84,
        misfit=0.1,
        n_time=1000,
        n_effective=100.0,
        profiles=made,
        status="finished",
        remark="",
        evaluations=100,
        seconds=1.0,
    )


@pytest.mark.contract
def test_each_parameter_has_a_panel_with_threshold_estimate_and_ends() -> None:
    figure = profiles_figure(profiles(*(replace(CLOSED, name=name) for name in ("c", "k_w", "rho"))))
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["c (N/m)", "k_w (N/m)", "ρ (N/m)"]
    for axes in figure.axes:
        assert any(np.allclose(line.get_ydata(), 3.84) for line in axes.get_lines())
        assert axes.get_ylim()[1] > 3.84
        left, right = axes.get_xlim()
        assert left < 8.0 < 12.0 < right


def test_open_ends_are_marked_and_wide_and_lonely_profiles_are_drawn() -> None:
    flat = tuple(np.where(STEP > 0.0, 0.3, 1.0) * STEP**2)
    (axes,) = profiles_figure(profiles(replace(CLOSED, ratio=flat, upper=None, upper_end="bound"))).axes
    (marked,) = (text for text in axes.texts if text.get_text() == "open")
    assert marked.get_position()[0] > 0.5
    wide = replace(CLOSED, log=True, estimate=1.0, values=tuple(np.exp(1.2 * STEP).tolist()))
    (axes,) = profiles_figure(profiles(replace(wide, lower=0.1, upper=10.0))).axes
    assert axes.get_xscale() == "log"
    lonely = replace(CLOSED, values=(10.0,), misfit=(0.1,), ratio=(0.0,), lower=None, upper=None)
    assert svg_bytes(profiles_figure(profiles(lonely)))
