"""Equations of a damper under a motion, with the stepping rule of the Rust core.

The motion follows the splines of the core. Sub-steps may be counted at run time; as a number of Python the loop over
them has derivatives in reverse mode, too.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrwork.dampers.spec import DamperSpec
from mrwork.twins.model_twins import left_of_lag, parameters_at, twin_of
from mrwork.twins.record_arrays import RecordArrays, motion_at


def simulate(spec: DamperSpec, theta: Array, record: RecordArrays, substeps: Array | int) -> Array:
    """Force of one candidate [N], (n_time,); states begin at zero, the current in the coil at the first command."""
    states, received = _kept(spec, theta, record, substeps)
    p = partial(parameters_at, spec, theta)
    at, of_sample = (p(record.command[0]), None) if received is None else (jax.vmap(p)(received), 0)
    force: Array = jax.vmap(twin_of(spec).force, in_axes=(of_sample, 0, 0, 0))(at, states, *record.samples.T)
    return force


def _kept(
    spec: DamperSpec, theta: Array, record: RecordArrays, substeps: Array | int
) -> tuple[Array, Array | None]:
    """States at the samples, (n_time, n_states), and what the coil receives, (n_time,) or `None`."""
    (splines, facts, command), n_time = record, record.n_time
    dt, varies = facts[0], len(command) > 1
    lagged = varies and spec.n_rates > 0
    if not (spec.n_states or lagged):
        return jnp.zeros((n_time, 0)), command if varies else None
    h, rate = dt / substeps, twin_of(spec).rate
    steady = None if varies else parameters_at(spec, theta, command[0])

    def interval(k: Array, carry: tuple[Array, ...]) -> tuple[Array, ...]:
        state, at_coil, states, received = carry
        states, received = states.at[k].set(state), received.at[k].set(at_coil) if varies else received
        held = command[k] if varies else command[0]

        def at(time: Array) -> Any:
            if steady is not None:
                return steady
            left = left_of_lag(spec, theta, at_coil, held, time) if lagged else 0.0
            return parameters_at(spec, theta, held + (at_coil - held) * left)

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
        after = command[k + 1] if varies else held
        if lagged:
            after = held + (at_coil - held) * left_of_lag(spec, theta, at_coil, held, dt)
        return state, after, states, received

    start = (
        jnp.zeros(spec.n_states),
        command[0],
        jnp.zeros((n_time, spec.n_states)),
        jnp.zeros(n_time if varies else 0),
    )
    state, at_coil, states, received = lax.fori_loop(0, n_time - 1, interval, start)
    states = states.at[n_time - 1].set(state)
    return states, received.at[n_time - 1].set(at_coil) if varies else None
