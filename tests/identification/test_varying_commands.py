"""Laws and the lag of the driver, recovered from tests whose command switches or is random, or with constant ones."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from numpy.typing import NDArray
from record_files import write_test
from refusals import command_refusal, refusal
from sentences import Refused
from sinusoidal_tests import driven_test

import mrwork as mr
from mrwork.base.remark import Measured
from mrwork.dampers.dependence import dependence_of
from mrwork.errors import MrworkWarning
from mrwork.identification import Fit, FitSettings, Objective
from mrwork.identification.commands import CommandedTests
from mrwork.identification.excerpts import stretches_of
from mrwork.identification.fit import SearchTrace
from mrwork.identification.identify import identify_with
from mrwork.identification.minimise.driver_lag import missing_lag, polish_with_wanted_lag
from mrwork.identification.minimise.polish import FinalFit, StartingPoints
from mrwork.identification.minimise.varying_search import relative_force
from mrwork.identification.problem import Problem, problem_fingerprint
from mrwork.records.damper_test import loading_of
from mrwork.uncertainty.bands.prediction import folds_of

DT = 2e-3
NOISE_N = 8.0
PLAIN = mr.damper("static_hysteretic")
LAWS: dict[str, mr.dampers.LawName] = {"c": "linear", "alpha": "quadratic"}
SPEC = PLAIN.with_current_laws(LAWS, lag="one_rate")
TRUTH = {
    **{"c.0": 1000.0, "c.1": 1500.0, "k": 500.0, "alpha.0": 100.0, "alpha.1": 1000.0, "alpha.2": -300.0},
    **{"beta": 60.0, "delta": 1.5, "x_s": 1e-4, "f0": 20.0, "eta": 60.0},
}
THETA = np.array([TRUTH[name] for name in SPEC.names])
# The hysteresis changes side within one sample, so no test tells over which displacement.
FIXED = {"x_s": (1e-4, 1e-4)}
SEARCH = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=30))
FEW_GENERATIONS = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=5))

FEW = mr.identification.Race(samples=6, starts=4, population=8, generations=4, most_rounds=1)

Course = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def switching(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(time % 0.42 < 0.2, 0.0, 1.0)


def random_steps(time: NDArray[np.float64]) -> NDArray[np.float64]:
    levels = np.random.default_rng(4).uniform(0.0, 1.0, 100)
    return np.asarray(levels[(time / 0.1).astype(int)])


def random_waves(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Band-limited: a sum of sines that are no multiples of each other."""
    waves = sum(np.sin(2.0 * np.pi * f * time + 9.0 * f) for f in (0.31, 0.83, 1.57, 2.71))
    return np.asarray(np.clip(0.5 + 0.2 * waves, 0.0, 1.0))


@cache
def record(
    command: Course | float,
    *,
    frequency: float = 2.0,
    amplitude: float = 0.01,
    rng: int = 0,
    n_time: int = 2000,
) -> mr.DamperTest:
    """A sinusoidal test of the lagged damper, with noise in the force alone."""
    shape = {"dt": DT, "n_time": n_time, "noise_n": NOISE_N, "rng": [rng, 7]}
    sent, name = (command(DT * np.arange(n_time)), command.__name__) if callable(command) else (command, "")
    return driven_test(SPEC, THETA, (amplitude, frequency), **shape, command=sent, name=name)


def assert_recovered(fit: Fit) -> None:
    # A single search confirms no minimum.
    assert fit.status == "converged" or "genetic was the only search" in fit.status_in_words
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.05)
    for estimate in fit.estimates:
        if estimate.state == "fixed":
            continue
        assert estimate.standard_error is not None
        assert abs(estimate.value - TRUTH[estimate.name]) < 5.0 * estimate.standard_error, estimate


SETS: dict[str, tuple[mr.DamperTest, ...]] = {
    "random steps": (record(random_steps, frequency=1.7, amplitude=0.012),),
    "random waves": (record(random_waves),),
    # Two levels and a third one: enough for a quadratic law only together.
    "switching and one constant": (record(switching), record(0.5, rng=1)),
    "switching and three constants": (record(switching), *(record(u, rng=2) for u in (0.0, 0.5, 1.0))),
}


@pytest.fixture(scope="module", params=list(SETS))
def fit(request: pytest.FixtureRequest) -> Fit:
    return mr.identify(SPEC, SETS[request.param], search=SEARCH, bounds=FIXED, rng=1)


