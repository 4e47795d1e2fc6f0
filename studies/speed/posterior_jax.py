"""The density of `study.py posterior` on the JAX twin, compiled for batches."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrwork.twins import twin_of
from mrwork.uncertainty import Target
from studies.speed.jax_peer import JaxVariant
from studies.speed.posterior_job import Density, PosteriorJob
from studies.speed.twin_peer import step

# XLA compiles for batches, without a split over devices.
VARIANTS = (
    JaxVariant(layout="arrays", unroll=1, split=False),
    JaxVariant(layout="arrays", unroll=2, split=False),
    JaxVariant(layout="arrays", unroll=4, split=False),
    JaxVariant(layout="arrays", unroll=2, vector_bits=512, split=False),
)


def density_on_twin(job: PosteriorJob, variant: JaxVariant) -> Density:
    """The target on the twin with the sub-steps that the start has, compiled on the first call."""
    (run,) = job.target.objective.misfits(job.start[None])
    density = partial(_scan_log_posterior, job.target, int(run.substeps[0]), variant.unroll)
    compiled = jax.jit(density, compiler_options=variant.options)
    return lambda position: np.asarray(compiled(position))


def _scan_log_posterior(target: Target, substeps: int, unroll: int, position: Array) -> Array:
    """Log posterior of rows, (n_batch, n_dim), by one scan that carries states and misfits of all of them."""
    objective, space = target.objective, target.space
    (test,), (history,) = objective.tests, objective.histories
    twin = twin_of(objective.spec)
    values, inside = space.values(position)
    p = twin.Theta(*values[:, : space.n_params].T)
    h = test.dt / substeps
    stages = jnp.asarray(history.stages(substeps))
    counted = jnp.arange(test.n_time) >= test.n_settle

    def squared(state: Array, motion: Array, measured: Array, counts: Array) -> Array:
        return jnp.where(counts, jnp.square(twin.force(p, state, motion[0], motion[1]) - measured), 0.0)

    def interval(
        carry: tuple[Array, Array], inputs: tuple[Array, Array, Array]
    ) -> tuple[tuple[Array, Array], None]:
        state, total = carry
        motions, measured, counts = inputs
        for begin in range(0, 2 * substeps, 2):
            state = step(twin, p, state, motions[begin : begin + 3], h)
        return (state, total + squared(state, motions[-1], measured, counts)), None

    rest = jnp.zeros((objective.spec.n_states, len(position)))
    begin = rest, squared(rest, stages[0, 0], jnp.asarray(test.force[0]), counted[0])
    inputs = stages, jnp.asarray(test.force[1:]), counted[1:]
    (_, total), _ = lax.scan(interval, begin, inputs, unroll=unroll)
    sigma = values[:, space.n_params]
    likelihood = -0.5 * total / (target.deviations[0] * sigma) ** 2 - objective.n_time * (
        jnp.log(sigma) + 0.5 * jnp.log(2.0 * jnp.pi)
    )
    density = space.log_prior(values) + target.temper * likelihood
    return jnp.where(inside & jnp.isfinite(density), density, -jnp.inf)
