"""The density that NUTS draws from is that of the ensemble, and its draws are about the fit."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from posterior_samples import independent_errors, small_fit, small_sampling

from mrwork.uncertainty import Normal
from mrwork.uncertainty.posterior.laplace import first_walkers
from mrwork.uncertainty.posterior.nuts import traced_log_posterior

pytest.importorskip("numpyro", reason="numpyro is not installed; pip install 'mrwork[nuts]'")


@pytest.mark.long
def test_both_samplers_have_one_target() -> None:
    sampling = small_sampling("ar1", tempering=0.5, priors={"k_w": Normal(mean=650.0, deviation=50.0)})
    target = sampling.target
    positions = first_walkers(target, sampling.start, 8, np.random.default_rng(1))
    found = jax.jit(jax.vmap(traced_log_posterior(target)))(jnp.asarray(positions))
    np.testing.assert_allclose(found, target(positions), rtol=1e-12)


@pytest.mark.long
def test_nuts_draws_about_the_fit() -> None:
    from mrwork.uncertainty import sample_nuts

    sampling = small_sampling()
    nuts = sample_nuts(sampling.target, sampling.start, warmup=60, draws=80, chains=1)
    assert nuts.diverged == 0
    for index, (estimate, error) in enumerate(
        zip(small_fit().estimates, independent_errors(small_fit()), strict=True)
    ):
        # Eighty draws know their mean to a fifth of their deviation.
        assert nuts.values[..., index].mean() == pytest.approx(estimate.value, abs=0.8 * error)
