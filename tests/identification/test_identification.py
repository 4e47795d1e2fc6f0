"""Identification finds what generated the data, says how sure it is, and keeps what it has."""

import signal
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from posterior_samples import small_fit, small_test
from refusals import refusal
from scipy.signal import lfilter
from sentences import Refused

import mrwork as mr
from mrwork.identification import Fit, Objective, search_box
from mrwork.identification.covariance import (
    autocorrelation_time,
    covariance,
    effective_samples,
    residuals_by_test,
)
from mrwork.identification.equivalent import identifiable_form
from mrwork.identification.result import fit_quality, free_run
from mrwork.identification.settings import resize_search, search_named, searches
from mrwork.records import DamperTest, Observation, cut
from mrwork.records.damper_test import as_tests

SEARCH = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=25))


@pytest.fixture(scope="module")
def record() -> DamperTest:
    return mr.synthetic_test("spencer1997")


@pytest.fixture(scope="module")
def fit(record: DamperTest) -> Fit:
    return mr.identify("normalised_bouc_wen", record, search=SEARCH, rng=3)


def test_published_parameters_are_recovered_within_their_standard_errors(fit: Fit) -> None:
    truth = mr.damper("normalised_bouc_wen").nominal
    for estimate, true in zip(fit.estimates, truth, strict=True):
        assert estimate.standard_error is not None
        assert abs(estimate.value - true) < 5.0 * estimate.standard_error, estimate


def test_the_residual_of_a_true_model_is_the_sensor_noise(fit: Fit) -> None:
    # 8 N in the force; 0.5 mm/s in the velocity makes 2.5 N through the dashpot of 5000 N s/m.
    assert fit.rmse_n == pytest.approx(np.hypot(8.0, 2.5), rel=0.05)
    assert fit.fit_percent == pytest.approx(100.0 * (1.0 - fit.nrmse))


def test_the_redundant_form_reaches_the_same_fit_and_names_what_it_held(record: DamperTest, fit: Fit) -> None:
    spencer = mr.identify("bouc_wen", record, search=SEARCH, rng=3)
    assert spencer.fit_percent == pytest.approx(fit.fit_percent, abs=1e-6)
    held = {estimate.name for estimate in spencer.estimates if estimate.state == "fixed"}
    assert held == {"A"}
    assert all(estimate.standard_error for estimate in spencer.estimates if estimate.name != "A")


def test_one_seed_repeats_and_threads_do_not_matter(record: DamperTest) -> None:
    short = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=8, min_generations=1))
    record = cut(record, every=4)
    runs = [mr.identify("static_hysteretic", record, search=short, rng=5, threads=n) for n in (1, 2, 1)]
    assert len({(run.theta, run.trace.best) for run in runs}) == 1
    other = mr.identify("static_hysteretic", record, search=short, rng=6)
    assert other.trace.best != runs[0].trace.best


def test_a_fixed_parameter_stays_and_a_bound_is_kept(record: DamperTest) -> None:
    bounds = {"n": (2.0, 2.0), "rho": (100.0, 9000.0)}
    bound = mr.identify("normalised_bouc_wen", record, search=SEARCH, bounds=bounds, rng=1)
    by_name = {estimate.name: estimate for estimate in bound.estimates}
    assert by_name["n"].value == 2.0
    assert by_name["n"].state == "fixed"
    assert by_name["rho"].state == "at upper bound"
    assert by_name["rho"].standard_error is None


def test_bounds_of_a_redundant_parameter_are_refused(refused: Refused) -> None:
    refused(identifiable_form, mr.damper("bouc_wen"), {"alpha": (1.0, 2.0)})


def test_impossible_bounds_are_named(record: DamperTest, refused: Refused) -> None:
    for bounds in ({"rho": (2.0, 1.0)}, {"rhoo": (1.0, 2.0)}, {"n": (0.5, 2.0)}, {"n": (1.0, float("inf"))}):
        refused(mr.identify, "normalised_bouc_wen", record, bounds=bounds)


def test_every_simulation_is_counted(fit: Fit) -> None:
    # Of sixteen starts the misfit, and of each some iterations of a Jacobian and three trial steps.
    assert fit.evaluations >= fit.trace.evaluations[-1] + 16 * (1 + 3 * 4)


def test_nothing_to_identify_is_an_error(record: DamperTest, refused: Refused) -> None:
    spec = mr.damper("static_hysteretic")
    bounds = {name: (value, value) for name, value in zip(spec.names, spec.nominal, strict=True)}
    refused(mr.identify, spec, record, bounds=bounds)


def test_no_tests_is_an_error(refused: Refused) -> None:
    refused(mr.identify, "bouc_wen", [])


