"""One model for all tests of a rig: laws, observation and effects of each test are found again from synthetic tests."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from sinusoidal_tests import driven_test, harmonic, sinusoidal_test

import mrwork as mr
from mrwork.dampers.spec import law_limits
from mrwork.identification import Fit, FitSettings, Objective, Race
from mrwork.identification.commands import with_dependences_at
from mrwork.identification.equivalent import leaves_range, within_range
from mrwork.identification.excerpts import excerpt
from mrwork.identification.minimise import level_search
from mrwork.identification.minimise.level_search import unlike_tests
from mrwork.identification.residual import estimated_of, without_effects
from mrwork.identification.result import free_run
from mrwork.identification.suspicious import far_worse, worse_together
from mrwork.records import DamperTest, Observation, cut
from mrwork.records.observation import EFFECTS

PRESET = mr.damper("static_hysteretic").preset("kwok2006")
TRUTH = np.array(PRESET.theta)
CURRENTS = (0.0, 0.5, 1.0, 1.5)
NOISE_N = 5.0
EACH = tuple(EFFECTS[name] for name in ("offset", "gain", "delay"))
SEARCH = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=25))
TRUE_LAWS = {"c": "linear", "k": "linear", "alpha": "quadratic", "delta": "linear", "f0": "linear"}
# The hysteresis changes side within one sample, so no test tells over which displacement.
FIXED = {"x_s": (1e-4, 1e-4)}


def record(current: float, *, rng: int = 0) -> DamperTest:
    """A sinusoidal test of the published damper, with noise in the force alone."""
    draws = [rng, round(100 * current)]
    shape = {"dt": 4e-3, "n_time": 750, "noise_n": NOISE_N, "rng": draws, "command": current}
    return replace(driven_test(PRESET.spec, TRUTH, (0.01, 1.0), **shape), n_settle=100)


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    return tuple(record(current) for current in CURRENTS)


@pytest.fixture(scope="module")
def fit(tests: tuple[DamperTest, ...]):
    return mr.identify(PRESET.spec, tests, search=SEARCH, bounds=FIXED, rng=2)


def test_the_laws_are_recovered_within_their_standard_errors(fit) -> None:
    assert fit.status == "converged"
    for estimate, true in zip(fit.estimates, TRUTH, strict=True):
        if estimate.state == "fixed":
            assert estimate.value == true
            continue
        assert estimate.standard_error is not None
        assert abs(estimate.value - true) < 5.0 * estimate.standard_error, estimate
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.05)


def test_the_fit_knows_its_laws(fit) -> None:
    assert fit.spec == PRESET.spec
    _, quality = free_run(fit.spec, np.array(fit.theta), record(1.2, rng=9))
    assert quality.rmse_n == pytest.approx(NOISE_N, rel=0.1)


@pytest.mark.long
def test_a_smoothed_record_misleads_a_model_that_is_not_told(tests: tuple[DamperTest, ...], fit) -> None:
    observation = Observation(average_seconds=0.1)
    smoothed = [replace(test, force=observation.observe(test.force, test.dt), n_settle=125) for test in tests]
    told = [replace(test, observation=observation) for test in smoothed]
    aware = mr.identify(PRESET.spec, told, search=SEARCH, bounds=FIXED, rng=2)
    naive = mr.identify(PRESET.spec, smoothed, search=SEARCH, bounds=FIXED, rng=2)
    beta = [estimate.name for estimate in fit.estimates].index("beta")
    assert abs(aware.theta[beta] / TRUTH[beta] - 1.0) < 0.1 < abs(naive.theta[beta] / TRUTH[beta] - 1.0)
    assert aware.fit_percent > naive.fit_percent + 0.5
    assert aware.quality[0].observation == observation


def test_effects_of_each_test_are_told_from_the_damper(tests: tuple[DamperTest, ...]) -> None:
    offsets, gains, delays = (120.0, -60.0, 30.0, 0.0), (1.03, 0.98, 1.0, 1.01), (2e-3, -1e-3, 0.0, 1e-3)
    shifted = [
        replace(
            test,
            force=Observation(delay_seconds=delay, gain=gain, offset=offset).observe(test.force, test.dt),
        )
        for test, offset, gain, delay in zip(tests, offsets, gains, delays, strict=True)
    ]
    for test, offset, gain, delay in zip(shifted, offsets, gains, delays, strict=True):
        _, quality = free_run(PRESET.spec, TRUTH, test, each=EACH)
        assert quality.estimated.offset == pytest.approx(offset, abs=2.0)
        assert quality.estimated.gain == pytest.approx(gain, abs=5e-3)
        # To first order in the delay: a fifth of a sample is left at a delay of one sample.
        assert quality.estimated.delay_seconds == pytest.approx(delay, abs=4e-4)
        assert quality.rmse_n < 2.0 * NOISE_N


def test_an_offset_of_each_test_leaves_none_to_the_model(tests: tuple[DamperTest, ...]) -> None:
    shifted = [replace(test, force=test.force + 130.0) for test in tests]
    shifted_fit = mr.identify(PRESET.spec, shifted, search=SEARCH, bounds=FIXED, observe="offset=each", rng=2)
    values = dict(zip(shifted_fit.spec.names, shifted_fit.theta, strict=True))
    assert (values["f0.0"], values["f0.1"]) == (0.0, 0.0)
    assert values["alpha.1"] == pytest.approx(918.0, rel=0.01)
    plain = mr.damper("static_hysteretic")
    held = mr.identify(plain, shifted[2], search=SEARCH, bounds=FIXED, observe="offset=each", rng=2)
    by_name = {estimate.name: estimate for estimate in held.estimates}
    assert (by_name["f0"].value, by_name["f0"].state) == (0.0, "fixed")
    assert held.quality[0].estimated.offset == pytest.approx(130.0 + 57.0 - 18.0, abs=2.0)


def test_effects_of_rows_are_those_of_each_alone() -> None:
    rng = np.random.default_rng(3)
    force, measured = rng.normal(size=(4, 300)).cumsum(axis=1), rng.normal(size=300).cumsum()
    together = without_effects(force, measured, EACH)
    for row, residual in zip(force, together, strict=True):
        found = estimated_of(row, measured, 1.0, EACH)
        expected = found.gain * row - found.delay_seconds * np.gradient(row) + found.offset - measured
        np.testing.assert_allclose(residual, expected, rtol=0, atol=1e-9 * np.max(np.abs(measured)))


def test_misfit_and_residuals_agree_for_every_observation_model(tests: tuple[DamperTest, ...]) -> None:
    rng = np.random.default_rng(5)
    theta = TRUTH * rng.uniform(0.9, 1.1, (70, TRUTH.size))
    observed = tuple(replace(test, observation=Observation(average_seconds=0.03)) for test in tests)
    for case in (
        Objective.of(PRESET.spec, tests),
        Objective.of(PRESET.spec, tests, FitSettings(observe="offset=each")),
        Objective.of(PRESET.spec, observed, FitSettings(observe=["gain=each", "delay=each"])),
    ):
        np.testing.assert_allclose(case(theta), np.linalg.norm(case.residuals(theta), axis=1), rtol=1e-10)


def test_the_root_mean_square_over_tests_is_what_is_minimised(tests: tuple[DamperTest, ...]) -> None:
    theta = TRUTH[None] * np.linspace(0.9, 1.1, 5)[:, None]
    each = np.array([Objective.of(PRESET.spec, (test,))(theta) for test in tests])
    mean = np.sqrt(np.mean(each**2, axis=0))
    np.testing.assert_allclose(Objective.of(PRESET.spec, tests)(theta), mean, rtol=1e-12)


def test_a_test_without_the_models_command_is_refused(tests: tuple[DamperTest, ...]) -> None:
    in_volts = [replace(test, current=None, voltage=test.current) for test in tests]
    refusal(mr.identify, PRESET.spec, in_volts, search=SEARCH, match="command in A, the test has 0 V")


def test_an_interrupt_of_the_first_search_keeps_its_best(tests: tuple[DamperTest, ...]) -> None:
    def interrupt(progress: mr.Progress) -> None:
        if progress.stage == "search" and progress.numbers["evaluations"] > 500:
            raise KeyboardInterrupt

    with pytest.raises(mr.errors.Interrupted) as caught:
        mr.identify(PRESET.spec, tests, search=SEARCH, bounds=FIXED, rng=2, on_progress=interrupt)
    kept = caught.value.result
    assert kept.status == "interrupted"
    assert kept.spec == PRESET.spec
    # One command was looked at: every law is flat, and fits that command better than nothing.
    assert kept.theta[kept.spec.names.index("alpha.1")] == pytest.approx(0.0, abs=1e-9)
    assert max(quality.fit_percent for quality in kept.quality) > 30.0


def test_an_excerpt_keeps_three_cycles_and_their_shape() -> None:
    test = mr.synthetic_test("spencer1997_fast")
    short = excerpt(test)
    period = 1.0 / 5.0
    assert short.dt * short.n_time == pytest.approx(3.0 * period + short.n_settle * short.dt, rel=0.1)
    assert np.ptp(short.displacement) == pytest.approx(np.ptp(test.displacement), rel=0.02)
    assert period / short.dt >= 199.0


def test_a_test_is_far_worse_above_five_times_its_own_misfit_which_noise_limits() -> None:
    alone = np.array([0.04, 0.04, 0.001, np.nan])
    assert far_worse(np.array([0.19, 0.21, 0.09, 0.9]), alone).tolist() == [1]
    # Two percent is noise: a test that is described perfectly alone accuses nothing below ten.
    assert far_worse(np.array([0.1, 0.1, 0.11, 0.9]), alone).tolist() == [2]


def test_a_false_minimum_is_suspected_where_the_best_was_not_found_again() -> None:
    tests = [mr.synthetic_test("rd1005_1a")] * 5
    joint, alone = np.full(5, 0.3), np.full(5, 0.04)
    worse = far_worse(joint, alone)
    told, limited = (worse_together(tests, worse, joint, alone, suspected=each) for each in (True, False))
    assert "(70.0 % for 96.0 %)" in told.message
    assert (told.code, limited.code) == ("false_minimum", "worse_together")


COMMANDS = (0.0, 1.0)
MOTIONS = ((0.010, 1.0), (0.002, 2.0), (0.005, 4.0))


def loop_test(motion: tuple[float, float], command: float, seed: int) -> DamperTest:
    """Of dahl with sharp loops, whose k_w is linear in the command."""
    theta = (200.0 + 400.0 * command, 5e4, 20.0)
    test = sinusoidal_test("dahl", theta, motion, noise=0.02, rng=seed, cycles=8)
    return replace(test, current=command, name=f"{motion} at {command} A")


def test_a_coarse_test_that_the_search_leaves_out_is_simulated_by_the_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every third of a second, these loops are too stiff; the fastest test of each command is alone in the search."""
    monkeypatch.setattr(level_search, "_PER_COMMAND", 1)
    fine = [loop_test(motion, command, 1) for command in COMMANDS for motion in MOTIONS]
    coarse = [cut(loop_test((0.0101, 1.0), command, 2), every=20) for command in COMMANDS]
    spec = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A")
    fit = mr.identify(spec, [*fine, *coarse], rng=1)
    assert fit.status == "converged"
    assert fit.fit_percent > 80.0