def test_laws_and_lag_are_recovered(fit: Fit) -> None:
    assert_recovered(fit)
    unseen = record(random_steps, frequency=2.6, amplitude=0.008, rng=5)
    predicted = mr.predict(fit, unseen)
    assert float(np.std(predicted.residual)) == pytest.approx(NOISE_N, rel=0.1)


def test_the_default_search_finds_the_laws_and_the_lag() -> None:
    fit = mr.identify(SPEC, record(random_steps), bounds=FIXED)
    assert_recovered(fit)
    assert fit.trace.evaluations[-1] < 20_000


def test_laws_of_more_coefficients_than_levels_are_refused(refused: Refused) -> None:
    refused(mr.identify, SPEC, record(switching), bounds=FIXED)


def test_a_plain_model_of_a_varying_command_warns_and_names_the_law() -> None:
    with pytest.warns(MrworkWarning, match=r"the command varies during tests \(0 to 1 A, stepped\).*--law"):
        mr.identify("bingham", record(switching), search=FEW)


def test_a_prediction_of_a_command_that_nothing_follows_warns() -> None:
    fit = mr.identify("bingham", record(0.5), search=FEW)
    with pytest.warns(MrworkWarning, match=r"varies in switching, and no parameter of this bingham.*--law"):
        mr.predict(fit, record(switching))


def test_a_lag_that_no_test_shows_is_told() -> None:
    problem = Problem.of(SPEC, (record(0.0), record(0.5), record(1.0)), FitSettings())
    assert [each.code for each in problem.foreseen()] == ["lag_rate_hidden"]
    held = Problem.of(SPEC, (record(0.5),), FitSettings(bounds={"eta": (60.0, 60.0)}))
    assert not [*held.foreseen()]


def test_a_lag_that_was_left_out_is_told() -> None:
    without = PLAIN.with_current_laws(LAWS)
    lags = [
        [each.measured for each in fit.remarks if each.code == "lag_missing"]
        for fit in (
            mr.identify(without, test, search=SEARCH, bounds=FIXED)
            for test in (record(random_steps), immediate(random_steps))
        )
    ]
    assert lags in ([[Measured(rate, "1/s")], []] for rate in (40.0, 80.0))


FREEWHEELING = {"eta_rise": 200.0, "eta_fall": 40.0}


@cache
def freewheeling(command: Course, laws: tuple[tuple[str, mr.dampers.LawName], ...] = ()) -> mr.DamperTest:
    """A test of the damper whose current falls slower than it rises."""
    driven = PLAIN.with_current_laws({**LAWS, **dict(laws)}, lag="two_rates")
    test, values = record(command), TRUTH | FREEWHEELING
    force = mr.simulate_force(driven, [values[name] for name in driven.names], loading_of(test, driven))
    return replace(test, force=force + NOISE_N * np.random.default_rng(6).standard_normal(test.n_time))


def test_a_current_that_falls_slower_than_it_rises_has_two_rates() -> None:
    fit = mr.identify(SPEC, freewheeling(random_steps), search=SEARCH, bounds=FIXED)
    assert fit.spec.lag == "two_rates"
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.05)
    for name, rate in FREEWHEELING.items():
        estimate = fit.parameters[name]
        assert estimate.standard_error is not None
        assert abs(estimate.value - rate) < 4.0 * estimate.standard_error < 0.2 * rate
    assert not {each.code for each in fit.remarks} & {"two_rates_at_two_levels", "lag_left_out"}


def test_what_is_said_of_one_rate_keeps_a_second_one_away() -> None:
    fit = mr.identify(SPEC, freewheeling(random_steps), search=SEARCH, bounds=FIXED | {"eta": (1.0, 500.0)})
    assert fit.spec.lag == "one_rate"


def test_two_levels_do_not_tell_two_rates_from_parameters_that_saturate() -> None:
    straight = PLAIN.with_current_laws({"c": "linear", "alpha": "linear"}, lag="one_rate")
    test = freewheeling(switching, (("alpha", "linear"),))
    fit = mr.identify(straight, test, search=SEARCH, bounds=FIXED)
    (told,) = [each for each in fit.remarks if each.code == "two_rates_at_two_levels"]
    assert fit.spec.lag == "two_rates"
    assert fit.parameters["eta_fall"].value == pytest.approx(40.0, rel=0.1)
    assert "a third command between them, about 0.5 A" in told.message
    # A test between the levels tells them apart.
    third = mr.identify(straight, [test, record(0.5)], search=FEW_GENERATIONS, bounds=FIXED)
    assert "two_rates_at_two_levels" not in {each.code for each in third.remarks}


