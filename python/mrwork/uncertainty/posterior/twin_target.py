"""The density that is sampled, once more on the JAX twin, with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork.errors import SettingError
from mrwork.twins._base import simulate
from mrwork.uncertainty.posterior.target import Target

LogDensity = Callable[[Array], Array]


def twin_log_posterior(target: Target, substeps: tuple[int, ...]) -> LogDensity:
    """Log posterior of one position, (n_dim,), as `target` has it, with fixed sub-steps for each test.

    Outside the box, and where the twin leaves the finite numbers, it is -inf.

    Raises
    ------
    SettingError
        Where the target has an observation model, nuisance parameters or a noise that is not differentiable.
    """
    objective, space = target.objective, target.space
    log_densities: Any = target.noise.log_densities
    if not (target.noise.differentiable and objective.is_direct):
        raise SettingError(
            "the twin has the likelihood of a plain simulated force with iid, student_t, ar1 or amplitude noise; "
            "sample this target by the ensemble alone"
        )
    stages = [
        jnp.asarray(history.stages(count))
        for history, count in zip(objective.histories, substeps, strict=True)
    ]
    measured = [jnp.asarray(each.measured) for each in objective.compared]

    def log_posterior(position: Array) -> Array:
        values, inside = space.values(position)
        theta, noise = values[: space.n_params], values[space.n_params :]
        total = jnp.zeros(())
        for test, motions, force, deviation in zip(
            objective.tests, stages, measured, target.deviations, strict=True
        ):
            found = simulate(objective.spec, theta, motions, test.dt, _command(target, test))[test.n_settle :]
            about_mean = (found - jnp.mean(force)) / deviation
            residual = (found - force) / deviation
            total = total + jnp.sum(log_densities(residual[None], about_mean[None], noise[None]))
        density = space.log_prior(values) + target.temper * total
        return jnp.where(inside & jnp.isfinite(density), density, -jnp.inf)

    return log_posterior


def substeps_at(target: Target, theta: Any) -> tuple[int, ...]:
    """Sub-steps that the stepping rule gives a candidate, (n_params,), on each test."""
    runs = target.objective.misfits(np.asarray(theta)[None])
    return tuple(max(1, int(run.substeps[0])) for run in runs)


def _command(target: Target, test: Any) -> float:
    current = target.objective.spec.current
    if current is None:
        return 0.0
    return float(test.current if current.unit == "A" else test.voltage)
