"""Fragility: censored lognormal distributions, their bands, and what a study says of them."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import study_samples
from refusals import refusal
from scipy.optimize import minimize
from scipy.stats import norm

import mrwork as mr
from mrwork.dampers.simulation import Outcome
from mrwork.motions.spectrum import Intensity
from mrwork.study import StudyResults
from mrwork.study.fragilities import Fragilities, drawn_weights, lognormal_of
from mrwork.study.runs import NOT_RUN

G = 9.80665
LEVELS = (0.1, 0.14, 0.2, 0.25, 0.3, 0.36, 0.43, 0.51, 0.6)
Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


def intervals(reached: Floats, levels: Floats) -> tuple[Floats, Floats]:
    """The levels around the intensities at which records reach a limit."""
    ends = np.concatenate([[0.0], levels, [np.inf]])
    place = np.searchsorted(levels, reached)
    return ends[place], ends[place + 1]


def largest_likelihood(loss: Callable[[Floats], float]) -> Floats:
    found = minimize(loss, [1.0, -1.0], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13})
    return np.exp(found.x)


@pytest.mark.parametrize("censored", [0.0, 0.3, 0.6])
def test_median_and_dispersion_are_those_of_the_largest_likelihood(censored: float) -> None:
    reached = 3.0 * np.exp(0.4 * np.random.default_rng(7).standard_normal(24))
    levels = np.linspace(0.5, float(np.quantile(reached, 1.0 - censored)) + 0.1, 12)
    above, below = intervals(reached, levels)

    def loss(at: Floats) -> float:
        with np.errstate(divide="ignore"):
            ends = [norm.cdf((np.log(each) - at[0]) / np.exp(at[1])) for each in (above, below)]
        return float(-np.log(ends[1] - ends[0]).sum())

    (median,), (dispersion,), _ = lognormal_of(above, below, np.ones((1, 24)))
    np.testing.assert_allclose([median, dispersion], largest_likelihood(loss), rtol=1e-6)
    # A record that counts twice is two records.
    twice = np.ones(24)
    twice[3] = 2.0
    weighted = lognormal_of(above, below, twice[None])[:2]
    repeated = lognormal_of(np.append(above, above[3]), np.append(below, below[3]), np.ones((1, 25)))[:2]
    np.testing.assert_allclose(np.ravel(weighted), np.ravel(repeated), rtol=1e-9)


def test_stripes_have_the_likelihood_of_their_counts() -> None:
    levels, runs, reached = np.array([1.0, 2.0, 3.0, 4.0]), 10, np.array([1, 3, 6, 9])
    flags = np.concatenate([np.arange(runs) < count for count in reached])
    at = np.repeat(levels, runs)
    (median,), (dispersion,), _ = lognormal_of(
        np.where(flags, 0.0, at), np.where(flags, at, np.inf), np.ones((1, at.size))
    )

    def loss(of: Floats) -> float:
        p = norm.cdf((np.log(levels) - of[0]) / np.exp(of[1]))
        return float(-(reached * np.log(p) + (runs - reached) * np.log(1.0 - p)).sum())

    np.testing.assert_allclose([median, dispersion], largest_likelihood(loss), rtol=1e-6)


INF = math.inf
# The intensities between which records reach a limit, weights, and the median; none has a dispersion.
SEPARATED: dict[str, tuple[list[float], list[float], list[float], float]] = {
    "one intensity separates all": ([1.0, 2.0, 0.0], [3.0, INF, 2.5], [1.0, 1.0, 1.0], math.sqrt(5.0)),
    "none reaches it": ([2.0], [INF], [1.0], INF),
    "all at the lowest": ([0.0], [2.5], [1.0], 0.0),
    "some at the lowest": ([0.0, 0.0, 1.0], [1.0, 1.0, 2.0], [1.0, 1.0, 1.0], 0.0),
    # Where the likelihood has no largest dispersion.
    "few at the highest": ([2.0] * 8 + [1.0] * 2, [INF] * 8 + [2.0] * 2, [1.0] * 10, INF),
    "most at the highest": ([2.0] * 8 + [1.0] * 2, [INF] * 8 + [2.0] * 2, [0.0] * 7 + [1.0] * 3, 2.0),
    # Stripes: a hit is known to lie below its level, a miss above it, and their numbers are chosen, not found.
    "most are hits": ([2.0, 0.0, 0.0, 0.0], [INF, 3.0, 3.0, 4.0], [1.0] * 4, math.sqrt(6.0)),
    "most are misses": ([1.0, 1.0, 2.0, 0.0], [INF, INF, INF, 3.0], [1.0] * 4, math.sqrt(6.0)),
    "one level has both": ([2.0, 0.0, 0.0, 0.0, 0.0], [INF, 2.0, 2.0, 3.0, 3.0], [1.0] * 5, 0.0),
    "most miss at one level": ([1.0, 2.0, 2.0, 0.0, 0.0], [INF, INF, INF, 2.0, 3.0], [1.0] * 5, 2.0),
    "a record without a run": ([1.0, 0.0, 0.0, 0.0], [INF, 2.0, INF, INF], [1.0] * 4, math.sqrt(2.0)),
}


@pytest.mark.parametrize("name", SEPARATED)
def test_records_that_one_intensity_separates_have_no_dispersion(name: str) -> None:
    above, below, weights, median = SEPARATED[name]
    medians, dispersions, _ = lognormal_of(np.array(above), np.array(below), np.array([weights]))
    assert (medians.tolist(), dispersions.tolist()) == ([pytest.approx(median)], [0.0])


def test_where_one_intensity_separates_all_records_the_median_is_known_to_their_interval_only() -> None:
    # The runs at the upper level diverged, so that nothing is interpolated.
    responses = np.array([[0.5, math.inf], [0.6, math.inf], [0.9, math.inf]])
    rows = {"law": responses, "other": responses}
    both = mr.study.fragilities_of(rows, [4.0, 8.0], 1.0, criterion="rms_drift")
    assert (both["law"].dispersion, both["law"].band) == (0.0, (4.0, 8.0))
    assert both.ratio("other", "law") == (1.0, (0.5, 2.0))
    few, coarse = both.remarks
    assert few.code == "records_few"
    assert "in 75 % of cases at most, not in 90 %; give 5 or more" in few.message
    assert (coarse.code, coarse.words) == ("levels_coarse", ("law", "other"))


def stripes(reached: tuple[int, ...], runs: int = 10) -> Floats:
    """A record for each run, of which so many reach 1 at each level; shape (n_levels * runs, n_levels)."""
    table = np.full((runs * len(reached), len(reached)), math.nan)
    for level, count in enumerate(reached):
        table[runs * level : runs * (level + 1), level] = np.where(np.arange(runs) < count, 2.0, 0.5)
    return table


def test_no_run_is_no_failed_run() -> None:
    levels, table = [2.0, 4.0, 6.0, 8.0], stripes((0, 3, 7, 10))
    found = mr.study.fragilities_of({"frame": table}, levels, 1.0, criterion="rms_drift")["frame"]
    # By an own binomial likelihood: 4.800 m/s^2 and 0.2837.
    assert (found.median, found.dispersion) == (pytest.approx(4.8, rel=1e-4), pytest.approx(0.2837, abs=1e-4))
    assert (found.reaching, found.remarks) == ("20 of 40", ())
    assert not np.isin(found.medians, (0.0, math.inf)).any()
    np.testing.assert_array_equal(found.crossed, [0.0, 0.3, 0.7, 1.0])
    # A record that was not run at one level is as known as if it had been far below the limit there.
    steady = np.outer(np.linspace(0.4, 0.9, 8), [1.0, 2.0, 3.0])
    gap = steady.copy()
    gap[0, 0] = math.nan
    whole, part = found_of(steady)["a"], found_of(gap)["a"]
    assert (part.median, part.band, part.reaching) == (whole.median, whole.band, "8 of 8")
    never = np.vstack([steady, np.full(3, math.nan)])
    assert (found_of(never)["a"].median, found_of(never)["a"].reaching) == (whole.median, "8 of 8")
    failed = np.zeros(gap.shape)
    failed[0, 0] = 1.0
    rows, levels = {"a": gap}, [1.0, 2.0, 3.0]
    lost = mr.study.fragilities_of(rows, levels, 1.0, unresolved={"a": failed})["a"]
    assert (lost.crossings[0].unresolved, lost.reaching) == (True, "7 of 8")
    assert [remark.code for remark in lost.remarks] == ["records_unresolved"]
    for wrong in ({"b": failed}, {"a": failed[1:]}, {"a": 1.0 - failed}):
        refusal(mr.study.fragilities_of, rows, levels, 1.0, unresolved=wrong, match="unresolved")


def test_draws_of_stripes_that_one_intensity_separates_bound_the_median() -> None:
    # At 1 and 4 none and all reach the limit, so that many draws have no level with both.
    found = found_of(stripes((0, 1, 9, 10), runs=8))["a"]
    assert found.band[0] >= 1.0
    assert found.band[1] <= 4.0
    assert (np.isfinite(found.ends) & (found.ends > 0.0)).all()
    # Intensities that differ by rounding are one.
    near = found_of(np.array([[0.8, 2.0], [0.9, 1.5]]) / np.array([[1.0], [1.0 + 2e-16]]))["a"]
    assert np.isfinite(near.band).all()


def test_bands_of_stripes_hold_the_median_at_their_level() -> None:
    levels, held = np.array([1.0, 2.0, 3.0, 4.0]), []
    for seed in range(80):
        reached = 2.5 * np.exp(0.4 * np.random.default_rng(seed).standard_normal((4, 10)))
        table = stripes(tuple((reached <= levels[:, None]).sum(axis=1)))
        band = found_of(table, seed=seed)["a"].band
        held.append(band[0] <= 2.5 <= band[1] and band[0] > 0.0 and math.isfinite(band[1]))
    # Of 500 suites 89 %; the standard error of 80 is 3.5 %.
    assert 0.82 < np.mean(held) < 0.96


def test_a_median_above_all_records_is_known_to_lie_above_what_was_simulated() -> None:
    # Two records of three were run at the first level only.
    responses = np.array([[0.2, math.nan, math.nan], [0.3, math.nan, math.nan], [0.1, 0.2, 0.3]])
    found = found_of(responses)["a"]
    assert (found.median, found.band) == (math.inf, (1.0, math.inf))


def found_of(*rows: Floats, limit: float = 1.0, level: float = 0.9, seed: int = 0) -> Fragilities:
    """The fragilities of rows of responses, shape (n_records, n_levels), at the levels 1, 2, ... m/s^2."""
    levels = 1.0 + np.arange(rows[0].shape[1], dtype=float)
    return mr.study.fragilities_of(
        dict(zip("abc", rows, strict=False)), levels, limit, level=level, seed=seed
    )


def test_a_likelihood_without_a_maximum_determines_no_median() -> None:
    # Four records reach the limit at their lowest level, four never do: the flatter the distribution, the likelier.
    both = np.outer([2.0] * 4 + [0.1] * 4, [1.0, 2.0, 3.0])
    steady = np.outer(np.linspace(0.4, 0.9, 8), [1.0, 2.0, 3.0])
    all_found = found_of(both, steady)
    found = all_found["a"]
    assert (found.bound, found.band) == ("not determined", (0.0, math.inf))
    assert all(map(math.isnan, (found.median, found.dispersion, found.probability(2.0))))
    # A draw of one kind of record alone is bounded as before, any other not at all.
    undetermined = np.isnan(found.medians)
    assert 0.9 < undetermined.mean() < 1.0
    assert set(found.ends[0][undetermined]) == {0.0}
    assert set(found.ends[1][undetermined]) == {math.inf}
    assert set(found.medians[~undetermined]) == {0.0, math.inf}
    assert found.remarks[0].code == "median_unknown"
    assert math.isnan(all_found.ratio("b", "a")[0])
    assert np.isnan(all_found.to_xarray()["probability"].sel(row="a")).all()


@pytest.mark.parametrize("reached", [(1, 3, 6, 9), (9, 6, 3, 1), (5, 5, 5, 5)])
def test_counts_that_do_not_rise_with_the_level_determine_no_median(reached: tuple[int, ...]) -> None:
    at = np.repeat([1.0, 2.0, 3.0, 4.0], 10)
    flags = np.concatenate([np.arange(10) < count for count in reached])
    above, below = np.where(flags, 0.0, at), np.where(flags, at, np.inf)
    medians, dispersions, _ = lognormal_of(above, below, np.ones((1, at.size)))
    assert np.isfinite([*medians, *dispersions]).all() == (reached[0] < reached[-1])
    # One record that is known on both sides is enough.
    above, below = np.append(above, 2.0), np.append(below, 3.0)
    assert np.isfinite(lognormal_of(above, below, np.ones((1, at.size + 1)))[:2]).all()


def test_each_draw_has_the_largest_likelihood_or_is_not_determined() -> None:
    rng = np.random.default_rng(3)
    reached = 2.0 * np.exp(0.8 * rng.standard_normal(12))
    above, below = intervals(reached, np.array([1.0, 2.5, 4.0]))
    weights = drawn_weights(12, 1)[:200]
    medians, dispersions, _ = lognormal_of(above, below, weights)
    two = (weights[:, (above > 0.0) & np.isfinite(below)] > 0.0).any(axis=1)
    assert two.mean() > 0.9
    assert np.isfinite(medians[two]).all()

    def loss(median: float, dispersion: float, counts: Floats) -> float:
        with np.errstate(divide="ignore"):
            ends = [norm.cdf(np.log(each / median) / dispersion) for each in (above, below)]
        return float(-(counts * np.log(np.maximum(ends[1] - ends[0], 1e-300))).sum())

    for median, dispersion, counts in zip(medians, dispersions, weights, strict=True):
        if dispersion > 0.0:
            least = loss(median, dispersion, counts)
            beside = [(1.02, 1.0), (0.98, 1.0), (1.0, 1.03), (1.0, 0.97)]
            assert all(loss(median * a, dispersion * b, counts) > least for a, b in beside)


def test_nearly_equal_intensities_converge() -> None:
    # The slope is a hundred times that of the start.
    known = np.array([1.392855848318126, 1.4027768826878086])
    medians, dispersions, _ = lognormal_of(known, known, np.array([[3.0, 1.0]]))
    logs = np.log(known)
    mean = 0.75 * logs[0] + 0.25 * logs[1]
    assert medians == pytest.approx(math.exp(mean))
    assert dispersions == pytest.approx(math.sqrt(0.75 * 0.25) * (logs[1] - logs[0]))


def test_intensities_are_interpolated_between_levels() -> None:
    # A law that lowers each response by 4 % within the intervals of the levels: its ratio is not 1.
    bare = np.outer([0.45, 0.48, 0.6, 0.7, 0.8, 0.95], [1.0, 2.0, 3.0])
    found = found_of(bare, 0.96 * bare)
    reached = [each.interpolated for each in found["a"].crossings]
    np.testing.assert_allclose(reached, 1.0 / bare[:, 0])
    assert found["a"].median == pytest.approx(math.exp(np.log(reached).mean()))
    ratio, band = found.ratio("b", "a")
    np.testing.assert_allclose([ratio, *band], 1.0 / 0.96)
    assert not found.remarks
    # A draw of one record alone has its intensity.
    few = found_of(bare[[0, 2, 4]])["a"]
    np.testing.assert_allclose(few.band, [1.0 / 0.8, 1.0 / 0.45])
    # What diverged or nearly so, or is reached at the lowest level or never, is known to an interval only.
    diverged = found_of(np.array([[0.5, math.inf], [0.5, 1e3], [2.0, 3.0], [0.1, 0.2]]))["a"].crossings
    assert all(math.isnan(each.interpolated) for each in diverged)


@pytest.fixture(scope="module")
def results() -> StudyResults:
    motion = {"synthetic": "kanai_tajimi", "duration": 3.0, "pga": [f"{level} g" for level in LEVELS]}
    study = mr.study_of(
        building={
            "n_storeys": 2,
            "masses": ["20 t"],
            "stiffnesses": ["12 kN/mm"],
            "height": "3 m",
            "modal_damping": {"ratios": ["2 %"]},
        },
        dampers=[{"storey": 1, "preset": "kwok2006", "count": 40}],
        laws=["passive_on"],
        motions=[{**motion, "name": f"record {seed}", "seed": seed} for seed in range(8)],
    )
    return mr.run_study(study)


def test_a_linear_frame_reaches_its_limit_where_its_drifts_say(results: StudyResults) -> None:
    found = mr.fragility(results, limit={"peak_drift_ratio": "0.4 %"})
    bare = found["uncontrolled"]
    # Without dampers drifts are proportional to the intensity.
    scales = []
    for number, crossing in enumerate(bare.crossings):
        peak = float(results.quantities.peak_drift[0, len(LEVELS) * number, 0].max()) / 3.0
        reached = 0.1 * G * 0.004 / peak
        assert crossing.record == f"record {number}"
        assert crossing.above < reached <= crossing.below
        scales.append(math.log(reached))
    assert not bare.bound
    assert bare.median == pytest.approx(math.exp(np.mean(scales)), rel=0.05)
    assert bare.band[0] < bare.median < bare.band[1]
    assert bare.probability(bare.median) == pytest.approx(0.5)
    damped = found["Passive-on"]
    ratio, (low, high) = found.ratio("Passive-on", "uncontrolled")
    assert ratio == damped.median / bare.median > 1.0
    assert low <= ratio <= high
    wider = mr.fragility(results, {"peak_drift_ratio": 0.004}, modelling_dispersion=0.3)["uncontrolled"]
    assert wider.dispersion == pytest.approx(math.hypot(bare.dispersion, 0.3))
    assert "records" in repr(found)


def test_a_median_beyond_the_levels_is_a_bound(results: StudyResults) -> None:
    collapse = mr.fragility(results, {"peak_drift_ratio": "10 %"})["uncontrolled"]
    assert (collapse.bound, collapse.median) == ("above", math.inf)
    assert "above 0.600 g" in collapse.brief
    early = mr.fragility(results, {"peak_drift_ratio": 1e-4})["uncontrolled"]
    assert (early.bound, early.median) == ("below", 0.0)
    assert "below 0.100 g" in early.brief


def test_a_run_that_diverged_has_reached_the_limit_and_one_unresolved_lies_above(
    results: StudyResults,
) -> None:
    def with_end(outcome: Outcome) -> mr.study.Fragility:
        parts = {
            name: study_samples.with_numbers(getattr(results, name), 0, 2, outcome=outcome)
            for name in ("quantities", "criteria_of_runs")
        }
        return mr.fragility(replace(results, **parts), {"peak_drift_ratio": 0.1})["uncontrolled"]

    diverged, unresolved = with_end(Outcome.DIVERGED), with_end(Outcome.UNRESOLVED)
    first, last = diverged.crossings[0], unresolved.crossings[0]
    assert (first.above, first.below) == pytest.approx((0.14 * G, 0.2 * G))
    assert (last.above, last.below, last.unresolved) == (pytest.approx(0.14 * G), math.inf, True)
    # The share that reached the limit is that of the runs that are known.
    assert (unresolved.crossed[2], diverged.crossed[2]) == (0.0, pytest.approx(1.0 / 8.0))
    assert diverged.responses[0, 2] == math.inf
    assert math.isnan(unresolved.responses[0, 2])


def test_what_lies_beyond_the_levels_bounds_bands_and_ratios() -> None:
    results = study_samples.incremental()
    found = mr.fragility(results, {"peak_drift": "45 mm"})
    bare, law = found["uncontrolled"], found["Lyapunov <1 A>"]
    assert (bare.bound, law.bound, law.median) == ("", "above", math.inf)
    assert law.band == (law.levels[-1], math.inf)
    ratio, (low, high) = found.ratio(law.label, bare.label)
    assert math.isnan(ratio)
    assert low == pytest.approx(law.levels[-1] / bare.band[1])
    assert high == math.inf


def test_arrays_by_record_and_intensity_are_those_by_motion(results: StudyResults) -> None:
    tree = results.to_xarray(by_record=True)
    drift, plain = tree["criteria/peak_drift"], results.to_xarray()["criteria/peak_drift"]
    assert drift.dims == ("row", "record", "intensity", "realisation")
    assert tree["quantities/peak_drift"].dims == (*drift.dims, "storey")
    assert drift["intensity"].attrs == {"units": "m/s^2", "long_name": "PGA"}
    np.testing.assert_allclose(drift["intensity"], G * np.array(LEVELS), rtol=1e-8)
    one = drift.sel(row="uncontrolled", record="record 3").isel(intensity=4, realisation=0)
    assert float(one) == float(plain.sel(row="uncontrolled", motion="record 3, 0.3 g").isel(realisation=0))
    fewer = study_samples.under(
        results, [replace(results.motions[0], record="alone"), *[*results.motions][1:]]
    )
    refusal(fewer.to_xarray, by_record=True, match="same levels")


def test_what_has_no_fragility_is_refused(results: StudyResults) -> None:
    limit = {"peak_drift_ratio": 0.01}
    refusal(mr.fragility, results, {**limit, "peak_acceleration": 1.0}, match="one criterion")
    refusal(mr.fragility, results, {"peak_drift_ratio": "1 mm"}, match="its unit")
    bare = replace(results, building=replace(results.building, heights=()))
    alone = study_samples.under(results, [replace(each, record="one") for each in results.motions])
    spectral = Intensity(measure="sa", value=1.0, period=0.8, damping_ratio=0.05)
    mixed = [replace(results.motions[0], intensity=spectral), *[*results.motions][1:]]
    some = study_samples.with_numbers(results.quantities, 1, 3, outcome=NOT_RUN)
    for without, word in (
        (bare, "height"),
        (alone, "1 record"),
        (study_samples.under(results, mixed), "several measures"),
        (replace(results, quantities=some), "--resume"),
    ):
        refusal(mr.fragility, without, limit, match=word)
    refusal(mr.fragility(results, limit).__getitem__, "passive", match="arrangement")
