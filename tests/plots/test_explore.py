"""Sliders of `mr.explore`: their values, the lines that are drawn of them, and the fit from them; without a browser."""

import sys

import numpy as np
import pytest
from posterior_samples import MODEL, small_test
from refusals import refusal

import mrwork as mr
from mrwork.plots.explore import Explorer

pytest.importorskip("ipywidgets", reason="ipywidgets, of the extra notebook, is not installed")


@pytest.fixture
def explorer() -> Explorer:
    return mr.explore(MODEL, small_test())


def test_the_drawn_lines_are_the_force_of_the_sliders(explorer: Explorer) -> None:
    before = [np.array(line.get_ydata()) for line in explorer.lines]
    picture = explorer._picture.value
    slider = explorer.sliders["k_w"]
    slider.value = 0.5 * slider.value
    assert explorer.theta[explorer.spec.names.index("k_w")] == slider.value
    force = mr.simulate(MODEL, explorer.theta, small_test())
    for line, old in zip(explorer.lines, before, strict=True):
        assert np.array_equal(line.get_ydata(), force)
        assert not np.array_equal(line.get_ydata(), old)
    assert explorer._picture.value != picture
    assert np.allclose(mr.explore(MODEL, small_test(), theta=explorer.theta).theta, explorer.theta)
    assert "application/vnd.jupyter.widget-view+json" in explorer._repr_mimebundle_()


def test_a_slider_spans_the_range_of_the_search_on_the_scale_of_its_parameter(explorer: Explorer) -> None:
    objective = mr.objective(MODEL, small_test())
    assert tuple(explorer.sliders) == objective.names
    for (name, slider), ends in zip(explorer.sliders.items(), objective.bounds, strict=True):
        parameter = explorer.spec.parameters[explorer.spec.names.index(name)]
        found = (slider.min, slider.max)
        assert np.allclose(np.power(10.0, found) if parameter.scale == "log" else found, ends)
        assert name in slider.description
        assert parameter.unit in slider.description.replace("\N{NO-BREAK SPACE}", " ")


def test_the_button_fits_from_the_sliders_and_sets_them(explorer: Explorer) -> None:
    assert explorer.fit is None
    explorer.sliders["k_w"].value = 500.0
    explorer.button.click()
    assert explorer.fit is not None
    assert np.allclose(explorer.theta, explorer.fit.theta, rtol=1e-6)
    assert np.array_equal(explorer.lines[0].get_ydata(), mr.simulate(MODEL, explorer.theta, small_test()))
    searched = mr.identify(MODEL, small_test(), rng=1)
    assert explorer.fit.nrmse <= searched.nrmse * (1.0 + 1e-6)
    assert explorer.status == f"fit {explorer.fit.fit_percent:.2f} %"


def test_without_a_test_the_nominal_loop_is_shown_and_nothing_is_fitted() -> None:
    spec = mr.damper("bingham").with_current_laws({"f_c": "linear"}, unit="A")
    explorer = mr.explore(spec, command=1.0)
    assert np.allclose(explorer.theta, spec.nominal)
    assert np.allclose(explorer.lines[0].get_ydata(), explorer.test.force)
    assert explorer.test.current == 1.0
    assert explorer.button.disabled


def test_what_cannot_be_explored_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    refusal(mr.explore, MODEL, small_test(), command=1.0, match="leave it out")
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    refusal(mr.explore, MODEL, small_test(), match="notebook")
