"""Forces of a damper of the user as a function of JAX, with the sub-steps that each candidate wants."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrwork.dampers.simulation import MOST_SUBSTEPS
from mrwork.dampers.spec import DamperSpec
from mrwork.twins.models import twin_of
from mrwork.twins.own_stepping import FINER, N_LEVELS, RESOLUTION, Rows, fastest, force_and_bound
from mrwork.twins.record_arrays import RecordArrays


def force_and_slope(
    spec: DamperSpec, columns: tuple[int, ...], substeps: int, theta: Array, record: RecordArrays
) -> tuple[Array, Array]:
    """Force of one candidate [N], (n_time,), and its derivatives, (n_columns, n_time), which are zero if it failed.

    Sub-steps follow the rule of `own_batches` where `substeps` is 0; without columns there are no derivatives.
    """
    simulated = partial(_simulated, spec, record=record, bounded=False)
    count = jnp.asarray(substeps) if substeps else _count(spec, lax.stop_gradient(theta), record)
    force = simulated(theta, jnp.maximum(count, 1))[0]
    directions = jnp.eye(len(theta))[jnp.array(columns, dtype=int)]
    slopes = jax.vmap(
        lambda direction: jax.jvp(
            lambda row: simulated(row, jnp.maximum(count, 1))[0], (theta,), (direction,)
        )[1]
    )(directions)
    finished = (count > 0) & jnp.all(jnp.isfinite(force)) & jnp.all(jnp.isfinite(slopes))
    return jnp.where(finished, force, jnp.inf), jnp.where(finished, slopes, 0.0)


def _simulated(
    spec: DamperSpec, theta: Array, substeps: Array, *, record: RecordArrays, bounded: bool
) -> tuple[Array, Array]:
    """Force and bound of one candidate."""
    rows = Rows(theta[None], record, record.n_time, substeps)
    force, bound = force_and_bound(rows, spec=spec, n_kept=record.n_time, bounded=bounded)
    return force[0], bound[0]


def _count(spec: DamperSpec, theta: Array, record: RecordArrays) -> Array:
    """Sub-steps that a candidate wants; 0 if they are too many."""
    dt = record.facts[0]
    if not spec.n_states:
        return jnp.asarray(1)
    if twin_of(spec).relaxation is not None:
        command = record.command
        levels = jnp.linspace(jnp.min(command), jnp.max(command), N_LEVELS)
        bound = fastest(Rows(theta[None], record, record.n_time, 1), levels, spec=spec)[0]
        return _power_of_two(bound * dt / RESOLUTION)

    def finer(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        count, _ = carry
        force, bound = _simulated(spec, theta, count, record=record, bounded=True)
        wanted = jnp.where(jnp.all(jnp.isfinite(force)), bound * dt / RESOLUTION, float(FINER) * count)
        # NaN at rest stays NaN however fine the step.
        wanted = jnp.where(jnp.isfinite(force[0]), wanted, 1.0)
        found = _power_of_two(wanted)
        return jnp.where((found > count) | (found == 0), found, count), (found > count)

    count, _ = lax.while_loop(lambda carry: carry[1], finer, (jnp.asarray(1), jnp.asarray(True)))
    return count


def _power_of_two(wanted: Array) -> Array:
    """Smallest power of two that is not below `wanted`; 0 beyond `MOST_SUBSTEPS` and for NaN."""
    counts = 2 ** np.arange(MOST_SUBSTEPS.bit_length())
    place = jnp.searchsorted(counts.astype(float), wanted)
    return jnp.append(counts, 0)[place]
