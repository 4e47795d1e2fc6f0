"""Leave-one-out by importance sampling of a known posterior; its blocks are of whole cycles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm
from sinusoidal_tests import PER_CYCLE, sinusoidal_test

from mrwork import identify
from mrwork.dampers import damper
from mrwork.identification import Fit
from mrwork.identification.covariance import autocorrelation_time
from mrwork.records import DamperTest
from mrwork.uncertainty.choice.leave_one_out import (
    UNRELIABLE,
    blocks_of,
    leave_one_out,
    longest_autocorrelation_times,
    residuals_of,
    variance_of,
)

THETA = (800.0, 900.0, 2000.0, 20.0)
HELD = {"rho": (2000.0, 2000.0), "f0": (20.0, 20.0)}


@pytest.fixture(scope="module")
def record() -> DamperTest:
    return sinusoidal_test("viscous_dahl", THETA, (0.01, 1.0), noise=0.05, cycles=9)


@pytest.fixture(scope="module")
def fit(record: DamperTest) -> Fit:
    return identify("viscous_dahl", record, bounds=HELD, threads=1)


def test_a_known_posterior_is_left_out_exactly() -> None:
    # A mean known from eight observations of unit scatter: everything is normal.
    rng = np.random.default_rng(2)
    observed = rng.standard_normal(8)
    draws = observed.mean() + rng.standard_normal(20_000) / np.sqrt(8.0)
    found = leave_one_out(norm.logpdf(observed, draws[:, None], 1.0), np.zeros(draws.size))
    rest = (observed.sum() - observed) / 7.0
    assert found.elpd == pytest.approx(norm.logpdf(observed, rest, np.sqrt(1.0 + 1.0 / 7.0)), abs=0.02)
    assert found.pareto_k.max() < UNRELIABLE


def test_residuals_are_those_of_the_fit(record: DamperTest, fit: Fit) -> None:
    (residual,) = residuals_of(fit, (record,))
    assert residual.size == fit.n_time
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(fit.nrmse, rel=1e-6)
    assert variance_of(fit, (record,)) == pytest.approx(fit.nrmse**2, rel=1e-6)


@pytest.fixture(scope="module")
def ten_cycles() -> DamperTest:
    return sinusoidal_test("bingham", damper("bingham").nominal, (0.01, 1.0), noise=0.01, cycles=10)


def test_blocks_outlast_the_memory_of_every_model(ten_cycles: DamperTest) -> None:
    rng = np.random.default_rng(1)
    n_counted = ten_cycles.n_time - ten_cycles.n_settle
    white = rng.standard_normal(n_counted)
    slow = np.convolve(rng.standard_normal(n_counted + 199), np.ones(200), mode="valid")
    least = longest_autocorrelation_times([(white,), (slow,)])
    assert least == (autocorrelation_time(slow),)
    assert least[0] > PER_CYCLE
    assert all(block.stop - block.start >= least[0] for block in blocks_of(ten_cycles, least[0]))
