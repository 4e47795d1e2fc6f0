"""Plan of the next test: known answers, variances that never grow, limits, agreement with draws."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.records import DamperTest, cut
from mrwork.records.damper_test import loading_of
from mrwork.uncertainty.candidate_tests import (
    Candidate,
    Limits,
    candidate_grid,
    excitation_of,
    harmonic_motion,
    read_candidates,
)
from mrwork.uncertainty.planning import LinearisedPosterior, responses

STATIC = mr.damper("static_hysteretic")
HELD = {
    each.name: (each.nominal, each.nominal) for each in STATIC.parameters if each.name in ("x_s", "delta")
}
GRID = tuple(
    Candidate(amplitude=amplitude, frequency=frequency)
    for amplitude in (0.002, 0.005, 0.01, 0.02)
    for frequency in (0.25, 1.0, 3.0)
)


@pytest.fixture(scope="module")
def test() -> DamperTest:
    return cut(mr.synthetic_test("rd1005_1a"), every=4)


@pytest.fixture(scope="module")
def fit(test: DamperTest) -> mr.Fit:
    return mr.identify(STATIC, test, rng=1, bounds=HELD)


def with_laws(model: mr.DamperSpec, values: dict[str, float], current: float, test: DamperTest) -> DamperTest:
    """A record of the motion of a test at a current, with noise in its force."""
    theta = np.array([values[name] for name in model.names])
    loading = loading_of(replace(test, current=current), model)
    force = mr.simulate_force(model, theta, loading)
    noise = 8.0 * np.random.default_rng(round(10 * current)).standard_normal(force.size)
    return replace(test, name=f"{current:g} A", force=force + noise, current=current)


def test_what_only_large_strokes_show_calls_for_a_large_stroke(test: DamperTest) -> None:
    # tanh(x/x_s) is a straight line within 10 mm of an x_s of 0.1 m: only beyond does it tell x_s from delta.
    free = mr.identify(STATIC, test, rng=1)
    plan = mr.plan(free, [test], GRID, band="x_s")
    assert plan.gains[0].candidate.amplitude == 0.02
    small = [each.gain for each in plan.gains if each.candidate.amplitude == 0.002]
    assert max(small) < 0.3 * plan.gains[0].gain


def test_a_rig_of_motions_that_repeat_asks_for_a_random_one(fit: mr.Fit, test: DamperTest) -> None:
    (asked,) = mr.plan(fit, [test], GRID[:3]).remarks
    assert asked.code == "motions_repeat"
    assert "random motion of 1 to 1 Hz, up to 10 mm and 63.8 mm/s" in asked.message
    growing = replace(test, displacement=np.linspace(0.2, 1.0, test.n_time) * test.displacement)
    assert not mr.plan(fit, [test, growing], GRID[:3]).remarks


def test_what_only_fast_tests_show_calls_for_a_fast_test(fit: mr.Fit, test: DamperTest) -> None:
    # The viscous share of the force grows with the velocity.
    plan = mr.plan(fit, [test], GRID, band="c")
    best = plan.gains[0].candidate
    assert best.peak_velocity == max(each.peak_velocity for each in GRID)


def test_a_law_calls_for_the_current_that_was_not_tested(test: DamperTest) -> None:
    model = mr.damper("bingham").with_current_laws({"f_c": "linear"})
    values = dict(zip(model.names, model.nominal, strict=True)) | {"f_c.0": 100.0, "f_c.1": 400.0}
    tests = [with_laws(model, values, current, test) for current in (0.5, 0.55)]
    start = mr.identify(mr.damper("bingham"), tests[0], rng=1)
    estimates = tuple(
        replace(start.estimates[0], name=name, value=values[name], lower=low, upper=high, state="")
        for name, low, high in ((each.name, each.lower, each.upper) for each in model.parameters)
    )
    fit = replace(start, estimates=estimates, current=model.current_laws)
    candidates = candidate_grid(
        model, tests, amplitudes=[0.01], frequencies=[1.0], commands=[0.0, 0.25, 0.5, 1.0, 2.0]
    )
    plan = mr.plan(fit, tests, candidates, band="f_c.1")
    order = [each.candidate.command for each in plan.gains]
    assert order[0] in (0.0, 2.0)
    assert order[-1] == 0.5
    refusal(candidate_grid, STATIC, tests, commands=[1.0], match="without current laws")
    # Of milliamperes.
    refusal(candidate_grid, model, tests, commands=[300.0, 600.0], match="command of 600 A")


@pytest.mark.parametrize("band", ["force", "energy", "c", "k", "f0"])
def test_no_test_widens_a_band(fit: mr.Fit, test: DamperTest, band: str) -> None:
    plan = mr.plan(fit, [test], GRID, band=band)
    assert len(plan.gains) == len(GRID)
    for each in plan.gains:
        assert 0.0 <= each.gain <= 1.0
        assert each.deviation <= plan.deviation
        assert each.deviation == pytest.approx(plan.deviation * np.sqrt(1.0 - each.gain))
    assert [each.gain for each in plan.gains] == sorted((each.gain for each in plan.gains), reverse=True)


def test_the_band_now_is_that_of_the_information(fit: mr.Fit, test: DamperTest) -> None:
    plan = mr.plan(fit, [test], GRID[:1], band="k")
    error = fit.parameters["k"].standard_error
    # The prior takes next to nothing away.
    assert plan.deviation == pytest.approx(error, rel=0.01)


def test_the_same_test_again_halves_what_the_data_alone_say(fit: mr.Fit, test: DamperTest) -> None:
    known = LinearisedPosterior.of(fit, [test])
    (again,) = responses(known, [excitation_of(test)])
    # Noise in the motion and the cycles that count differ, and the prior is in the precision only.
    np.testing.assert_allclose(np.diag(again.information), np.diag(known.precision), rtol=0.1)


def test_targets_say_where_the_band_is_wanted(fit: mr.Fit, test: DamperTest) -> None:
    slow, fast = Candidate(amplitude=0.005, frequency=0.1), Candidate(amplitude=0.02, frequency=3.0)
    best = [
        mr.plan(fit, [test], GRID, targets=[target]).gains[0].candidate.peak_velocity
        for target in (slow, fast)
    ]
    assert best[0] < best[1]


def test_derivatives_of_a_candidate_are_those_of_its_force(fit: mr.Fit, test: DamperTest) -> None:
    known = LinearisedPosterior.of(fit, [test])
    (answer,) = responses(known, GRID[:1])
    loading, counted = harmonic_motion(GRID[0], STATIC)
    unit = known.box.unit_from_theta(known.theta)
    force, less, more = (
        mr.simulate_force(STATIC, known.box.theta_from_unit(unit + step * np.eye(unit.size)[0]), loading)[
            counted
        ]
        for step in (0.0, -1e-4, 1e-4)
    )
    slope = np.std(force) ** -1 * (more - less) / 2e-4
    assert answer.force[0, 0] == pytest.approx(np.mean(slope**2), rel=1e-4)
    # A dashpot dissipates c v^2: the energy of a cycle grows with c by pi omega a^2, and no more.
    assert loading.velocity is not None
    cycles = (counted.stop - counted.start) * loading.dt * GRID[0].frequency
    per_cycle = float(force @ loading.velocity[counted]) * loading.dt / cycles
    omega = 2.0 * np.pi * GRID[0].frequency
    grown = np.pi * omega * GRID[0].amplitude ** 2 * known.box.unit_slope(known.theta)[0] / per_cycle
    assert answer.energy[0, 0] == pytest.approx(grown**2, rel=1e-3)


def test_the_default_grid_lies_about_what_was_tested(test: DamperTest) -> None:
    grid = candidate_grid(STATIC, [test])
    amplitudes = sorted({each.amplitude for each in grid})
    assert (amplitudes[0], amplitudes[-1]) == (0.005, 0.02)
    assert 0.01 in amplitudes
    assert max(each.peak_velocity for each in grid) <= 1.5 * 2.0 * np.pi * 0.01 * (1.0 + 1e-9)


def test_the_rig_sets_limits(test: DamperTest) -> None:
    limits = Limits(stroke=0.02, peak_velocity=0.1)
    for each in candidate_grid(STATIC, [test], limits=limits):
        assert 2.0 * each.amplitude <= 0.02
        assert each.peak_velocity <= 0.1
    refusal(candidate_grid, STATIC, [test], amplitudes=[0.1], limits=limits, match="limits of the rig")


def test_candidates_come_from_a_file(tmp_path: Path) -> None:
    table = tmp_path / "tests.csv"
    table.write_text("frequency,amplitude,note\n1,0.01,a\n2,0.02,b\n")
    read = read_candidates(table, STATIC)
    assert read == (Candidate(amplitude=0.01, frequency=1.0), Candidate(amplitude=0.02, frequency=2.0))
    assert read_candidates(table, STATIC, Limits(stroke=0.03)) == read[:1]
    table.write_text("frequency;amplitude;note\n1,0;0,01;a\n2,0;0,02;b\n")
    assert read_candidates(table, STATIC) == read
    table.write_text("frequency,amplitude\n1,0.01\n")
    model = STATIC.with_current_laws({"alpha": "linear"})
    refusal(read_candidates, table, model, match="line 2: .* current")
    table.write_text("amplitude,frequency\n0.01,0\n")
    refusal(read_candidates, table, STATIC, match="line 2: .* positive")


def test_what_is_held_has_no_band_and_what_no_rig_can_run_is_refused(fit: mr.Fit, test: DamperTest) -> None:
    refusal(mr.plan, fit, [test], GRID[:1], band="delta", match="delta is fixed")
    refusal(Candidate, amplitude=0.01, frequency=1e-9, match="frequency.* is 1e-09")


def test_one_test_gives_the_result_of_a_list_of_it() -> None:
    test = cut(mr.synthetic_test("rd1005_1a"), every=4)
    fit = mr.identify("dahl", test)
    candidates = [Candidate(amplitude=0.01, frequency=1.0)]
    assert mr.identify("dahl", [test]).theta == fit.theta
    assert candidate_grid(fit.spec, test) == candidate_grid(fit.spec, [test])
    assert mr.plan(fit, test, candidates) == mr.plan(fit, [test], candidates)
    assert mr.profile(fit, test).profiles == mr.profile(fit, [test]).profiles