def test_stopping_early_returns_the_best_found_so_far(record: DamperTest) -> None:
    seen: list[mr.Progress] = []

    def interrupt_in_the_third_generation(progress: mr.Progress) -> None:
        seen.append(progress)
        if len(seen) == 3:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(mr.errors.Interrupted) as stop:
        mr.identify("normalised_bouc_wen", record, rng=1, on_progress=interrupt_in_the_third_generation)
    best = stop.value.result
    assert best.status == "interrupted"
    # The search was at a simpler model, whose fit this one approaches.
    assert best.fit_percent == pytest.approx(seen[-1].numbers["fit_percent"], abs=1.0)
    assert all(estimate.standard_error is None for estimate in best.estimates)


@pytest.mark.parametrize("search", ["race", "genetic"])
def test_an_interrupt_before_any_candidate_has_no_result(
    record: DamperTest, search: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Objective, "__call__", interrupt)
    with pytest.raises(mr.errors.Interrupted) as stop:
        mr.identify("dahl", record, search=search)
    assert stop.value.result is None
    assert not stop.value.stopped


def test_quality_of_a_perfect_model_is_perfect_and_of_the_mean_is_zero(record: DamperTest) -> None:
    perfect = fit_quality(record, record.force, substeps=1)
    assert perfect.fit_percent == 100.0
    assert perfect.error_norms.time == perfect.error_norms.displacement == perfect.error_norms.velocity == 0.0
    mean = np.full(record.n_time, record.force[record.counted].mean())
    assert fit_quality(record, mean, substeps=1).fit_percent == pytest.approx(0.0, abs=1e-9)


def test_more_substeps_change_nothing_that_can_be_seen(record: DamperTest, fit: Fit) -> None:
    theta = np.array(fit.theta)
    for name in ("spencer1997", "spencer1997_slow", "spencer1997_fast"):
        test = mr.synthetic_test(name)
        coarse, fine = (
            free_run(mr.damper(fit.model), theta, test, substep_factor=factor)[1] for factor in (1, 4)
        )
        assert fine.substeps == 4 * coarse.substeps
        assert fine.fit_percent == pytest.approx(coarse.fit_percent, abs=0.01)


def test_a_test_too_stiff_to_resolve_is_named(record: DamperTest) -> None:
    theta = mr.damper("normalised_bouc_wen").nominal
    theta[4] = 1e7
    refusal(
        free_run,
        mr.damper("normalised_bouc_wen"),
        theta,
        replace(record, dt=0.1),
        match="too stiff for the sampling step",
    )


@pytest.mark.parametrize("spec", mr.damper_models(), ids=lambda spec: spec.name)
def test_the_search_box_lies_inside_the_bounds_and_scales_with_the_record(spec, record: DamperTest) -> None:
    bounds = mr.Box.of(spec)
    box = search_box(spec, bounds, (record,))
    assert all(np.array(box.lower) >= np.array(bounds.lower))
    assert all(np.array(box.upper) <= np.array(bounds.upper))
    scaled = search_box(spec, bounds, (replace(record, force=10.0 * record.force),))
    for index, parameter in enumerate(spec.parameters):
        ratio = 10.0 if parameter.unit.startswith("N") else 1.0
        expected = min(ratio * box.upper[index], parameter.upper)
        assert scaled.upper[index] == pytest.approx(expected), parameter.name


def test_a_unit_that_no_model_has_is_searched_about_its_size(record: DamperTest) -> None:
    def force(p, state, displacement, velocity):
        return p.c3 * velocity**3

    cubed = mr.own_damper("cubed", parameters={"c3": ("N s3/m3", 1e-9, 1.0, 1e9)}, force=force)
    size = np.ptp(record.force) / 2 / (np.ptp(record.velocity) / 2) ** 3
    box = search_box(cubed, mr.Box.of(cubed), (record,))
    assert 0.0 < box.lower[0] < size < box.upper[0] < 1e7 * box.lower[0]


