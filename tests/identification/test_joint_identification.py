"""One model for all tests of a rig: laws, observation and nuisance parameters are found again from synthetic tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sentences import Refused

from mrwork import identify
from mrwork.dampers import damper
from mrwork.errors import Interrupted
from mrwork.identification import FitSettings, Objective, Progress, free_run
from mrwork.identification.residual import nuisance_of, without_nuisance
from mrwork.records import DamperTest, Observation
from mrwork.records.window import excerpt
from mrwork.search import EfficientGA, StopRules
from mrwork.simulation import Loading, simulate_force
from mrwork.synthetic import synthetic_test

PRESET = damper("static_hysteretic").preset("kwok2006")
TRUTH = np.array(PRESET.theta)
CURRENTS = (0.0, 0.5, 1.0, 1.5)
NOISE_N = 5.0
SEARCH = EfficientGA(stop=StopRules(max_generations=40))
# The hysteresis changes side within one sample, so no test tells over which displacement.
FIXED = {"x_s": (1e-4, 1e-4)}


def record(current: float, *, amplitude: float = 0.01, frequency: float = 1.0, rng: int = 0) -> DamperTest:
    """A sinusoidal test of the published damper, with noise in the force alone."""
    dt = 2e-3
    time = dt * np.arange(round(3.0 / frequency / dt))
    phase = 2.0 * np.pi * frequency * time
    displacement, velocity = amplitude * np.sin(phase), 2.0 * np.pi * frequency * amplitude * np.cos(phase)
    loading = Loading(dt=dt, displacement=displacement, velocity=velocity, command=current, command_unit="A")
    force = simulate_force(PRESET.spec, TRUTH, loading)
    template = synthetic_test("rd1005_1a")
    noise = NOISE_N * np.random.default_rng([rng, round(100 * current)]).standard_normal(time.size)
    return replace(
        template,
        name=f"{current:g} A",
        dt=dt,
        displacement=displacement,
        velocity=velocity,
        force=force + noise,
        n_settle=200,
        current=current,
        voltage=None,
    )


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    return tuple(record(current) for current in CURRENTS)


@pytest.fixture(scope="module")
def fit(tests: tuple[DamperTest, ...]):
    return identify(PRESET.spec, tests, search=SEARCH, bounds=FIXED, rng=2)


def test_the_laws_are_recovered_within_their_standard_errors(fit) -> None:
    assert fit.status == "converged"
    for estimate, true in zip(fit.estimates, TRUTH, strict=True):
        if estimate.remark == "fixed":
            assert estimate.value == true
            continue
        assert estimate.standard_error is not None
        assert abs(estimate.value - true) < 5.0 * estimate.standard_error, estimate
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.05)


def test_the_fit_knows_its_laws(fit) -> None:
    assert fit.spec == PRESET.spec
    _, quality = free_run(fit.spec, np.array(fit.theta), record(1.2, rng=9))
    assert quality.rmse_n == pytest.approx(NOISE_N, rel=0.1)


def test_a_smoothed_record_misleads_a_model_that_is_not_told(tests: tuple[DamperTest, ...], fit) -> None:
    observation = Observation(average_seconds=0.1)
    smoothed = [replace(test, force=observation.observe(test.force, test.dt), n_settle=250) for test in tests]
    told = [replace(test, observation=observation) for test in smoothed]
    aware = identify(PRESET.spec, told, search=SEARCH, bounds=FIXED, rng=2)
    naive = identify(PRESET.spec, smoothed, search=SEARCH, bounds=FIXED, rng=2)
    beta = [estimate.name for estimate in fit.estimates].index("beta")
    assert abs(aware.theta[beta] / TRUTH[beta] - 1.0) < 0.1 < abs(naive.theta[beta] / TRUTH[beta] - 1.0)
    assert aware.fit_percent > naive.fit_percent + 0.5
    assert aware.quality[0].observation == observation


def test_nuisance_parameters_are_told_from_the_damper(tests: tuple[DamperTest, ...]) -> None:
    offsets, levels, delays = (120.0, -60.0, 30.0, 0.0), (1.03, 0.98, 1.0, 1.01), (2e-3, -1e-3, 0.0, 1e-3)
    shifted = [
        replace(
            test,
            force=Observation(delay_seconds=delay, gain=level, offset=offset).observe(test.force, test.dt),
        )
        for test, offset, level, delay in zip(tests, offsets, levels, delays, strict=True)
    ]
    for test, offset, level, delay in zip(shifted, offsets, levels, delays, strict=True):
        _, quality = free_run(PRESET.spec, TRUTH, test, nuisances=("offset", "level", "delay"))
        assert quality.nuisance.offset == pytest.approx(offset, abs=2.0)
        assert quality.nuisance.level == pytest.approx(level, abs=5e-3)
        # To first order in the delay: a fifth of a sample is left at a delay of one sample.
        assert quality.nuisance.delay == pytest.approx(delay, abs=4e-4)
        assert quality.rmse_n < 2.0 * NOISE_N


def test_an_offset_of_each_test_leaves_none_to_the_model(tests: tuple[DamperTest, ...]) -> None:
    shifted = [replace(test, force=test.force + 130.0) for test in tests]
    shifted_fit = identify(PRESET.spec, shifted, search=SEARCH, bounds=FIXED, nuisances=("offset",), rng=2)
    values = dict(zip(shifted_fit.spec.names, shifted_fit.theta, strict=True))
    assert (values["f0.0"], values["f0.1"]) == (0.0, 0.0)
    assert values["alpha.1"] == pytest.approx(918.0, rel=0.01)
    plain = damper("static_hysteretic")
    held = identify(plain, shifted[2], search=SEARCH, bounds=FIXED, nuisances=("offset",), rng=2)
    by_name = {estimate.name: estimate for estimate in held.estimates}
    assert (by_name["f0"].value, by_name["f0"].remark) == (0.0, "fixed")
    assert held.quality[0].nuisance.offset == pytest.approx(130.0 + 57.0 - 18.0, abs=2.0)


def test_nuisance_parameters_of_rows_are_those_of_each_alone() -> None:
    rng = np.random.default_rng(3)
    force, measured = rng.normal(size=(4, 300)).cumsum(axis=1), rng.normal(size=300).cumsum()
    names = ("offset", "level", "delay")
    together = without_nuisance(force, measured, names)
    for row, residual in zip(force, together, strict=True):
        found = nuisance_of(row, measured, 1.0, names)
        expected = found.level * row - found.delay * np.gradient(row) + found.offset - measured
        np.testing.assert_allclose(residual, expected, rtol=0, atol=1e-9 * np.max(np.abs(measured)))


def test_misfit_and_residuals_agree_for_every_observation_model(tests: tuple[DamperTest, ...]) -> None:
    rng = np.random.default_rng(5)
    theta = TRUTH * rng.uniform(0.9, 1.1, (70, TRUTH.size))
    observed = tuple(replace(test, observation=Observation(average_seconds=0.03)) for test in tests)
    for case in (
        Objective.of(PRESET.spec, tests),
        Objective.of(PRESET.spec, tests, FitSettings(nuisances=("offset",))),
        Objective.of(PRESET.spec, observed, FitSettings(nuisances=("level", "delay"))),
        Objective.of(PRESET.spec, tests, FitSettings(power=4.0)),
        Objective.of(PRESET.spec, observed, FitSettings(power=3.0)),
    ):
        np.testing.assert_allclose(case(theta), np.linalg.norm(case.residuals(theta), axis=1), rtol=1e-10)


def test_the_power_of_the_mean_over_tests_is_what_is_minimised(
    tests: tuple[DamperTest, ...], refused: Refused
) -> None:
    theta = TRUTH[None] * np.linspace(0.9, 1.1, 5)[:, None]
    each = np.array([Objective.of(PRESET.spec, (test,))(theta) for test in tests])
    for power in (2.0, 4.0, 7.5):
        mean = np.mean(each**power, axis=0) ** (1.0 / power)
        np.testing.assert_allclose(
            Objective.of(PRESET.spec, tests, FitSettings(power=power))(theta), mean, rtol=1e-12
        )
    for power in (1.0, 1e3):
        refused(identify, PRESET.spec, tests, power=power)


def test_a_higher_power_helps_the_worst_test(tests: tuple[DamperTest, ...]) -> None:
    # One yield force for all currents: no model fits, and each power shares the misfit in its own way.
    laws = {"c": "linear"}
    spec = damper("static_hysteretic").with_current_laws(laws)
    rest = tests[1:]
    least, flatter = (
        identify(spec, rest, search=SEARCH, bounds=FIXED, power=power, rng=2) for power in (2.0, 6.0)
    )
    assert max(each.nrmse for each in flatter.quality) < max(each.nrmse for each in least.quality)
    assert flatter.nrmse > least.nrmse
    assert flatter.provenance.settings["power"] == 6.0


def test_too_few_commands_for_a_law_are_refused(tests: tuple[DamperTest, ...], refused: Refused) -> None:
    refused(identify, PRESET.spec, tests[:2], search=SEARCH)


def test_a_test_without_the_models_command_is_refused(
    tests: tuple[DamperTest, ...], refused: Refused
) -> None:
    in_volts = [replace(test, current=None, voltage=test.current) for test in tests]
    refused(identify, PRESET.spec, in_volts, search=SEARCH)


def test_an_interrupt_of_the_first_search_keeps_its_best(tests: tuple[DamperTest, ...]) -> None:
    def interrupt(progress: Progress) -> None:
        if progress.stage == "search" and progress.count > 500:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as caught:
        identify(PRESET.spec, tests, search=SEARCH, bounds=FIXED, rng=2, on_progress=interrupt)
    kept = caught.value.result
    assert kept.status == "interrupted"
    assert kept.spec == PRESET.spec
    # One command was looked at: every law is flat, and fits that command better than nothing.
    assert kept.theta[kept.spec.names.index("alpha.1")] == 0.0
    assert max(quality.fit_percent for quality in kept.quality) > 30.0


def test_an_excerpt_keeps_three_cycles_and_their_shape() -> None:
    test = synthetic_test("spencer1997_fast")
    short = excerpt(test)
    period = 1.0 / 5.0
    assert short.dt * short.n_time == pytest.approx(3.0 * period + short.n_settle * short.dt, rel=0.1)
    assert np.ptp(short.displacement) == pytest.approx(np.ptp(test.displacement), rel=0.02)
    assert period / short.dt >= 199.0
