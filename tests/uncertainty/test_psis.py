"""Leave-one-out by importance sampling agrees with exact leave-one-out; its blocks are of whole cycles."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from posterior_samples import independent_errors
from refusals import refusal
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm
from sinusoidal_tests import PER_CYCLE, sinusoidal_test

from mrwork import identify
from mrwork.dampers import damper
from mrwork.identification import Fit
from mrwork.identification.result import autocorrelation_time
from mrwork.records import DamperTest
from mrwork.uncertainty import NOISES
from mrwork.uncertainty.choice.leave_one_out import (
    UNRELIABLE,
    block_densities,
    blocks_of,
    leave_one_out,
    longest_autocorrelation_times,
    residuals_of,
    variance_of,
)
from mrwork.uncertainty.posterior.laplace import draw_about, fisher_ellipsoid
from mrwork.uncertainty.posterior.target import target_of

THETA = (800.0, 900.0, 2000.0, 20.0)
HELD = {"rho": (2000.0, 2000.0), "f0": (20.0, 20.0)}


@pytest.fixture(scope="module")
def record() -> DamperTest:
    return sinusoidal_test("viscous_dahl", THETA, (0.01, 1.0), noise=0.05, cycles=9)


@pytest.fixture(scope="module")
def fit(record: DamperTest) -> Fit:
    return identify("viscous_dahl", record, bounds=HELD, threads=1)


def exact(log_densities: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log density of each block under the posterior of the others, from a grid with even priors."""
    others = log_densities.sum(axis=1, keepdims=True) - log_densities
    return np.asarray(logsumexp(log_densities + others, axis=0) - logsumexp(others, axis=0))


def test_it_is_the_posterior_given_the_other_blocks(record: DamperTest, fit: Fit) -> None:
    blocks = (blocks_of(record, 1.0),)
    target, theta = target_of(fit, (record,), NOISES["iid"], tempering=0.5)
    draws = draw_about(target, theta, 2000, np.random.default_rng(0))
    values = np.asarray(target.space.values(draws.position)[0])
    n_params = len(theta)
    found = leave_one_out(
        block_densities(target, values[:, :n_params], values[:, n_params:], blocks), draws.log_ratio
    )
    ellipsoid = fisher_ellipsoid(target, theta)
    deviation = np.sqrt(np.diag(ellipsoid.covariance))
    axes = [np.linspace(-4.5, 4.5, 17) * each for each in deviation]
    grid = np.tile(ellipsoid.centre, (17**3, 1))
    grid[:, ellipsoid.moving] += np.array(list(product(*axes)))
    values = np.asarray(target.space.values(grid)[0])
    expected = exact(block_densities(target, values[:, :n_params], values[:, n_params:], blocks))
    assert len(expected) >= 6
    assert np.all(found.pareto_k < UNRELIABLE)
    # 2000 draws of weights that vary little tell a log density to a few hundredths.
    assert found.elpd == pytest.approx(expected, abs=0.1)


def test_weighted_draws_have_the_moments_of_the_posterior(record: DamperTest, fit: Fit) -> None:
    target, theta = target_of(fit, (record,), NOISES["iid"], tempering=0.5)
    draws = draw_about(target, theta, 2000, np.random.default_rng(1))
    assert draws.effective > 1000.0
    values = np.asarray(target.space.values(draws.position)[0])
    mean = draws.weights @ values
    spread = np.sqrt(draws.weights @ (values - mean) ** 2)
    # The posterior is that of half the samples.
    errors = independent_errors(fit)
    for index, estimate in enumerate(fit.estimates[:2]):
        assert mean[index] == pytest.approx(estimate.value, abs=0.2 * spread[index])
        assert spread[index] == pytest.approx(np.sqrt(2.0) * errors[index], rel=0.15)


def test_a_known_posterior_is_left_out_exactly() -> None:
    # A mean known from eight observations of unit scatter: everything is normal.
    rng = np.random.default_rng(2)
    observed = rng.standard_normal(8)
    draws = observed.mean() + rng.standard_normal(20_000) / np.sqrt(8.0)
    found = leave_one_out(norm.logpdf(observed, draws[:, None], 1.0), np.zeros(draws.size))
    rest = (observed.sum() - observed) / 7.0
    assert found.elpd == pytest.approx(norm.logpdf(observed, rest, np.sqrt(1.0 + 1.0 / 7.0)), abs=0.02)
    assert found.pareto_k.max() < UNRELIABLE


