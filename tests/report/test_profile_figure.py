"""Figures of profiles: a panel per parameter, the threshold in each, an arrow at an open end."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.drawing.canvas import png_bytes, svg_bytes
from mrwork.report.fit.parameters import profiles_figure
from mrwork.uncertainty import Profiles
from mrwork.uncertainty.identifiability.profile import Profile


def profile(name: str, *, log: bool = False, upper_open: bool = False, lower_open: bool = False) -> Profile:
    step = np.linspace(-2.2, 2.2, 9)
    values = np.exp(0.4 * step) if log else 10.0 + step
    ratio = np.where(step > 0.0, 0.3 if upper_open else 1.0, 0.3 if lower_open else 1.0) * step**2
    return Profile(
        name=name,
        unit="N/m",
        estimate=float(values[4]),
        log=log,
        values=tuple(map(float, values)),
        misfit=tuple(map(float, 0.1 + 0.001 * ratio)),
        ratio=tuple(map(float, ratio)),
        lower=None if lower_open else float(values[0]) * 1.01,
        upper=None if upper_open else float(values[-1]) * 0.99,
        lower_end="bound" if lower_open else "closed",
        upper_end="bound" if upper_open else "closed",
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


def test_each_parameter_has_a_panel_with_the_threshold() -> None:
    drawn = profiles(*(profile(name) for name in ("c", "k", "x0", "k_w", "rho")))
    figure = profiles_figure(drawn)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        f"{name} (N/m)" for name in ("c", "k", "x0", "k_w", "ρ")
    ]
    for axes in figure.axes:
        assert any(np.allclose(line.get_ydata(), 3.84) for line in axes.get_lines())
        assert axes.get_ylim()[1] > 3.84
    assert svg_bytes(figure) == svg_bytes(profiles_figure(drawn))
    assert png_bytes(figure).startswith(b"\x89PNG")


@pytest.mark.parametrize(("lower", "upper"), [(False, True), (True, False), (True, True), (False, False)])
def test_open_ends_are_marked_on_their_side(lower: bool, upper: bool) -> None:
    (axes,) = profiles_figure(profiles(profile("k", lower_open=lower, upper_open=upper))).axes
    marked = [text for text in axes.texts if text.get_text() == "open"]
    assert [text.get_position()[0] < 0.5 for text in marked] == [True] * lower + [False] * upper


def test_the_estimate_and_the_ends_of_the_interval_are_inside() -> None:
    drawn = profile("rho", log=True)
    (axes,) = profiles_figure(profiles(drawn)).axes
    left, right = axes.get_xlim()
    assert drawn.lower is not None
    assert drawn.upper is not None
    assert left < drawn.lower < drawn.estimate < drawn.upper < right


def test_a_wide_interval_of_a_logarithmic_parameter_has_a_logarithmic_axis() -> None:
    wide = profile("sigma", log=True)
    stretched = Profile(
        **{
            field: getattr(wide, field)
            for field in (
                "name",
                "unit",
                "log",
                "misfit",
                "ratio",
                "lower_end",
                "upper_end",
                "verdict",
                "reason",
            )
        },
        estimate=1.0,
        values=tuple(float(value**3) for value in wide.values),
        lower=0.1,
        upper=10.0,
    )
    (axes,) = profiles_figure(profiles(stretched)).axes
    assert axes.get_xscale() == "log"
    # Numbers far from one, whose power of ten not every font has raised digits for.
    large = Profile(
        **{
            field: getattr(wide, field)
            for field in ("name", "unit", "misfit", "ratio", "lower_end", "upper_end", "verdict", "reason")
        },
        log=False,
        estimate=1e10,
        values=tuple(1e10 * value for value in wide.values),
        lower=5e9,
        upper=2e10,
    )
    assert svg_bytes(profiles_figure(profiles(large)))


def test_a_profile_of_one_point_is_drawn() -> None:
    lonely = Profile(
        name="k",
        unit="1",
        estimate=0.0,
        log=False,
        values=(0.0,),
        misfit=(0.1,),
        ratio=(0.0,),
        lower=None,
        upper=None,
        lower_end="interrupted",
        upper_end="interrupted",
        verdict="not identifiable",
        reason="",
    )
    assert svg_bytes(profiles_figure(profiles(lonely)))
