"""A small problem to sample: a Bingham-like loop of 150 samples with white noise, fitted."""

from functools import cache

import numpy as np

import mrwork as mr
from mrwork.uncertainty.posterior.sample import SamplingProblem, sample
from mrwork.uncertainty.posterior.target import Tempering

MODEL = "viscous_dahl"
NOISE_N = 20.0


@cache
def small_test(rng: int = 5, n_time: int = 150) -> mr.DamperTest:
    time = 2.0 / n_time * np.arange(n_time)
    x, v = 0.01 * np.sin(2.0 * np.pi * time), 0.02 * np.pi * np.cos(2.0 * np.pi * time)
    spec = mr.damper(MODEL)
    force = mr.simulate_force(spec, spec.nominal, mr.Loading(dt=time[1], displacement=x, velocity=v))
    force = force + NOISE_N * np.random.default_rng(rng).standard_normal(n_time)
    return mr.test_from_arrays(name="small", time=time, displacement=x, velocity=v, force=force)


@cache
def small_fit() -> mr.Fit:
    return mr.identify(MODEL, small_test(), rng=1)


def independent_errors(fit: mr.Fit) -> list[float]:
    """Standard errors of a fit if every residual counted, as in a likelihood without tempering."""
    assert fit.n_effective is not None
    share = fit.n_effective / fit.n_time
    return [
        np.nan if each.standard_error is None else each.standard_error * share**0.5 for each in fit.estimates
    ]


def small_sampling(
    noise: str = "iid", fit: mr.Fit | None = None, *tests: mr.DamperTest, tempering: Tempering | None = 1.0
) -> SamplingProblem:
    return SamplingProblem.of_fit(
        fit or small_fit(),
        tests or (small_test(),),
        noise=noise,
        priors={},
        tempering=tempering,
        walkers=32,
        rng=0,
        threads=1,
    )


@cache
def small_draws(noise: str = "iid") -> mr.Draws:
    """Draws that are too few, and made in little time."""
    return sample(small_fit(), small_test(), noise=noise, walkers=16, most_steps=60, threads=1)


@cache
def converged_draws() -> mr.Draws:
    return sample(small_fit(), small_test(), tempering=1.0, walkers=32, rng=3, threads=1)
