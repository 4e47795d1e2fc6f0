"""The density of `study.py posterior` on the JAX twin, compiled for batches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrwork.twins import twin_of
from mrwork.uncertainty import Target, substeps_at, twin_log_posterior
from studies.speed.posterior_job import PosteriorJob, Rows


@dataclass(frozen=True, slots=True, kw_only=True)
class JaxVariant:
    """A way to lay out the twin: `unroll` 0 is `vmap` of all that it keeps, else a scan that keeps the misfit alone."""

    unroll: int = 0
    vector_bits: int = 0

    def describe(self) -> str:
        """In a few words, for the table."""
        layout = f"scan of arrays, misfit only, unroll {self.unroll}" if self.unroll else "vmap(simulate)"
        return f"jit, {layout}{f', {self.vector_bits}-bit vectors' if self.vector_bits else ''}"


JAX_VARIANTS = (
    JaxVariant(),
    JaxVariant(unroll=1),
    JaxVariant(unroll=2),
    JaxVariant(unroll=4),
    JaxVariant(unroll=2, vector_bits=512),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JaxTarget:
    """The target on the twin, compiled for batches, with the sub-steps that the start has."""

    compiled: jax.stages.Wrapped

    @classmethod
    def of(cls, job: PosteriorJob, variant: JaxVariant) -> JaxTarget:
        """Compile on the first call."""
        substeps = substeps_at(job.target, job.start)
        batched: Callable[[Array], Array]
        if variant.unroll:
            batched = partial(_scan_log_posterior, job.target, substeps[0], variant.unroll)
        else:
            batched = jax.vmap(twin_log_posterior(job.target, substeps))
        options: dict[str, str | bool] | None = None
        if variant.vector_bits:
            options = {"xla_cpu_prefer_vector_width": str(variant.vector_bits)}
        return cls(compiled=jax.jit(batched, compiler_options=options))

    def __call__(self, position: Rows) -> Rows:
        """Log posterior of each row."""
        return np.asarray(self.compiled(position))


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
            (x0, v0), (x1, v1), (x2, v2) = motions[begin], motions[begin + 1], motions[begin + 2]
            first = twin.rate(p, state, x0, v0)
            second = twin.rate(p, state + 0.5 * h * first, x1, v1)
            third = twin.rate(p, state + 0.5 * h * second, x1, v1)
            fourth = twin.rate(p, state + h * third, x2, v2)
            state = state + h / 6.0 * (first + 2.0 * (second + third) + fourth)
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