def sine_test(amplitude: float, frequency: float) -> DamperTest:
    """A test of a sinusoidal motion [m, Hz]; its force does not matter."""
    test = mr.synthetic_test("spencer1997")
    loading = harmonic(test.dt * np.arange(test.n_time), (amplitude, frequency))
    moved = {"displacement": loading.displacement, "velocity": loading.velocity}
    return replace(test, name=f"{amplitude:g}m {frequency:g}Hz", **moved)


def test_the_extremes_of_stroke_and_velocity_are_taken_in_the_order_of_the_tests() -> None:
    middle = [sine_test(0.010, 2.0), sine_test(0.011, 2.0), sine_test(0.009, 2.0)]
    ends = [sine_test(0.001, 20.0), sine_test(0.1, 0.2), sine_test(0.1, 20.0)]
    tests = [middle[0], ends[0], middle[1], ends[1], ends[2], middle[2]]
    assert unlike_tests(tests, 3) == tuple(ends)
    # Few tests are all taken.
    assert unlike_tests(tests, 6) == tuple(tests)


def test_of_repeated_motions_each_test_is_taken_once() -> None:
    tests = [replace(sine_test(0.01, 1.0), name=f"repeat {number}") for number in range(5)]
    taken = unlike_tests(tests, 3)
    assert len({test.name for test in taken}) == 3


