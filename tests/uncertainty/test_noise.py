"""Noise models: densities against closed forms, draws against densities, estimates from draws; likelihoods in JAX."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from posterior_samples import MODEL, small_sampling, small_test
from scipy.stats import multivariate_normal

import mrwork as mr
import mrwork.twins.model_twins
from mrwork.uncertainty import Iid
from mrwork.uncertainty.noise import NOISES

PARAMETERS = {"iid": [0.1], "ar1": [0.1, 0.9]}
N_TIME = 4000


def test_density_of_correlated_noise_is_that_of_the_joint_normal() -> None:
    sigma, phi = PARAMETERS["ar1"]
    lags = np.abs(np.subtract.outer(np.arange(300), np.arange(300)))
    joint = multivariate_normal(np.zeros(300), sigma**2 * phi**lags)
    rows = joint.rvs(3, random_state=0)
    ours = NOISES["ar1"].log_densities(rows, np.tile(PARAMETERS["ar1"], (3, 1))).sum(axis=1)
    np.testing.assert_allclose(ours, joint.logpdf(rows), atol=1e-8)


@pytest.mark.parametrize("name", NOISES)
def test_noise_has_one_density_in_numpy_and_jax(name: str) -> None:
    noise = np.tile(PARAMETERS[name], (3, 1))
    residual = 0.1 * np.random.default_rng(5).standard_normal((3, N_TIME))
    ours = NOISES[name].log_densities(residual, noise)
    traced = jax.jit(NOISES[name].log_densities)(residual, noise)
    np.testing.assert_allclose(traced, ours, rtol=1e-11, atol=1e-11)


def test_independent_noise_needs_only_the_sum_of_squares() -> None:
    residual = np.random.default_rng(1).standard_normal((3, 50))
    noise = np.array([[0.5], [1.0], [2.0]])
    model = Iid()
    whole = model.log_densities(residual, noise).sum(axis=1)
    np.testing.assert_allclose(model.log_likelihood_of_sum((residual**2).sum(axis=1), 50, noise), whole)


@pytest.mark.parametrize("name", NOISES)
def test_draws_are_likeliest_under_their_own_parameters(name: str) -> None:
    true = np.array([PARAMETERS[name]])
    residual = NOISES[name].draw(N_TIME, true, np.random.default_rng(2))
    at_true = NOISES[name].log_densities(residual, true).sum()
    for index in range(true.size):
        for factor in (0.7, 1.1):
            other = true.copy()
            other[0, index] *= factor
            assert NOISES[name].log_densities(residual, other).sum() < at_true


@pytest.mark.parametrize("name", NOISES)
def test_moments_of_draws_give_the_parameters_back(name: str) -> None:
    true = np.array([PARAMETERS[name]])
    (residual,) = NOISES[name].draw(8 * N_TIME, true, np.random.default_rng(3))
    np.testing.assert_allclose(NOISES[name].estimate(residual), true[0], rtol=0.1)


@pytest.mark.parametrize("noise", ["iid", "ar1"])
def test_it_is_that_of_the_target_and_its_gradient_that_of_differences(noise: str) -> None:
    target = small_sampling(noise).target
    likelihood = mr.jax.log_likelihood(MODEL, small_test(), noise)
    box = likelihood.box
    theta = np.asarray(box.theta_from(np.array(likelihood.start), "theta"))
    target = replace(target, space=replace(target.space, box=box, pair=None))
    expected = target.log_likelihood(theta[None])[0]
    assert np.isclose(likelihood(likelihood.start), expected, rtol=1e-12)
    point = np.array(likelihood.start)
    gradient = np.asarray(jax.grad(likelihood)(jnp.asarray(point)))
    for index, slope in enumerate(gradient):
        step = np.zeros_like(point)
        step[index] = 1e-6 * max(abs(point[index]), 1e-2)
        difference = (likelihood(point + step) - likelihood(point - step)) / (2.0 * step[index])
        assert np.isclose(slope, difference, rtol=1e-4, atol=1e-6 * np.abs(gradient).max())


def test_a_failed_point_has_no_likelihood_and_a_gradient_of_zero() -> None:
    likelihood = mr.jax.log_likelihood(MODEL, small_test(), coordinates="latent")
    start = jnp.asarray(likelihood.start)
    assert np.isfinite(likelihood(start))
    failed = start.at[0].set(jnp.nan)
    assert likelihood(failed) == -np.inf
    assert not np.asarray(jax.grad(likelihood)(failed)).any()


def test_noise_outside_its_range_has_no_likelihood_and_a_gradient_of_zero() -> None:
    likelihood = mr.jax.log_likelihood(MODEL, small_test(), "ar1")
    start = jnp.asarray(likelihood.start)
    assert np.isfinite(likelihood(start))
    for column, value in ((-2, 0.0), (-2, -1.0), (-1, 1.0), (-1, 2.0)):
        assert likelihood(start.at[column].set(value)) == -np.inf
        assert not np.asarray(jax.grad(likelihood)(start.at[column].set(value))).any()