def test_a_lag_that_a_predicted_test_shows_is_told_before_its_motion() -> None:
    """The tests that were fitted run at constant commands, which show none."""
    without = PLAIN.with_current_laws(LAWS)
    constant = [record(level, rng=2) for level in (0.0, 0.5, 1.0)]
    fit = mr.identify(without, constant, search=FEW_GENERATIONS, bounds=FIXED)
    # It moves faster than any of them.
    driven = record(random_steps, frequency=3.0)
    first, *_ = mr.predict(fit, [driven]).remarks
    assert first.code == "lag_unfitted"
    assert first.measured is not None
    assert 40.0 <= first.measured.value <= 80.0
    told = [remark.code for remark in mr.predict(fit, [record(0.5, rng=9)]).remarks]
    assert "lag_unfitted" not in told


@cache
def immediate(command: Course, rng: int = 3) -> mr.DamperTest:
    """A test of the damper without the lag: the coil follows its command at once."""
    without, test = PLAIN.with_current_laws(LAWS), record(command)
    force = mr.simulate_force(without, THETA[:-1], loading_of(test, without))
    return replace(test, force=force + NOISE_N * np.random.default_rng(rng).standard_normal(test.n_time))


@pytest.mark.parametrize("command", [random_steps, random_waves], ids=["steps", "waves"])
def test_a_lag_that_the_tests_do_not_show_is_left_out_and_told(command: Course) -> None:
    test = immediate(command)
    # What is said of the lag must not reach the model without it.
    given = {"bounds": FIXED | {"eta": (2.0, 1e4)}, "starts": [TRUTH]}
    fit = mr.identify(SPEC, test, search=SEARCH, **given)
    assert not fit.spec.n_rates
    assert "eta" not in {*fit.settings.bounds, *fit.settings.starts[0]}
    assert_recovered(fit)
    assert [each.code for each in fit.remarks] == ["lag_left_out"]
    assert f"without it {100.0 * fit.nrmse:.4g} %" in fit.remarks[0].message
    assert mr.predict(fit, immediate(command, rng=8)).residual.std() == pytest.approx(NOISE_N, rel=0.1)
    again = identify_with(fit.spec, (test,), fit.settings.again, warns=False)
    assert again.theta == pytest.approx(fit.theta, rel=1e-2)


def ended_from(test: mr.DamperTest, rate: float) -> FinalFit:
    """Where the final fit ends that starts from the true laws and this rate of the lag."""
    problem = Problem.of(SPEC, (test,), FitSettings(bounds=FIXED))
    points = StartingPoints(
        objective=problem.objective,
        form=problem.form,
        theta=np.array([[*THETA[:-1], rate]]),
        trace=SearchTrace(evaluations=(), best=(), median=(), stop_reason=""),
    )
    return polish_with_wanted_lag(problem, points, on_step=lambda *_: None)


def test_a_lag_whose_search_ended_without_it_is_found_from_the_fit_without() -> None:
    """From the upper bound of the rate no step leads back: it has no effect there."""
    ended = ended_from(record(random_steps), 1e5)
    assert ended.theta[-1] == pytest.approx(TRUTH["eta"], rel=0.02)
    assert ended.remarks == ()


def test_a_command_that_acts_a_sample_later_is_kept_and_told() -> None:
    at_once = immediate(random_steps)
    test = replace(at_once, current=np.roll(np.asarray(at_once.current), -1))
    ended = ended_from(test, 1e4)
    assert ended.problem.spec == SPEC
    assert [each.code for each in ended.remarks] == ["lag_within_a_sample"]


def test_a_resumed_fit_decides_on_the_lag_alike(tmp_path: Path) -> None:
    kept = tmp_path / "journal.jsonl"

    def fitted() -> tuple[float, ...]:
        with closing(mr.Journal(kept, resume=kept.exists())) as journal:
            return mr.identify(
                SPEC, immediate(random_steps), search=FEW_GENERATIONS, bounds=FIXED, journal=journal
            ).theta

    whole = fitted()
    lines = kept.read_text().splitlines(keepends=True)
    for share in (0.6, 0.8, 0.9):
        kept.write_text("".join(lines[: int(share * len(lines))]))
        assert fitted() == whole


