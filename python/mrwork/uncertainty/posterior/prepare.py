"""From a fit to a sampling about it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.prior import Prior
from mrwork.uncertainty.posterior.sampling import Sampling
from mrwork.uncertainty.posterior.target import Target, Tempering


def prepared(
    spec: DamperSpec,
    tests: tuple[DamperTest, ...],
    start: Fit,
    *,
    noise: str,
    priors: Mapping[str, Prior],
    tempering: Tempering | None,
    walkers: int,
    rng: int,
    threads: int,
) -> Sampling:
    """What `sample_posterior` samples, with its arguments.

    Raises
    ------
    SettingError
        Where the start is of another model or cannot be simulated, or a setting or a prior is impossible.
    UnknownNameError
        Where there is no such noise model, or a prior is of what there is not.
    """
    if start.spec != spec:
        raise SettingError(
            f"the start is a fit of {start.model} with other laws or parameters than this {spec.name}; "
            "sample the model that was fitted"
        )
    problem = Problem.of_fit(start, tests, threads=threads)
    form, objective = problem.form, problem.objective
    theta = problem.inside(start.theta)
    if not np.isfinite(objective(theta[None])[0]):
        raise SettingError(
            f"the fit of {spec.name} cannot be simulated on these tests; give those of the fit"
        )
    target = Target.of(form, objective, noise_model(noise), start=theta, priors=priors, tempering=tempering)
    n_dim = target.space.n_dim
    if walkers < 2 * n_dim or walkers % 2:
        raise SettingError(
            f"`walkers` is {walkers} for {n_dim} parameters with those of the noise; "
            f"give an even number, at least {2 * n_dim}"
        )
    return Sampling(
        spec=spec,
        target=target,
        bounds=problem.settings.bounds,
        priors=priors,
        start=theta,
        walkers=walkers,
        rng=rng,
    )
