"""Bands: scores, conformal calibration over tests, energy per cycle, coverage of tests left out."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

from mrwork import identify
from mrwork.base.remark import Measured
from mrwork.base.values import Floats
from mrwork.dampers import damper
from mrwork.errors import RecordError
from mrwork.identification import Fit
from mrwork.records import DamperTest, Likeness, Outside
from mrwork.records.damper_test import range_of_tests
from mrwork.records.motion import regular_cycles
from mrwork.records.observation import AS_RECORDED
from mrwork.records.reading import synthetic_test
from mrwork.uncertainty import (
    Band,
    Calibration,
    Fold,
    Prediction,
    calibrate,
    predict,
    predict_left_out,
    score,
)
from mrwork.uncertainty.bands.band import energy_errors, energy_of_cycles, next_test_quantile, pooled_quantile
from mrwork.uncertainty.bands.conformal import measured_coverage
from mrwork.uncertainty.bands.prediction import alike_tests, extremes_of, has_regular_cycles, predict_beyond
from mrwork.uncertainty.bands.predictions import Predictions

DAMPING, STIFFNESS = 1000.0, 20000.0
NOMINAL = dict(zip(damper("static_hysteretic").names, damper("static_hysteretic").nominal, strict=True))


@pytest.fixture(scope="module")
def some_fit() -> Fit:
    held = {name: (value, value) for name, value in NOMINAL.items() if name != "c"}
    return identify("static_hysteretic", synthetic_test("rd1005_1a"), bounds=held, rng=0, threads=1)


def sinusoid(amplitude: float, frequency: float, *, current: float | None = None) -> DamperTest:
    """A spring and a dashpot, four cycles, 200 samples each."""
    dt = 1.0 / (200.0 * frequency)
    time = dt * np.arange(801)
    x = amplitude * np.sin(2.0 * np.pi * frequency * time)
    v = 2.0 * np.pi * frequency * amplitude * np.cos(2.0 * np.pi * frequency * time)
    return DamperTest(
        name=f"{amplitude:g} m {frequency:g} Hz {current} A",
        path="",
        sha256="",
        dt=dt,
        start_time=0.0,
        displacement=x,
        velocity=v,
        force=DAMPING * v + STIFFNESS * x,
        velocity_source="derived",
        current=current,
    )


def group(
    rng: np.random.Generator, n_tests: int, *, steep: bool = False, biased: bool = False
) -> list[Prediction]:
    """Predictions whose errors have a size of their own in each test, as model errors do."""
    result = []
    for frequency in rng.uniform(0.5, 3.0, n_tests):
        test = sinusoid(0.01, frequency)
        clean = Prediction(test=test, model_force=test.force)
        size = clean.deviation * rng.uniform(0.05, 0.15)
        error = size * rng.standard_normal(test.n_time)
        if steep:
            error *= clean.steepness / clean.steepness.mean()
        if biased:
            error += 3.0 * size * np.sin(3.0 * clean.phase)
        result.append(Prediction(test=replace(test, force=test.force + error), model_force=test.force))
    return result


def test_score_of_a_band_counts_its_width_and_what_lies_outside() -> None:
    band = Band.about(np.full(4, 0.5), 0.5, level=0.9)
    found = score(band, np.array([0.5, 0.2, 1.5, 0.9]), per=2.0)
    assert found.coverage == 0.75
    assert found.width == 0.5
    assert found.interval_score == pytest.approx((1.0 + 20.0 * 0.5 / 4.0) / 2.0)


def band_of(calibration: Calibration, prediction: Prediction, level: float) -> Band:
    band = calibration.band(prediction, level)
    assert band is not None
    return band


def beyond(
    prediction: Prediction, velocity: float, frequency: tuple[float, float] | None = None
) -> Prediction:
    """The prediction by a fit to tests up to this velocity, of these frequencies or of that of the prediction."""
    demand = range_of_tests([prediction.test])
    tested = replace(demand, velocity=velocity, frequency=frequency or demand.frequency)
    return replace(prediction, outside=Outside(exceedances=tested.exceeded_by(demand)))


def faster(ratio: float, error: float = 0.3) -> Prediction:
    """A test with this ratio of the velocities of `group`, and of what the fit was tested to, and a large error."""
    test = sinusoid(0.01 * ratio, 3.0)
    velocity = range_of_tests([test]).velocity / ratio
    noise = np.random.default_rng(1).standard_normal(test.n_time)
    wrong = Prediction(
        test=replace(test, force=test.force + error * np.std(test.force) * noise), model_force=test.force
    )
    return beyond(wrong, velocity)


def growing(prediction: Prediction) -> Prediction:
    """The prediction of a motion whose stroke grows, so that it does not repeat."""
    test = prediction.test
    grown = np.linspace(1.0, 3.0, test.n_time) * test.displacement
    return replace(prediction, test=replace(test, displacement=grown))


def test_a_band_beyond_the_tests_is_as_wide_as_errors_there_and_none_farther() -> None:
    known = group(np.random.default_rng(5), 6)
    alone = calibrate(known, held_out="")
    asked = faster(1.3)
    assert alone.band(asked, 0.9) is None
    missing = alone.test_to_run(asked)
    assert missing is not None
    assert "velocity 245 mm/s, tested to 188 mm/s (1.3 times); test 13 mm at 3 Hz" in missing.message
    calibration = calibrate(known, held_out="", beyond=[faster(1.4)])
    band = band_of(calibration, asked, 0.9)
    assert score(band, asked.measured).coverage == pytest.approx(0.9, abs=0.03)
    assert "beyond the tests in velocity" in band.basis
    assert calibration.test_to_run(asked) is None
    assert "velocity up to a factor of 1.4" in repr(calibration)
    assert "nowhere" in repr(alone)
    assert calibration.band(faster(1.6), 0.9) is None
    # Small errors beyond do not make it narrower.
    few = calibrate(known, held_out="", beyond=[faster(1.4, error=1e-3)])
    inside = replace(asked, outside=Outside())
    assert band_of(few, asked, 0.9).upper == pytest.approx(band_of(alone, inside, 0.9).upper)
    assert "beyond" not in band_of(alone, inside, 0.9).basis
    assert "is little evidence for the next" in calibrate(known[:1], held_out="").basis


def test_a_band_beyond_the_tests_in_two_quantities_takes_a_test_left_out_beyond_in_both() -> None:
    """The smallest test and the slowest one say nothing about a small and slow one."""
    known = [beyond(each, 1.0) for each in group(np.random.default_rng(5), 6)]
    fast, slow = faster(1.4), replace(faster(1.4), test=replace(faster(1.4).test, name="slow"))
    velocity, frequencies = range_of_tests([fast.test]).velocity, (4.5, 6.0)
    both = beyond(faster(1.4), velocity / 1.4, frequencies)
    asked = beyond(faster(1.3), range_of_tests([faster(1.3).test]).velocity / 1.3, frequencies)
    apart = [fast, beyond(slow, velocity, frequencies)]
    tested = replace(range_of_tests([each.test for each in known]), frequency=frequencies)
    for left_out, is_known in ((apart, False), ([*apart, both], True)):
        calibration = replace(calibrate(known, held_out="", beyond=left_out), tested=tested)
        assert [reach.side for reach in calibration.reach] == [("velocity", False), ("frequency", True)]
        assert (calibration.band(asked, 0.9) is not None) is is_known
        missing = calibration.test_to_run(asked)
        assert is_known or (missing is not None and "frequency" in missing.words)
        alone = beyond(faster(1.3), range_of_tests([faster(1.3).test]).velocity / 1.3)
        assert calibration.band(alone, 0.9) is not None


def test_tests_of_the_calibration_are_not_beyond_it_whatever_the_fit_has_seen() -> None:
    *known, unknown = group(np.random.default_rng(5), 6)
    calibration = calibrate([*known, unknown], held_out="")
    asked = beyond(unknown, 0.3 * range_of_tests([unknown.test]).velocity)
    assert band_of(calibration, asked, 0.9).upper == pytest.approx(band_of(calibration, unknown, 0.9).upper)


def test_sets_that_predict_nearly_as_well_widen_a_band_beyond_the_tests_only() -> None:
    known = group(np.random.default_rng(5), 6)
    calibration = calibrate(known, held_out="", beyond=[faster(1.4)])
    asked = faster(1.3)
    several = replace(asked, other_forces=1.1 * asked.model_force[None])
    widened = band_of(calibration, several, 0.9).upper - band_of(calibration, asked, 0.9).upper
    assert widened == pytest.approx(np.maximum(0.1 * asked.force, 0.0))
    inside = replace(several, outside=Outside())
    assert band_of(calibration, inside, 0.9).upper == pytest.approx(
        band_of(calibration, replace(inside, other_forces=asked.other_forces), 0.9).upper
    )


@pytest.mark.parametrize(("current", "wider"), [(0.25, 0.1), (0.5, 0.0)])
def test_other_laws_widen_a_band_between_the_tested_commands_alone(current: float, wider: float) -> None:
    known = [
        replace(each, test=replace(each.test, current=level))
        for each, level in zip(group(np.random.default_rng(5), 6), 2 * (0.0, 0.5, 1.0), strict=True)
    ]
    calibration = calibrate(known, held_out="")
    asked = replace(known[0], test=replace(known[0].test, current=current))
    band = band_of(calibration, replace(asked, other_forces=1.1 * asked.model_force[None]), 0.9)
    widened = band.upper - band_of(calibration, asked, 0.9).upper
    assert widened == pytest.approx(np.maximum(wider * asked.force, 0.0))
    assert ("between the tested commands" in band.basis) is (wider > 0.0)


def test_the_fastest_the_slowest_and_the_largest_tests_are_left_out_together() -> None:
    motions = [(0.005, 1.0), (0.005, 4.0), (0.02, 1.0), (0.005, 0.25), (0.005, 2.0), (0.005, 2.1)]
    tests = [sinusoid(*each) for each in motions]
    assert extremes_of(tests) == [[1, 2], [1], [3], [2]]
    assert extremes_of(tests[:1]) == []


def test_extreme_tests_are_predicted_by_fits_to_the_others(some_fit: Fit) -> None:
    tests = [sinusoid(0.01, f) for f in (1.0, 1.7, 4.0)]

    def identify_rest(rest: tuple[DamperTest, ...]) -> Fit:
        if tests[2] in rest:
            raise RecordError("these do not determine the model; give others")
        return some_fit

    found = predict_beyond(tests, identify_rest)
    assert [each.test.name for each in found] == [tests[2].name]


def test_calibrated_bands_cover_tests_they_do_not_know() -> None:
    rng = np.random.default_rng(5)
    coverage: dict[float, list[float]] = {0.5: [], 0.9: []}
    for _ in range(20):
        *known, unknown = group(rng, 13, biased=True)
        calibration = calibrate(known, held_out="")
        for level, found in coverage.items():
            found.append(score(band_of(calibration, unknown, level), unknown.measured).coverage)
    # Twenty tests whose coverage scatters by some 0.1 to 0.15, so that their mean is known to 0.03.
    for level, found in coverage.items():
        assert np.mean(found) == pytest.approx(level, abs=0.08)


def test_a_motion_that_does_not_repeat_has_no_mean_error_over_its_cycle() -> None:
    rng, coverage, biased = np.random.default_rng(8), [], []
    for _ in range(10):
        known = group(rng, 8, biased=True)
        calibration = calibrate(known, held_out="")
        biased.append(bool(calibration.shape.bias))
        for asked in group(rng, 4, biased=True):
            # The stroke of the cycles grows, and the error over each is that of the sines.
            assert not has_regular_cycles(growing(asked).test)
            band = band_of(calibration, growing(asked), 0.9)
            coverage.append(score(band, asked.measured).coverage)
    assert sum(biased) > 5
    assert np.mean(coverage) == pytest.approx(0.9, abs=0.06)
    # One motion at several commands tells nothing of the mean over the cycle of another.
    alike = [replace(known[0], test=replace(known[0].test, current=1.0 * number)) for number in range(6)]
    assert not calibrate(alike, held_out="").shape.bias


def test_a_band_is_wider_in_half_cycles_shorter_than_those_of_the_calibration() -> None:
    *known, asked = group(np.random.default_rng(8), 7)
    calibration = calibrate(known, held_out="")
    # Peaks of the four cycles: from 10 to -10, 5, -5, 10, -10, 1, -1 mm.
    per_cycle = np.repeat([1.0, 0.5, 1.0, 0.1], 200)
    x = np.append(per_cycle, 0.1) * asked.test.displacement
    asked = replace(asked, test=replace(asked.test, displacement=x))
    peaks = np.array([50, 150, 250, 350, 450, 550, 650, 750])
    # Half cycles of 20, 15, 10, 15, 20, 11, 2 mm, of which the fourth and fifth follow shorter ones.
    strokes = np.array([20.0, 15.0, 10.0, 10.0, 15.0, 11.0, 2.0])
    expected = np.minimum(20.0 / strokes, 3.0)[np.searchsorted(peaks[1:-1], np.arange(801), side="right")]
    # Half cycles of 2, 10 and 11 mm make a fifth of the travel of 93 mm: it is 20 / 11 times smaller throughout.
    expected *= 20.0 / 11.0
    shape = replace(calibration.shape, shortest=0.0)
    band, narrow = (band_of(each, asked, 0.9) for each in (calibration, replace(calibration, shape=shape)))
    assert "in shorter half cycles than theirs up to 5.5 times as wide" in band.basis
    assert (band.upper - band.lower) / (narrow.upper - narrow.lower) == pytest.approx(expected, rel=1e-3)
    # Errors of fits without such tests are not widened once more.
    tested = replace(calibration.tested, velocity=range_of_tests([asked.test]).velocity / 1.3)
    reach = replace(calibrate(known, held_out="", beyond=[faster(1.4, error=3.0)]), tested=tested)
    far = band_of(reach, beyond(asked, tested.velocity), 0.9)
    assert np.ptp(far.upper - far.lower) == pytest.approx(0.0, abs=1e-9)
    assert far.upper[0] - far.lower[0] > 3.0 * (narrow.upper[0] - narrow.lower[0])
    # A motion that repeats is beyond the tests as a whole or not at all.
    small = replace(asked, test=replace(asked.test, displacement=0.1 * sinusoid(0.01, 1.0).displacement))
    of_small = band_of(calibration, small, 0.9)
    assert of_small.upper - of_small.lower == pytest.approx(narrow.upper - narrow.lower)


@pytest.mark.parametrize(("small", "has_band"), [(0.8, True), (0.7, True), (0.6, False)])
def test_small_half_cycles_have_a_wider_band_up_to_a_factor(small: float, has_band: bool) -> None:
    *known, asked = group(np.random.default_rng(8), 7)
    calibration = calibrate(known, held_out="")
    x = np.where(np.arange(801) < 400, 1.0, small) * asked.test.displacement
    asked = replace(asked, test=replace(asked.test, displacement=x))
    demand = range_of_tests([asked.test])
    assert demand.least_stroke == pytest.approx(0.01 * small)
    tested = replace(range_of_tests([each.test for each in known]), velocity=demand.velocity, frequency=None)
    asked = replace(asked, outside=Outside(exceedances=tested.exceeded_by(demand)))
    assert asked.outside.names[0] == "stroke"
    band = calibration.band(asked, 0.9)
    assert (band is not None) is has_band
    missing = calibration.test_to_run(asked)
    if band is None:
        assert missing is not None
        assert "a motion like it, of 10 mm" in missing.message
        return
    assert missing is None
    assert "beyond the tests" not in band.basis
    narrow = band_of(replace(calibration, shape=replace(calibration.shape, shortest=0.0)), asked, 0.9)
    # Half cycles of the calibration, in a motion with smaller ones, and these, of which each follows another.
    for sample, ratio in ((300, 1.0 / small), (650, 1.0 / small**2)):
        widths = [(each.upper - each.lower)[sample] for each in (band, narrow)]
        assert widths[0] / widths[1] == pytest.approx(ratio, rel=1e-3)


def test_a_band_is_wider_where_the_motion_is_faster_than_that_of_any_test() -> None:
    """A sine is as fast in every cycle as a motion that grows is in its last."""
    known = [growing(each) for each in group(np.random.default_rng(5), 6)]
    calibration = calibrate(known, held_out="")
    fastest = max(float(np.sqrt(np.mean(each.test.velocity**2))) for each in known)
    widths = []
    for ratio in (0.5, 1.0, 1.4):
        test = sinusoid(0.01, 1.0)
        speed = float(np.sqrt(np.mean(test.velocity**2)))
        test = replace(test, velocity=ratio * fastest / speed * test.velocity)
        band = band_of(calibration, Prediction(test=test, model_force=test.force), 0.9)
        widths.append(float(np.mean(band.upper - band.lower)))
        assert ("1.4 times as wide" in band.basis) is (ratio > 1.0)
    assert widths[1:] == pytest.approx([widths[0], 1.4 * widths[0]])


def test_a_band_is_as_wide_as_the_tests_at_its_command_need() -> None:
    rng = np.random.default_rng(3)
    sizes = {0.0: 0.2, 0.5: 0.07, 1.0: 0.07}

    def at(current: float, size: float, frequency: float = 1.5) -> Prediction:
        test = sinusoid(0.01, frequency, current=current)
        error = size * np.std(test.force) * rng.standard_normal(test.n_time)
        return Prediction(test=replace(test, force=test.force + error), model_force=test.force)

    frequencies = 1.0, 1.2, 1.4, 1.6, 1.8
    known = [at(current, size, each) for current, size in sizes.items() for each in frequencies]
    calibration = calibrate(known, held_out="")
    asked = {current: at(current, sizes.get(current, 0.1)) for current in (0.0, 0.25, 0.5, 1.0)}
    bands = {current: band_of(calibration, prediction, 0.9) for current, prediction in asked.items()}
    assert score(bands[0.0], asked[0.0].measured).coverage == pytest.approx(0.9, abs=0.03)
    widths = {current: float(np.mean(band.upper - band.lower)) for current, band in bands.items()}
    assert widths[0.5] == pytest.approx(widths[1.0])
    assert widths[0.0] > 1.2 * widths[0.5]
    assert widths[0.25] == pytest.approx(0.5 * (widths[0.0] + widths[0.5]))
    # A command that varies has the width of the command of each sample.
    varying, *constant = (
        band_of(calibration, replace(asked[0.0], test=replace(asked[0.0].test, current=current)), 0.9)
        for current in (np.linspace(0.0, 0.5, 801), 0.0, 0.5)
    )
    for sample, band in zip((0, -1), constant, strict=True):
        assert (varying.upper - varying.lower)[sample] == pytest.approx((band.upper - band.lower)[sample])
    # Two tests at a command tell little of the next.
    few = calibrate([*known[:2], *known[5:]], held_out="")
    same = [band_of(few, asked[current], 0.9) for current in (0.0, 1.0)]
    assert same[0].upper - same[0].lower == pytest.approx(same[1].upper - same[1].lower)
    # Each test of the calibration is judged by the others in the same way.
    held = {entry.test: entry.samples for entry in measured_coverage(known, (0.9,))}
    for prediction in known[:5]:
        assert held[prediction.test.label].coverage == pytest.approx(0.9, abs=0.06)


def test_the_test_to_run_has_the_frequencies_of_the_motion() -> None:
    """The mean of those of a random motion is a frequency that was tested, where the slowest was not."""
    calibration = calibrate(group(np.random.default_rng(5), 6), held_out="")
    time = 0.01 * np.arange(4001)
    x = 0.01 * np.sin(2.0 * np.pi * (0.2 * time + 0.01 * time**2))
    v = np.gradient(x, time)
    test = replace(
        sinusoid(0.01, 1.0), dt=0.01, displacement=x, velocity=v, force=DAMPING * v + STIFFNESS * x
    )
    asked = beyond(Prediction(test=test, model_force=test.force), 1.0, (0.5, 3.0))
    missing = calibration.test_to_run(asked)
    assert missing is not None
    slowest, fastest = range_of_tests([test]).frequency or (0.0, 0.0)
    assert slowest < 0.45 < 0.8 < fastest
    assert f"test a motion like it, of 10 mm from {slowest:.3g} to {fastest:.3g} Hz" in missing.message


def test_a_motion_that_repeats_beyond_those_that_do_not_has_no_band() -> None:
    known = [growing(each) for each in group(np.random.default_rng(5), 6)]
    calibration = calibrate(known, held_out="", beyond=[growing(faster(1.4))])
    tested = replace(calibration.tested, velocity=range_of_tests([faster(1.3).test]).velocity / 1.3)
    calibration = replace(calibration, tested=tested)
    assert calibration.band(growing(faster(1.3)), 0.9) is not None
    assert calibration.band(faster(1.3), 0.9) is None
    missing = calibration.test_to_run(faster(1.3))
    assert missing is not None
    assert "velocity" in missing.words


@pytest.mark.parametrize(("larger", "is_told"), [(0.7, False), (4.0, True)])
def test_a_band_that_holds_less_than_chance_leaves_is_told(
    larger: float, is_told: bool, some_fit: Fit
) -> None:
    rng = np.random.default_rng(11)
    *known, asked = group(rng, 9)
    error = larger * asked.test.force + (1.0 - larger) * asked.model_force
    asked = growing(replace(asked, test=replace(asked.test, name="asked", force=error)))
    calibration = calibrate(known, held_out="")
    predictions = Predictions.about(
        some_fit, [asked], observe=AS_RECORDED, calibration=calibration, level=0.9
    )
    assert "motion_of_new_kind" in {each.code for each in predictions.remarks}
    assert calibration.new_kind(known) is None
    (coverage,) = predictions.coverage
    told = [each for each in predictions.remarks if each.code == "band_too_narrow"]
    assert is_told is (coverage < 0.8)
    held = Measured(100.0 * coverage, "%")
    assert [(each.words, each.measured) for each in told] == [(("asked",), held)] * is_told


def test_errors_that_repeat_in_every_cycle_count_once() -> None:
    """With every sample independent a third of tests as good as those of the calibration would be told."""
    rng, told = np.random.default_rng(1), {1.0: 0, 4.0: 0}

    def repeated(prediction: Prediction, larger: float) -> Prediction:
        error = larger * prediction.residual[:200]
        force = prediction.model_force + np.append(np.tile(error, 4), error[0])
        return replace(prediction, test=replace(prediction.test, force=force))

    for _ in range(8):
        *known, asked = group(rng, 9)
        calibration = calibrate([repeated(each, 1.0) for each in known], held_out="")
        for larger in told:
            made = repeated(asked, larger)
            band = band_of(calibration, made, 0.9)
            share = score(band, made.measured).coverage
            told[larger] += share < calibration.least_by_chance(made, band)
    assert told[1.0] == 0
    assert told[4.0] >= 7


def test_one_of_many_tests_may_be_held_by_less_than_one_alone(some_fit: Fit) -> None:
    rng = np.random.default_rng(11)
    *known, asked = group(rng, 9)
    calibration = calibrate(known, held_out="")
    others = group(rng, 12)
    for larger in np.linspace(0.5, 4.0, 60):
        force = larger * asked.test.force + (1.0 - larger) * asked.model_force
        test = replace(asked, test=replace(asked.test, name="asked", force=force))
        band = band_of(calibration, test, 0.9)
        share = score(band, test.measured).coverage
        if share < calibration.least_by_chance(test, band):
            break
    assert share > calibration.least_by_chance(test, band, 13)

    def told(predictions: list[Prediction]) -> bool:
        made = Predictions.about(
            some_fit, predictions, observe=AS_RECORDED, calibration=calibration, level=0.9
        )
        return "band_too_narrow" in {each.code for each in made.remarks}

    assert told([test])
    assert not told([test, *others])


def test_a_width_that_varies_is_said_by_its_ends() -> None:
    assert Band.about(np.zeros(3), 20.0, level=0.9).half_width_in_words == "20"
    varying = Band.about(np.zeros(3), np.array([20.0, 30.0, 25.0]), level=0.9)
    assert varying.half_width_in_words == "from 20 to 30"


def test_errors_that_grow_with_steepness_and_a_mean_error_are_found() -> None:
    rng = np.random.default_rng(6)
    assert calibrate(group(rng, 10, steep=True), held_out="").shape.slope > 0.0
    biased = calibrate(group(rng, 10, biased=True), held_out="").shape.bias
    assert max(biased) > 0.1
    assert min(biased) < -0.1


def test_few_tests_make_the_band_wider_than_their_own_errors_ask_for() -> None:
    rng = np.random.default_rng(7)
    coverage, wider = [], []
    for _ in range(30):
        *known, unknown = group(rng, 5)
        calibration = calibrate(known, held_out="the fit has not seen")
        scores = calibration.scores.about_force
        wider.append(next_test_quantile(scores, 0.9) / pooled_quantile(scores, 0.9))
        coverage.append(score(band_of(calibration, unknown, 0.9), unknown.measured).coverage)
    assert np.mean(wider) > 1.01
    # The sizes of the errors differ by a factor of three from test to test, so each coverage scatters by 0.1.
    assert np.mean(coverage) == pytest.approx(0.9, abs=0.05)
    assert calibration.basis == "calibrated on 4 tests the fit has not seen, of motions that repeat"


def test_cycles_of_a_spring_and_dashpot_have_their_closed_form() -> None:
    test = sinusoid(0.01, 2.0)
    energy = energy_of_cycles(test, test.force)
    assert energy == pytest.approx(np.pi * DAMPING * 4.0 * np.pi * 0.01**2, rel=1e-6)
    louder = Prediction(test=test, model_force=1.1 * test.force)
    assert np.all(energy_errors(louder) < 0.1)
    chirp = np.sin(2.0 * np.pi * np.linspace(0.0, 4.0, 801) ** 2)
    assert has_regular_cycles(test)
    assert not has_regular_cycles(replace(test, displacement=chirp))


def test_cycles_of_a_prediction_are_found_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found = list[int]()

    def counting(displacement: Floats) -> tuple[slice, ...]:
        found.append(displacement.size)
        return regular_cycles(displacement)

    calibration = calibrate(group(np.random.default_rng(5), 8), held_out="")
    monkeypatch.setattr("mrwork.uncertainty.bands.prediction.regular_cycles", counting)
    asked = Prediction(test=sinusoid(0.01, 2.0), model_force=sinusoid(0.01, 2.0).force)
    band = band_of(calibration, asked, 0.9)
    assert calibration.least_by_chance(asked, band) > 0.0
    assert calibration.new_kind([asked]) is None
    assert found == [asked.test.n_counted]


@pytest.mark.parametrize(("fold", "left_in"), [("test", [5] * 6), ("motion", [4] * 3), ("command", [3] * 2)])
def test_no_fit_sees_the_tests_it_predicts(fold: Fold, left_in: list[int], some_fit: Fit) -> None:
    tests = [sinusoid(0.01, f, current=i) for f in (1.0, 2.0, 4.0) for i in (0.0, 1.0)]
    seen = []

    def identify_rest(rest: tuple[DamperTest, ...]) -> Fit:
        seen.append({test.name for test in rest})
        return some_fit

    found = predict_left_out(tests, fold, identify_rest)
    assert [len(names) for names in seen] == left_in
    assert [prediction.test.name for prediction in found] == [test.name for test in tests]
    for test in tests:
        assert sum(test.name not in names for names in seen) == 1


def test_alike_tests_are_left_out_together(some_fit: Fit) -> None:
    tests = [sinusoid(0.01, f, current=1.0) for f in (1.0, 2.0)]
    again = replace(tests[0], name="again", force=1.01 * tests[0].force)
    seen = []

    def identify_rest(rest: tuple[DamperTest, ...]) -> Fit:
        seen.append([test.name for test in rest])
        return some_fit

    assert not [*alike_tests(tests)]
    (alike_remark,) = alike_tests([*tests, again])
    assert "again has the motion" in alike_remark.message
    predict_left_out([*tests, again], "test", identify_rest)
    assert seen == [[tests[1].name], [tests[0].name, "again"]]
    for alike, fold in (([tests[0], again], "test"), (tests, "command")):
        refusal(
            predict_left_out, alike, fold, identify_rest, match=f"2 tests given have one {fold} in common"
        )
    assert len(seen) == 2


def test_what_the_fit_has_seen_neither_calibrates_nor_is_judged() -> None:
    predictions = group(np.random.default_rng(8), 6)
    seen = Likeness(test=predictions[0].test.label, like="fitted", correlation=1.0)
    given = [replace(predictions[0], seen=seen), *predictions[1:]]
    found = calibrate(given, held_out="")
    assert found.seen == (seen,)
    assert found.tests == tuple(each.test.label for each in predictions[1:])
    assert {row.test for row in measured_coverage(given)} == set(found.tests)
    refusal(calibrate, given[:1], held_out="", match="motion and command of fitted")
    refusal(calibrate, [], held_out="", match="name at least one")


def test_versions_of_one_test_count_as_one() -> None:
    predictions = group(np.random.default_rng(8), 5)
    # A version with the same errors: by itself in the calibration it would foretell its like.
    versions = [
        replace(each, test=replace(each.test, name=f"{each.test.name} again")) for each in predictions
    ]
    alone, doubled = (calibrate(each, held_out="") for each in (predictions, [*predictions, *versions]))
    assert len(doubled.tests) == len(alone.tests)
    assert "10 tests count as 5" in repr(doubled)
    test = predictions[0]
    assert band_of(doubled, test, 0.9).upper == pytest.approx(band_of(alone, test, 0.9).upper, rel=1e-9)
    covered = {row.test: row for row in measured_coverage(predictions, [0.9])}
    for row in measured_coverage([*predictions, *versions], [0.9]):
        same = covered[row.test.removesuffix(" again")]
        assert row.samples.width == pytest.approx(same.samples.width, rel=1e-9)
        assert row.samples.coverage == pytest.approx(same.samples.coverage, abs=1e-3)


def test_the_coverage_of_each_test_is_that_of_a_calibration_without_it() -> None:
    """The shared sums of a cross-validation give what each calibration alone gives."""
    predictions = group(np.random.default_rng(3), 7, steep=True, biased=True)
    rows = measured_coverage(predictions, [0.5, 0.9])
    for index, prediction in enumerate(predictions):
        others = calibrate([*predictions[:index], *predictions[index + 1 :]], held_out="")
        for level in (0.5, 0.9):
            (row,) = [each for each in rows if (each.test, each.level) == (prediction.test.label, level)]
            expected = score(
                band_of(others, prediction, level),
                prediction.measured,
                per=float(np.std(prediction.measured)),
            )
            assert row.samples.width == pytest.approx(expected.width, rel=1e-9)
            assert row.samples.coverage == pytest.approx(expected.coverage, abs=1e-3)


@pytest.mark.parametrize("sizes", [(1000,) * 6, (10, 300, 4000), (1, 1)])
def test_quantiles_weigh_every_test_alike(sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(4)
    scores = [rng.exponential(1.0 + index, size) for index, size in enumerate(sizes)]
    for level in (0.1, 0.5, 0.9, 0.99):
        found = pooled_quantile(scores, level)
        shares = np.mean([np.mean(each <= found) for each in scores])
        less = np.mean([np.mean(each < found) for each in scores])
        assert less < level <= shares + 1e-12


def test_a_prediction_has_the_names_of_a_fit_for_what_it_prints() -> None:
    test = synthetic_test("spencer1997")
    fit = identify("bingham", test, threads=1)
    prediction = predict(fit, test)
    for name in ("fit_percent", "nrmse", "rmse_n"):
        assert getattr(prediction, name) == pytest.approx(getattr(fit, name))