def test_draws_from_elsewhere_are_put_right_by_their_weights() -> None:
    rng = np.random.default_rng(3)
    observed = rng.standard_normal(8)
    wide = 2.0 / np.sqrt(8.0)
    draws = 0.1 + observed.mean() + wide * rng.standard_normal(20_000)
    ratio = norm.logpdf(draws, observed.mean(), 1.0 / np.sqrt(8.0)) - norm.logpdf(
        draws, 0.1 + observed.mean(), wide
    )
    found = leave_one_out(norm.logpdf(observed, draws[:, None], 1.0), ratio)
    rest = (observed.sum() - observed) / 7.0
    assert found.elpd == pytest.approx(norm.logpdf(observed, rest, np.sqrt(1.0 + 1.0 / 7.0)), abs=0.03)


def test_a_block_that_settles_the_posterior_alone_is_told() -> None:
    rng = np.random.default_rng(4)
    # Four parameters, and of three blocks one has nearly all the samples.
    draws = rng.multivariate_normal(np.zeros(4), 1e-4 * np.eye(4), 2000)
    heavy = multivariate_normal.logpdf(draws, np.full(4, 0.02), 1e-4 * np.eye(4))
    light = multivariate_normal.logpdf(draws, np.zeros(4), np.eye(4))
    found = leave_one_out(np.stack([heavy, light, light], axis=1), np.zeros(2000))
    assert found.pareto_k[0] > UNRELIABLE
    assert found.pareto_k[1] < UNRELIABLE


def test_too_little_to_leave_out_is_refused() -> None:
    refusal(leave_one_out, np.zeros((200, 1)), np.zeros(200), match="one block only")
    refusal(leave_one_out, np.zeros((20, 3)), np.zeros(20), match="20 draws")


def test_residuals_are_those_of_the_fit(record: DamperTest, fit: Fit) -> None:
    (residual,) = residuals_of(fit, (record,))
    assert residual.size == fit.n_time
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(fit.nrmse, rel=1e-6)
    assert variance_of(fit, (record,)) == pytest.approx(fit.nrmse**2, rel=1e-6)


@pytest.fixture(scope="module")
def ten_cycles() -> DamperTest:
    return sinusoidal_test("bingham", damper("bingham").nominal, (0.01, 1.0), noise=0.01, cycles=10)


@pytest.mark.parametrize("least", [1.0, PER_CYCLE + 5.0, 3.5 * PER_CYCLE, 100.0 * PER_CYCLE])
def test_blocks_are_without_gaps_and_long_enough(ten_cycles: DamperTest, least: float) -> None:
    blocks = blocks_of(ten_cycles, least)
    n_counted = ten_cycles.n_time - ten_cycles.n_settle
    assert [block.start for block in blocks] == [0, *(block.stop for block in blocks[:-1])]
    assert blocks[-1].stop == n_counted
    lengths = [block.stop - block.start for block in blocks]
    assert min(lengths) >= min(least, n_counted)
    # Whole cycles within a sample, but for the ends, which take the parts that are left.
    inner = np.array(lengths[1:-1]) / PER_CYCLE
    assert np.all(np.abs(inner - np.round(inner)) < 0.03)


def test_a_block_per_cycle_where_nothing_is_remembered(ten_cycles: DamperTest) -> None:
    assert len(blocks_of(ten_cycles, 1.0)) in (8, 9, 10)
    assert len(blocks_of(ten_cycles, 1e9)) == 1


def test_a_motion_without_cycles_is_one_block(ten_cycles: DamperTest) -> None:
    pull = replace(ten_cycles, displacement=np.linspace(0.0, 0.01, ten_cycles.n_time))
    assert len(blocks_of(pull, 1.0)) == 1


def test_blocks_outlast_the_memory_of_every_model(ten_cycles: DamperTest) -> None:
    rng = np.random.default_rng(1)
    n_counted = ten_cycles.n_time - ten_cycles.n_settle
    white = rng.standard_normal(n_counted)
    slow = np.convolve(rng.standard_normal(n_counted + 199), np.ones(200), mode="valid")
    least = longest_autocorrelation_times([(white,), (slow,)])
    assert least == (autocorrelation_time(slow),)
    assert least[0] > PER_CYCLE
    assert all(block.stop - block.start >= least[0] for block in blocks_of(ten_cycles, least[0]))
