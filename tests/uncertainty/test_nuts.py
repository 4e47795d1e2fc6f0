"""Two samplers: the same target density, and the same draws within their error."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from posterior_samples import small_fit, small_sampling, small_test
from refusals import refusal
from scipy.stats import ks_2samp

from mrwork import identify
from mrwork.identification import FitSettings, Objective
from mrwork.records import Observation
from mrwork.records.reading import synthetic_test
from mrwork.uncertainty import Normal, Target, convergence, first_walkers, sample
from mrwork.uncertainty.posterior.nuts import traced_log_posterior
from mrwork.uncertainty.posterior.sample import SamplingProblem

pytest.importorskip("numpyro", reason="numpyro is not installed; pip install 'mrwork[nuts]'")


@pytest.mark.parametrize("noise", ["iid", "student_t", "ar1", "amplitude"])
def test_both_samplers_have_one_target(noise: str) -> None:
    sampling = small_sampling(noise, tempering=0.5, priors={"k_w": Normal(mean=650.0, deviation=50.0)})
    target = sampling.target
    positions = first_walkers(target, sampling.start, 8, np.random.default_rng(1))
    found = jax.jit(jax.vmap(traced_log_posterior(target)))(jnp.asarray(positions))
    np.testing.assert_allclose(found, target(positions), rtol=1e-12)


def test_both_samplers_have_one_target_with_an_observation_and_nuisance_parameters() -> None:
    sampling = small_sampling("ar1")
    form, noise = sampling.target.form, sampling.target.noise
    averaged = replace(small_test(), observation=Observation(average_seconds=0.05))
    objective = Objective.of(form.spec, (averaged,), FitSettings(nuisances=("level", "delay")))
    target = Target.of(form, objective, noise, start=sampling.start, priors={}, tempering=1.0)
    positions = first_walkers(target, sampling.start, 2, np.random.default_rng(1))
    found = jax.jit(jax.vmap(traced_log_posterior(target)))(jnp.asarray(positions))
    np.testing.assert_allclose(found, target(positions), rtol=1e-10)


def test_both_samplers_have_one_target_where_a_stiffness_may_be_zero() -> None:
    test = synthetic_test("spencer1997_fast")
    fit = identify("normalised_bouc_wen", test, rng=1)
    sampling = SamplingProblem.of_fit(
        fit,
        (test,),
        noise="iid",
        priors={"x0": Normal(mean=0.04, deviation=0.1)},
        tempering=None,
        walkers=32,
        rng=0,
        threads=1,
    )
    assert sampling.target.space.pair is not None
    positions = first_walkers(sampling.target, sampling.start, 4, np.random.default_rng(1))
    log_density = jax.jit(traced_log_posterior(sampling.target))
    found = [float(log_density(jnp.asarray(row))) for row in positions]
    np.testing.assert_allclose(found, sampling.target(positions), rtol=1e-12)
    outside = positions[0].copy()
    outside[0] = 1.1
    assert float(log_density(jnp.asarray(outside))) == -np.inf


def test_the_ensemble_and_nuts_draw_from_the_same_posterior() -> None:
    from mrwork.uncertainty import sample_nuts

    test = small_test(n_time=75)
    settings = {"tempering": 0.8, "walkers": 32, "rng": 1, "threads": 1}
    sampling = SamplingProblem.of_fit(small_fit(), (test,), noise="iid", priors={}, **settings)
    ensemble = sample(small_fit(), test, **settings)
    nuts = sample_nuts(sampling.target, sampling.start, warmup=200, draws=400, chains=2)
    assert nuts.diverged == 0
    both = np.concatenate([ensemble.chains, ensemble.noise_chains], axis=-1)
    for index in range(both.shape[-1]):
        ours, theirs = both[..., index], nuts.values[..., index]
        assert convergence(theirs).rhat < 1.03
        # Means within four of their common Monte-Carlo errors; a deviation is known to about 1/sqrt(2 ESS).
        error = np.hypot(convergence(ours).mcse, convergence(theirs).mcse)
        assert abs(ours.mean() - theirs.mean()) < 4.0 * error
        least = min(convergence(ours).ess_bulk, convergence(theirs).ess_bulk)
        assert ours.std() / theirs.std() == pytest.approx(1.0, abs=4.0 / np.sqrt(least))
        # Draws thinned until they are about independent; of five tests at a seed that is fixed.
        one, other = (
            chain.ravel()[:: max(1, int(2 * chain.size / convergence(chain).ess_bulk))]
            for chain in (ours, theirs)
        )
        assert ks_2samp(one, other).pvalue > 0.01


def test_noise_without_derivatives_is_refused() -> None:
    refusal(traced_log_posterior, small_sampling("arma11").target, match="no derivatives")