SHARP = mr.damper("normalised_bouc_wen").with_current_laws({"c": "linear", "k_w": "linear"})
SHARP_TRUTH = {
    **{"c.0": 1000.0, "c.1": 1500.0, "k": 500.0, "x0": 0.0, "k_w.0": 100.0, "k_w.1": 1000.0},
    **{"rho": 6e4, "sigma": 0.5, "n": 2.0},
}


def sharp_record() -> mr.DamperTest:
    """A loop whose fastest relaxation, 15 000 1/s, is above the limit with which the search begins."""
    test = record(random_steps)
    theta = [SHARP_TRUTH[name] for name in SHARP.names]
    force = mr.simulate_force(SHARP, theta, loading_of(test, SHARP))
    return replace(test, force=force + NOISE_N * np.random.default_rng(3).standard_normal(test.n_time))


def test_the_limit_of_stiffness_is_raised_where_that_pays_and_a_resumed_fit_raises_it_alike(
    tmp_path: Path,
) -> None:
    kept, test = tmp_path / "journal.jsonl", sharp_record()

    def fitted() -> Fit:
        bounds = {name: (SHARP_TRUTH[name], SHARP_TRUTH[name]) for name in ("k", "x0", "sigma", "n")}
        with closing(mr.Journal(kept, resume=kept.exists())) as journal:
            return mr.identify(SHARP, test, search=SEARCH, bounds=bounds, journal=journal)

    whole = fitted()
    assert whole.rmse_n == pytest.approx(NOISE_N, rel=0.05)
    assert dict(zip(SHARP.names, whole.theta, strict=True))["rho"] == pytest.approx(6e4, rel=0.05)
    lines = kept.read_text().splitlines(keepends=True)
    for left in (2, 5, 9):
        kept.write_text("".join(lines[:-left]))
        assert fitted().theta == whole.theta


# All but the two that follow the command.
HELD = FIXED | {name: (TRUTH[name], TRUTH[name]) for name in ("k", "beta", "delta", "f0")}
CHEAP = FitSettings(search=FEW_GENERATIONS, bounds=HELD)


def test_laws_and_lag_are_chosen_from_one_record_by_stretches_left_out() -> None:
    test = record(random_steps, frequency=1.7, amplitude=0.012, n_time=4000)
    parts = stretches_of(test)
    assert len(parts) > 3
    # Each is simulated before it counts, and together they count what the record does, once.
    assert all(part.n_settle for part in parts)
    np.testing.assert_array_equal(
        np.concatenate([part.force[part.counted] for part in parts]), test.force[test.counted]
    )
    choice = mr.choose_laws(PLAIN, test, lagged=True, settings=CHEAP, threads=1)
    chosen = choice.ranking.chosen_standing
    assert f"{len(parts)} stretches of the records, each predicted without itself" in choice.ranking.held_out
    assert {dependence_of(law).fitted_degree for law in chosen.laws.values()} == {1, 2}
    assert choice.best.spec.following == ("c", "alpha")
    assert dict(zip(choice.best.spec.names, choice.best.theta, strict=True))["eta"] == pytest.approx(
        60.0, rel=0.02
    )
    unseen = record(random_steps, frequency=2.6, amplitude=0.008, rng=5)
    assert mr.predict(choice.best, unseen).rmse_n == pytest.approx(NOISE_N, rel=0.1)
    assert choice.best.times_noise is None
    assert "residual_is_structure" not in {each.code for each in choice.best.remarks}


def test_a_choice_without_the_lag_says_the_option_that_takes_it() -> None:
    test = record(random_steps, frequency=1.7, amplitude=0.012, n_time=4000)
    fit = mr.choose_laws(PLAIN, test, settings=CHEAP, threads=1).best
    (structure,) = [each for each in fit.remarks if each.code == "residual_is_structure"]
    assert "lag_missing" in {each.code for each in fit.remarks}
    assert fit.force_noise_n == pytest.approx(NOISE_N, rel=0.1)
    assert fit.times_noise == pytest.approx(fit.rmse_n / NOISE_N, rel=0.1)
    assert structure.measured == Measured(fit.times_noise or 0.0, "")


def test_a_lag_that_the_tests_do_not_show_is_not_among_the_chosen_laws() -> None:
    choice = mr.choose_laws(PLAIN, immediate(random_steps), lagged=True, settings=CHEAP, threads=1)
    assert not choice.best.spec.n_rates
    assert "lag_not_shown" in {each.code for each in choice.ranking.remarks}
    refusal(mr.choose_laws, PLAIN, [record(0.0), record(1.0)], lagged=True, match="shows no lag")


