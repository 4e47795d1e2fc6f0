"""The expected generation of the hypothesis test, of chapter 4."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mrwork.search.rules import hypothesis_test
from studies.chapter_4.termination import expected_termination


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
