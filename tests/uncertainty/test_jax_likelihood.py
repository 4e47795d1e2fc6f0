"""The likelihood as a function of JAX: that of the posterior's target, with its derivatives."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from posterior_samples import MODEL, small_sampling, small_test
from sentences import Refused

import mrwork as mr
from mrwork.uncertainty.noise import NOISES

SMOOTH = [name for name, each in NOISES.items() if each.differentiable]


@pytest.mark.parametrize("noise", SMOOTH)
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


def test_noise_and_objectives_without_a_likelihood_are_refused(refused: Refused) -> None:
    refused(mr.jax.log_likelihood, MODEL, small_test(), "arma11")
    refused(mr.jax.log_likelihood, MODEL, small_test(), "white")
    weighted = mr.objective(MODEL, small_test(), weights=[2.0])
    refused(mr.jax.log_likelihood, weighted)
