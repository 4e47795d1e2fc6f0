"""Published sets of every model: complete, admissible, sourced, and they run and dissipate."""

import re
from dataclasses import replace

import numpy as np
import pytest
from damper_samples import DT, sine
from refusals import refusal

from mrwork.dampers import damper, damper_models
from mrwork.dampers.simulation import simulate_force
from mrwork.dampers.spec import published_sets
from mrwork.twins.model_twins import parameters_at


def presets():
    return [spec.preset(name) for spec in damper_models() for name in spec.presets]


@pytest.fixture(params=presets(), ids=lambda preset: f"{preset.spec.name}-{preset.name}")
def preset(request):
    """Every published set in turn."""
    return request.param


def test_every_published_set_belongs_to_a_model():
    assert {entry.spec.name for entry in published_sets()} <= {spec.name for spec in damper_models()}
    assert len(presets()) == len(published_sets())


def test_all_parameters_are_given_and_admissible_at_every_command(preset):
    assert len(preset.theta) == len(preset.spec.parameters)
    largest = preset.largest_command or 0.0
    for command in (0.0, 0.5 * largest, largest):
        values = parameters_at(preset.spec, np.array(preset.theta), command)
        assert np.all(np.isfinite(values))
        for parameter, value in zip(preset.spec.plain, values, strict=True):
            assert parameter.lower <= value <= parameter.upper
    if preset.spec.n_rates:
        assert 0.0 < preset.theta[-1] == preset.theta[preset.spec.names.index("eta")]


def test_source_and_status_are_said(preset):
    assert re.search(r"\b(19|20)\d\d\b", preset.source)
    assert preset.status in ("verified", "published")


def test_ratings_are_of_the_size_of_the_damper(preset):
    assert preset.rated_force is not None
    assert preset.force_class.startswith("up to ")
    largest = preset.largest_command or 0.0
    loading = replace(sine(), command=largest, command_unit=preset.spec.command_unit)
    force = np.abs(simulate_force(preset.spec, np.array(preset.theta), loading)).max()
    assert 0.1 < force / preset.rated_force < 3.0
    assert preset.rated_stroke is None or 0.01 < preset.rated_stroke < 0.1


def work(preset, command):
    """Of the settled half of a sinusoid at a held command."""
    unit = preset.spec.command_unit
    motion = sine()
    loading = replace(motion, command=command, command_unit=unit)
    force = simulate_force(preset.spec, np.array(preset.theta), loading)
    return np.trapezoid((force * motion.velocity)[400:], dx=DT)


def test_it_runs_and_dissipates_and_more_command_makes_more_force(preset):
    dissipated = work(preset, preset.largest_command)
    assert dissipated > 0.0
    assert preset.spec.command_unit is None or dissipated > 1.5 * work(preset, 0.0)


def test_an_unknown_set_is_refused_with_those_that_exist():
    refusal(damper("modified_bouc_wen").preset, "dyke", match="did you mean dyke1996")


@pytest.mark.parametrize("force", [100e3, 200e3, 400e3])
def test_a_set_that_is_scaled_by_similarity_has_that_share_of_the_force(force):
    """At the same motion and command, to rounding; and says of whom it is."""
    (large,) = (each for each in presets() if each.name == "yoshida2004")
    (scaled,) = (each for each in presets() if each.name == f"yoshida2004_{1e-3 * force:.0f}kN")
    assert scaled.rated_force == force
    assert scaled.source.startswith("scaled by similarity from Yoshida, Dyke")
    assert "no damper that was built" in scaled.note
    for command in (0.0, 5.0, 10.0):
        loading = replace(sine(), command=command, command_unit="V")
        whole, part = (simulate_force(each.spec, np.array(each.theta), loading) for each in (large, scaled))
        np.testing.assert_allclose(part, force / 1e6 * whole, rtol=1e-9, atol=1e-6)