def test_a_lag_whose_part_other_parameters_have_taken_is_told() -> None:
    """Beside a wrong offset no rate alone lowers the misfit visibly."""
    without, start = PLAIN.with_current_laws(LAWS), THETA[:-1].copy()
    start[-1] += 3000.0
    objective = Objective.of(without, (record(random_steps),))
    (remark,) = missing_lag(objective, start, mr.Box.of(without))
    assert remark.measured is not None
    assert remark.measured.value == pytest.approx(TRUTH["eta"], rel=0.05)
    assert remark.words == ("the other parameters fitted anew",)


def test_records_of_a_noisy_command_have_their_levels_in_common() -> None:
    rng = np.random.default_rng(2)
    tests = [
        replace(test, current=test.current + shift + 5e-3 * rng.standard_normal(test.n_time))
        for test, shift in ((record(switching), 0.0), (record(switching, rng=1), 0.012))
    ]
    tested = CommandedTests.of(SPEC, (*tests, record(0.5)))
    assert tested.commands == pytest.approx([0.0, 0.5, 1.0], abs=0.02)
    assert tested.vary
    assert [*tested.at] == [0.5]


def test_the_force_rises_with_the_command() -> None:
    found = relative_force(SPEC, (record(random_waves),), np.array([0.0, 0.5, 1.0]))
    assert found.mean() == pytest.approx(1.0)
    assert found[0] < 0.5 < 1.3 < found[2]


def test_another_course_of_the_command_is_another_problem() -> None:
    test = record(switching)
    earlier = replace(test, current=np.roll(np.asarray(test.current), 1))
    prints = [problem_fingerprint(Problem.of(SPEC, (each,), FitSettings())) for each in (test, earlier)]
    assert prints[0]["test"] != prints[1]["test"]


def test_folds_by_command_keep_equal_courses_together() -> None:
    tests = [record(switching), record(0.5), record(switching, frequency=1.3), record(random_steps)]
    assert folds_of(tests, "command") == [[0, 2], [1], [3]]


def test_residuals_for_jax_follow_constant_and_varying_commands_together() -> None:
    longer = record(switching)
    shorter = record(0.5).part(0, 900)
    objective = Objective.of(SPEC, (longer, shorter))
    here = objective.residuals(THETA[None])[0]
    there = mr.jax.residuals(SPEC, (longer, shorter))(THETA)
    np.testing.assert_allclose(there, here, atol=1e-9)


@pytest.mark.long
def test_the_command_line_fits_predicts_and_calibrates_records_of_a_set_point(tmp_path: Path) -> None:
    tests = record(random_steps), record(random_waves), record(switching)
    files = [write_test(tmp_path / f"{each.name}.csv", each) for each in tests]
    out = tmp_path / "run"
    laws = ["--law", "c=linear:0,1", "--law", "alpha=quadratic:0,0.5,1", "--driver-lag", "--fix", "x_s=1e-4"]
    short = ["--generations", "20", "--quiet", "--json", "--out", out]
    found = json.loads(printed("identify", *files[:2], "--model", "static_hysteretic", *laws, *short))
    assert found["current_laws"]["lagged"] is True
    assert found["parameters"]["eta"]["value"] == pytest.approx(TRUTH["eta"], rel=0.05)
    predicted = json.loads(printed("predict", out, files[2], "--json"))
    assert predicted["files"][0]["rmse_n"] == pytest.approx(NOISE_N, rel=0.1)
    printed("calibrate", out, files[2], "--json")
    checked = json.loads(printed("check", files[2], "--json"))["files"][0]
    assert checked["current_a"] == {"lowest": 0.0, "highest": 1.0}
    command_refusal("identify", files[0], "--driver-lag", match="--law")
    held = [each for name, (value, _) in HELD.items() for each in ("--fix", f"{name}={value}")]
    auto = ["--law", "auto", "--driver-lag", "--fix", "eta=60", *held, "--every", "4", "--replace"]
    chosen = json.loads(printed("identify", files[0], "--model", "static_hysteretic", *auto, *short))
    assert chosen["parameters"]["eta"]["value"] == 60.0
    assert {*chosen["choice_of_laws"]["standings"][0]["laws"]} == {"c", "alpha"}
