"""When a search has said what it can: the hypothesis test, the stall, the expected generation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mrwork.search import expected_termination
from mrwork.search.rules import first_improvement, has_stalled, hypothesis_test, statistic, threshold


def test_thresholds_are_those_of_the_source():
    # 0.334 at 95 % and 0.217 at 99 %.
    assert threshold(0.95) == pytest.approx(0.334, abs=5e-4)
    assert threshold(0.99) == pytest.approx(0.217, abs=5e-4)


def test_statistic_counts_from_the_first_improvement():
    best = np.array([np.inf, 9.0, 9.0, 4.0, 2.0])
    assert first_improvement(best) == 1
    assert statistic(best) == pytest.approx((9 + 9 + 4 + 2) / 4 / 9)
    assert first_improvement(np.array([9.0, 9.0, 4.0, 2.0])) == 2
    assert statistic(np.array([9.0, 9.0, 4.0, 2.0])) == pytest.approx(0.75)


@pytest.mark.parametrize("best", [[], [1.0], [1.0, 1.0], [np.inf, np.inf], [2.0, 0.0], [0.0, 0.0]])
def test_nothing_decayed_means_no_stop(best):
    assert not hypothesis_test(np.array(best))


def test_traces_side_by_side_are_judged_each_on_its_own():
    traces = np.array([[np.inf, 9.0, 9.0, 4.0, 2.0], [9.0, 9.0, 9.0, 9.0, 9.0], [9.0, 3.0, 1.0, 0.5, 0.1]])
    assert np.array_equal(first_improvement(traces), [1, 5, 1])
    assert np.array_equal(statistic(traces), [float(statistic(trace)) for trace in traces])
    floor = np.array([0.5, 0.0, 0.1])
    assert np.array_equal(
        statistic(traces, floor=floor),
        [float(statistic(t, floor=f)) for t, f in zip(traces, floor, strict=True)],
    )
    assert np.array_equal(has_stalled(traces, generations=3, tolerance=0.1), [False, True, False])


def test_statistic_does_not_depend_on_the_unit_of_the_misfit():
    best = np.exp(-0.1 * np.arange(40))
    assert statistic(best * 1e300) == pytest.approx(statistic(best), rel=1e-12)


def test_stall_is_relative_and_needs_its_generations():
    best = np.array([2.0, 1.0, 0.9995, 0.9995])
    assert has_stalled(best, generations=2, tolerance=1e-3)
    assert not has_stalled(best, generations=2, tolerance=1e-4)
    assert not has_stalled(best, generations=3, tolerance=1e-3)
    assert not has_stalled(best, generations=4, tolerance=1e-3)
    assert has_stalled(np.zeros(5), generations=3, tolerance=1e-3)
    assert has_stalled(np.full(5, np.inf), generations=3, tolerance=1e-3)


@pytest.mark.parametrize("rate", [0.01, 0.07, 0.3, 1.0])
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.99])
@pytest.mark.parametrize("flat_start", [0, 4])
def test_expected_termination_is_where_the_test_stops_on_an_exponential(rate, confidence, flat_start):
    decay = np.concatenate([np.full(flat_start, 3.0), 3.0 * np.exp(-rate * np.arange(2000))])
    stop = next(g for g in range(1, decay.size) if hypothesis_test(decay[: g + 1], confidence=confidence))
    seen = decay[: flat_start + 6]
    expected = expected_termination(seen, confidence)
    assert expected.generation == stop
    assert expected.likelihood == pytest.approx(1.0)


def test_expected_termination_sees_the_decay_above_a_floor():
    excess = np.exp(-0.2 * np.arange(30))
    plain, floored = expected_termination(excess), expected_termination(0.1 + excess, floor=0.1)
    assert floored.generation == plain.generation


def test_noise_on_the_decay_lowers_the_likelihood():
    rng = np.random.default_rng(0)
    likelihood = []
    for noise in (0.001, 0.03, 0.3):
        trace = np.exp(-0.2 * np.arange(30) + noise * rng.standard_normal(30))
        expected = expected_termination(trace)
        likelihood.append(expected.likelihood)
    assert likelihood == sorted(likelihood, reverse=True)
    assert 0.0 < likelihood[-1] < likelihood[0] <= 1.0


@pytest.mark.parametrize("noise", [0.3, 1.0])
def test_likelihood_is_the_share_of_likely_rates_that_end_in_the_same_generation(noise):
    rng = np.random.default_rng(2)
    age = np.arange(40)
    logarithm = -0.2 * age + noise * rng.standard_normal(age.size)
    # A first entry far above, so that the fit starts at the second for any noise.
    seen = expected_termination(np.concatenate([[9.0], np.exp(logarithm)]))
    (slope, _), covariance = np.polyfit(age, logarithm, 1, cov=True)
    rates = -slope + math.sqrt(covariance[0, 0]) * rng.standard_normal(4000)
    exact = [np.concatenate([[9.0], np.exp(-rate * age)]) for rate in rates]
    ends = [expected_termination(trace).generation for trace in exact]
    share = np.mean(np.array(ends) == seen.generation)
    assert 0.1 < share < 0.95
    # Four standard deviations of a share counted in 4000 draws.
    assert seen.likelihood == pytest.approx(share, abs=4 * 0.5 / math.sqrt(4000))


@pytest.mark.parametrize("best", [[1.0, 1.0, 1.0], [2.0, 1.0, 1.0, 1.0, 1.0], [np.inf, 2.0, 1.0]])
def test_no_decay_no_expected_termination(best):
    assert expected_termination(np.array(best)) == (None, 0.0)
