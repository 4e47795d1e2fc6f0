"""Effective samples: exact for autoregressive noise, at most the number of samples, added up over tests."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from mrwork.dampers import damper
from mrwork.identification import Objective
from mrwork.identification.result import autocorrelation_time, effective_samples, residuals_by_test
from mrwork.records.reading import synthetic_test


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
    tests = tuple(synthetic_test(name) for name in ("spencer1997", "spencer1997_fast"))
    objective = Objective.of(damper("bouc_wen"), tests)
    residuals = objective.residuals(damper("bouc_wen").nominal[None])[0]
    first, second = residuals_by_test(residuals, tests)
    assert [first.size, second.size] == [test.n_time - test.n_settle for test in tests]
    np.testing.assert_array_equal(np.concatenate([first, second]), residuals)
    together = effective_samples([first, second])
    assert together == pytest.approx(effective_samples([first]) + effective_samples([second]))
    # The noise of these tests is white, but for what noise in the motion makes of the force.
    assert 0.2 * residuals.size < together <= residuals.size
