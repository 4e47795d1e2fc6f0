"""Equations of a damper under a motion, with the stepping rule of the Rust core, for a batch of candidates.

The motion follows the splines of the core. Sub-steps may be counted at run time; as a number of Python the loop over
them has derivatives in reverse mode, too.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mrwork.dampers.spec import DamperSpec
from mrwork.twins.models import left_of_lag, parameters_at, twin_of
from mrwork.twins.record_arrays import RecordArrays, motion_at

# Largest product of a step and the fastest relaxation, as RESOLUTION of `integrate.rs`.
RESOLUTION = 1.4
# Commands at which a relaxation is asked for, as COMMAND_LEVELS of `loading.rs` and `groups.rs`.
N_LEVELS = 9
# A run that is not finite is tried again with so many times the sub-steps.
FINER = 4
# The spectral radius is at most ||J^8||^(1/8), which units of the states hardly change.
_SQUARINGS = 3


class Rows(NamedTuple):
    """Candidates, (n_batch, n_params), the record that they are simulated under, and its samples but for padding."""

    theta: Any
    record: RecordArrays
    n_time: Any
    substeps: Any


def _kept(rows: Rows, *, spec: DamperSpec, n_kept: int) -> tuple[Array, Array | None]:
    """States at the samples, (n_kept, n_batch, n_states), and what the coils receive, (n_kept, n_batch) or `None`."""
    theta, (splines, facts, command), n_time, substeps = rows
    n_batch, dt = len(theta), facts[0]
    varies = len(command) > 1
    lagged = varies and spec.n_rates > 0
    if not (spec.n_states or lagged):
        received = jnp.broadcast_to(command[:, None], (n_kept, n_batch)) if varies else None
        return jnp.zeros((n_kept, n_batch, 0)), received
    h = dt / substeps
    rate = jax.vmap(twin_of(spec).rate, in_axes=(0, 0, None, None))
    steady = None if varies else _parameters(spec, theta, jnp.broadcast_to(command, (n_batch,)))

    def interval(k: Array, carry: tuple[Array, ...]) -> tuple[Array, ...]:
        state, at_coil, states, received = carry
        states, received = states.at[k].set(state), received.at[k].set(at_coil) if varies else received
        held = command[k] if varies else command[0]

        def at(time: Array) -> Any:
            if steady is not None:
                return steady
            left = left_of_lag(spec, theta, at_coil, held, time) if lagged else 0.0
            return _parameters(spec, theta, held + (at_coil - held) * left)

        def substep(j: Any, state: Array) -> Any:
            (x0, v0), (x1, v1), (x2, v2) = (
                motion_at(splines[k], (j + share) / substeps) for share in (0.0, 0.5, 1.0)
            )
            middle = at((j + 0.5) * h)
            first = rate(at(j * h), state, x0, v0)
            second = rate(middle, state + 0.5 * h * first, x1, v1)
            third = rate(middle, state + 0.5 * h * second, x1, v1)
            fourth = rate(at((j + 1.0) * h), state + h * third, x2, v2)
            return state + h / 6.0 * (first + 2.0 * (second + third) + fourth)

        if spec.n_states:
            state = lax.fori_loop(0, substeps, substep, state)
        # Without a lag the coil has the command at once, also the command of the next sample.
        after = (
            held + (at_coil - held) * left_of_lag(spec, theta, at_coil, held, dt)
            if lagged
            else jnp.broadcast_to(command[k + 1] if varies else held, (n_batch,))
        )
        return state, after, states, received

    start = (
        jnp.zeros((n_batch, spec.n_states)),
        jnp.broadcast_to(command[0], (n_batch,)),
        jnp.zeros((n_kept, n_batch, spec.n_states)),
        jnp.zeros((n_kept if varies else 0, n_batch)),
    )
    state, at_coil, states, received = lax.fori_loop(0, n_time - 1, interval, start)
    states = states.at[n_time - 1].set(state)
    return states, received.at[n_time - 1].set(at_coil) if varies else None


def simulate(spec: DamperSpec, theta: Array, record: RecordArrays, substeps: Array | int) -> Array:
    """Force of one candidate [N], (n_time,); states begin at zero, the current in the coil at the first command."""
    return simulate_one(spec, theta, record, substeps, bounded=False)[0]


def simulate_one(
    spec: DamperSpec, theta: Array, record: RecordArrays, substeps: Array | int, *, bounded: bool
) -> tuple[Array, Array]:
    """Force of one candidate [N], (n_time,), and its bound [1/s], see `force_and_bound`."""
    rows = Rows(theta[None], record, record.n_time, substeps)
    force, bound = force_and_bound(rows, spec=spec, n_kept=record.n_time, bounded=bounded)
    return force[0], bound[0]


def whole_steps(wanted: Any, most: int, xp: Any = np) -> Any:
    """Smallest power of two that is not below `wanted`; 0 beyond `most` and for NaN."""
    counts = 2 ** np.arange(most.bit_length())
    return xp.append(counts, 0)[xp.searchsorted(counts.astype(np.float64), wanted)]


def fastest(rows: Rows, levels: Any, *, spec: DamperSpec) -> Array:
    """Largest relaxation that the user gives [1/s], over the motion and these commands, shape (n_batch,)."""
    relaxation = twin_of(spec).relaxation
    assert relaxation is not None
    splines = rows.record.splines
    motions = jnp.concatenate(
        [rows.record.samples(rows.n_time, len(splines) + 1), jnp.stack(motion_at(splines.T, 0.5), axis=1)]
    )

    def at_level(row: Array, level: Array) -> Array:
        p = parameters_at(spec, row, level)
        return jnp.max(jax.vmap(lambda motion: relaxation(p, motion[0], motion[1]))(motions))

    relaxations = jax.vmap(jax.vmap(at_level, in_axes=(None, 0)), in_axes=(0, None))(rows.theta, levels)
    return jnp.max(relaxations, axis=1)


def _parameters(spec: DamperSpec, theta: Array, received: Array) -> Any:
    return jax.vmap(partial(parameters_at, spec))(theta, received)


def radius_of(rate: Callable[..., Array], p: Any, state: Array, x: Array, v: Array) -> Array:
    """Bound of the spectral radius of the rate in the states [1/s]."""
    slope = jax.jacfwd(lambda state: rate(p, state, x, v))(state)
    if len(state) == 1:
        return jnp.abs(slope[0, 0])
    # So that powers do not overflow.
    size = jnp.max(jnp.abs(slope)) + 1e-300
    power = slope / size
    for _ in range(_SQUARINGS):
        power = power @ power
    largest: Array = size * jnp.linalg.norm(power) ** (0.5**_SQUARINGS)
    return largest


def force_and_bound(rows: Rows, *, spec: DamperSpec, n_kept: int, bounded: bool) -> tuple[Array, Array]:
    """Forces, (n_batch, n_kept), and the bound of each row [1/s], zero if it is not wanted; see `radius_of`."""
    twin, theta = twin_of(spec), rows.theta
    states, received = _kept(rows, spec=spec, n_kept=n_kept)
    samples = rows.record.samples(rows.n_time, n_kept)

    def everywhere(equation: Callable[..., Array]) -> Array:
        """An equation at all samples of all rows, shape (n_batch, n_kept): XLA makes vectors of the last axis alone."""

        def of_row(row: Array, states: Array, received: Array | None) -> Array:
            if received is None:
                p, of_sample = parameters_at(spec, row, rows.record.command[0]), None
            else:
                p, of_sample = jax.vmap(partial(parameters_at, spec, row))(received), 0
            result: Array = jax.vmap(equation, in_axes=(of_sample, 0, 0, 0))(p, states, *samples.T)
            return result

        result: Array = jax.vmap(of_row, in_axes=(0, 1, 1))(theta, states, received)
        return result

    force = everywhere(twin.force)
    if not bounded:
        return force, jnp.zeros(len(theta))

    counted = jnp.arange(n_kept) < rows.n_time
    return force, jnp.max(jnp.where(counted, everywhere(partial(radius_of, twin.rate)), 0.0), axis=1)