def test_rows_weigh_the_tests_in_their_own_way(record: DamperTest) -> None:
    tests = (record, mr.synthetic_test("rd1005_1a"), replace(record, force=0.9 * record.force))
    objective = Objective.of(mr.damper("normalised_bouc_wen"), tests, threads=1)
    theta = np.tile(objective.spec.nominal, (4, 1))
    shares = np.array([[1 / 3, 1 / 3, 1 / 3], [1.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
    squared = objective.squared_nrmse(theta)
    np.testing.assert_allclose(objective(theta, shares) ** 2, np.sum(shares * squared, axis=1), rtol=1e-14)
    assert objective(theta, shares)[0] == objective(theta)[0]


def test_standard_errors_cover_the_truth_of_a_linear_model() -> None:
    rng = np.random.default_rng(11)
    design = rng.standard_normal((200, 3))
    truth = np.array([1.0, -2.0, 0.5])
    deviations = []
    for _ in range(300):
        data = design @ truth + 0.3 * rng.standard_normal(200)
        estimate, *_ = np.linalg.lstsq(design, data)
        residual = data - design @ estimate
        errors = np.sqrt(np.diag(covariance(design, float(np.linalg.norm(residual)))))
        deviations.append((estimate - truth) / errors)
    # The deviations are Student-t with 197 degrees of freedom: unit variance but for 1 %.
    assert np.std(deviations, axis=0) == pytest.approx(1.0, abs=0.15)


def test_a_combination_that_the_data_do_not_see_has_no_standard_error() -> None:
    rng = np.random.default_rng(2)
    seen = rng.standard_normal((100, 2))
    redundant = np.column_stack([seen[:, 0], 2.0 * seen[:, 0], seen[:, 1], np.zeros(100)])
    errors = np.sqrt(np.diag(covariance(redundant, 1.0)))
    assert np.isnan(errors[[0, 1, 3]]).all()
    assert np.isfinite(errors[2])


@pytest.mark.parametrize("name", searches())
def test_a_search_is_chosen_by_name_and_recorded(name: str) -> None:
    search = search_named(name)
    if name != "race":
        search = resize_search(search, generations=25)
    fit = mr.identify("dahl", cut(mr.synthetic_test("rd1005_1a"), every=4), search=search)
    assert fit.fit_percent > 75.0
    assert fit.provenance.settings["search"]["name"] == name
    assert fit.settings.search == search


SMALL_TEST = small_test()


@pytest.mark.parametrize(
    "use",
    [
        lambda tests: mr.identify("bingham", tests),
        lambda tests: mr.choose_model(tests, ("bingham", "dahl")),
        lambda tests: mr.choose_laws("bingham", tests),
        lambda tests: mr.profile(small_fit(), tests),
        lambda tests: mr.sample(small_fit(), tests),
    ],
    ids=["identify", "choose_model", "choose_laws", "profile", "sample"],
)
def test_a_test_that_is_given_twice_is_refused(use: Callable[[tuple[mr.DamperTest, ...]], object]) -> None:
    copy = replace(SMALL_TEST, name="copy", path="elsewhere.csv", observation=Observation(gain=1.1))
    refusal(use, (SMALL_TEST, small_test(6), copy), match="tests 1 and 3 .* same samples")


def test_windows_commands_and_repetitions_of_a_test_are_other_data() -> None:
    halves = SMALL_TEST.part(0, 75), SMALL_TEST.part(75, 150)
    commands = replace(SMALL_TEST, current=0.5), replace(SMALL_TEST, current=1.0)
    given = (*halves, *commands, SMALL_TEST, replace(SMALL_TEST, force=small_test(6).force))
    assert as_tests(given) == given


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.93])
def test_autoregressive_noise_has_the_time_of_theory(phi: float) -> None:
    # tau = (1 + phi)/(1 - phi); the estimate scatters by about sqrt(4 m tau / n), m the lags that are summed.
    white = np.random.default_rng(3).standard_normal(100_000)
    series = lfilter([1.0], [1.0, -phi], white)
    assert autocorrelation_time(series) == pytest.approx((1.0 + phi) / (1.0 - phi), rel=0.1)


def test_alternating_samples_count_no_better_than_independent_ones() -> None:
    assert autocorrelation_time(np.tile([1.0, -1.0], 50)) == 1.0
    assert autocorrelation_time(np.zeros(7)) == 1.0
    assert autocorrelation_time([0.3]) == 1.0


def test_a_constant_residual_is_hardly_more_than_one_sample() -> None:
    assert effective_samples([np.full(1000, 0.2)]) < 3.0


def test_a_correlation_that_comes_back_counts_no_more_than_the_least_before_it() -> None:
    # About zero, 1 + a cos has the correlation (1 + a^2/2 cos) / (1 + a^2/2), and returns to 1 with every period.
    n_time, half_square = 20_000, 0.5 * 0.8**2
    phase = 2.0 * np.pi * np.arange(n_time) / 400.0
    rho = (1.0 + half_square * np.cos(phase)) / (1.0 + half_square) * (1.0 - np.arange(n_time) / n_time)
    expected = 1.0 + 2.0 * np.minimum.accumulate(rho)[1:].sum()
    assert autocorrelation_time(1.0 + 0.8 * np.cos(phase)) == pytest.approx(expected, rel=0.01)
    assert expected < 0.7 * (1.0 + 2.0 * rho[1:].sum())


def test_the_unit_of_the_residuals_does_not_matter() -> None:
    series = np.cumsum(np.random.default_rng(1).standard_normal(500))
    assert autocorrelation_time(1e6 * series) == pytest.approx(autocorrelation_time(series))


def test_tests_are_counted_one_by_one() -> None:
    tests = tuple(mr.synthetic_test(name) for name in ("spencer1997", "spencer1997_fast"))
    objective = Objective.of(mr.damper("bouc_wen"), tests)
    residuals = objective.residuals(mr.damper("bouc_wen").nominal[None])[0]
    first, second = residuals_by_test(residuals, tests)
    assert [first.size, second.size] == [test.n_time - test.n_settle for test in tests]
    np.testing.assert_array_equal(np.concatenate([first, second]), residuals)
    together = effective_samples([first, second])
    assert together == pytest.approx(effective_samples([first]) + effective_samples([second]))
    # The noise of these tests is white, but for what noise in the motion makes of the force.
    assert 0.2 * residuals.size < together <= residuals.size