FIVE_COMMANDS = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
# All its starts end where the yield force is limited to its lower bound at one of the commands.
SHORT = Race(samples=2, starts=2, population=6, generations=2, most_rounds=1)


def fit_of(yield_forces: tuple[float, ...]) -> Fit:
    """A quadratic law for yield forces at five commands, which no quadratic law follows."""
    tests = [
        replace(
            sinusoidal_test("dahl", (force, 2000.0, 0.0), (0.010, 1.0), noise=0.02, rng=seed),
            current=float(command),
            name=f"{command} A",
        )
        for seed, (force, command) in enumerate(zip(yield_forces, FIVE_COMMANDS, strict=True))
    ]
    spec = mr.damper("dahl").with_current_laws({"k_w": "quadratic"})
    return mr.identify(spec, tests, bounds={"f0": (0.0, 0.0)}, search=SHORT, threads=1)


@pytest.mark.parametrize(
    ("yield_forces", "least"),
    [((41.5, 41.6, 65.3, 343.9, 1516.5), 0.4159), ((33.2, 46.0, 51.3, 301.8, 1213.5), 0.4639)],
)
def test_a_false_minimum_with_a_limited_law_is_left(yield_forces: tuple[float, ...], least: float) -> None:
    """The least misfits are those of 150 local minimisations from random starts, on the same tests."""
    fit = fit_of(yield_forces)
    assert fit.nrmse == pytest.approx(least, rel=2e-3)
    assert not law_limits(fit.spec, np.array(fit.theta), (0.0, 1.0))


def test_where_the_least_misfit_has_a_limited_law_the_fit_says_so() -> None:
    fit = fit_of((418.5, 62.0, 688.8, 53.0, 919.6))
    assert "law_leaves_range" in {each.code for each in fit.remarks}


@pytest.mark.parametrize("law", ["quadratic:0,0.5,1", "quadratic", "exponential"])
def test_laws_are_moved_into_their_ranges_and_others_stay(law: str) -> None:
    spec = mr.damper("viscous_dahl").with_current_laws({"k_w": law, "k_x": "linear:0,1"})
    limited = {"quadratic:0,0.5,1": (40.0, 5.0, 900.0), "quadratic": (40.0, -1000.0, 1860.0)}
    coefficients = limited.get(law, (-50.0, 10.0, 2.0))
    theta = np.array([700.0, 300.0, *coefficients, 2000.0, 20.0])
    assert leaves_range(spec, theta, FIVE_COMMANDS) == ("k_w",)
    moved = within_range(spec, theta, FIVE_COMMANDS)
    assert not leaves_range(spec, moved, FIVE_COMMANDS)
    assert moved[[0, 1, 5, 6]].tolist() == theta[[0, 1, 5, 6]].tolist()
    assert within_range(spec, moved, FIVE_COMMANDS).tolist() == moved.tolist()


def test_a_typed_polynomial_is_one_of_the_parameter_at_tested_commands(tests: tuple[DamperTest, ...]) -> None:
    model = PRESET.spec.without_laws.with_current_laws({}, unit="A")
    spec = with_dependences_at(model, {"c": "linear", "alpha": "quadratic", "beta": "log_linear"}, tests)
    laws = {name: str(law) for name, law in spec.laws_by_name.items() if not law.is_constant}
    assert laws == {"c": "linear:0,1.5", "alpha": "quadratic:0,0.5,1.5", "beta": "log_linear:0,1.5"}
    # What the tests were made with: no other form of these laws is better.
    fit = mr.identify(with_dependences_at(model, TRUE_LAWS, tests), tests, bounds=FIXED, rng=2)
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.05)
    assert "other_laws_better" not in {each.code for each in fit.remarks}
