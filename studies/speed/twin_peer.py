"""The workload of any model in jax: its own twin, jitted, in float64, for the whole batch at once.

In two forms. `jax` is `vmap` of `simulate`, which refinement runs too; it keeps every state and force. `jax_scan`
takes the twin's rate and force alone, in one scan that keeps nothing but the misfit, as our kernel does.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrwork.twins import simulate, twin_of
from studies.speed.jax_peer import (
    JaxVariant,
    as_arrays,
    compiled_run,
    on_one_device,
    unrolled_further,
    wider,
)
from studies.speed.timing import TimedPeer
from studies.speed.workload import SUBSTEPS, ModelWorkload, Run


def twins_of(workload: ModelWorkload) -> dict[str, TimedPeer[JaxVariant]]:
    """The twin in two forms: `jax`, as users run it, and `jax_scan`, rewritten for this one purpose."""
    return {
        "jax": TimedPeer(
            start=JaxVariant(layout="simulate"),
            changes=(wider, on_one_device),
            prepare=partial(prepare, workload),
        ),
        "jax_scan": TimedPeer(
            start=JaxVariant(layout="vmap", unroll=2),
            changes=(wider, as_arrays, unrolled_further, unrolled_further, on_one_device),
            prepare=partial(prepare, workload),
        ),
    }


def prepare(workload: ModelWorkload, variant: JaxVariant) -> Run:
    """Place the inputs, compile `variant` for their shapes and return the call to be timed."""
    spec, dt = workload.spec, workload.loading.dt
    twin = twin_of(spec)
    h = dt / SUBSTEPS

    def of_history(theta: Array, stages: Array, measured: Array) -> Array:
        return jnp.sum(jnp.square(simulate(spec, theta, stages, dt) - measured))

    def in_one_scan(theta: Array, stages: Array, measured: Array) -> Array:
        # Candidates, if there are several, lie along the last axis of every array.
        p = twin.Theta(*theta)

        def squared(state: Array, motion: Array, measured: Array) -> Array:
            return jnp.square(twin.force(p, state, motion[0], motion[1]) - measured)

        def interval(
            carry: tuple[Array, Array], inputs: tuple[Array, Array]
        ) -> tuple[tuple[Array, Array], None]:
            state, total = carry
            motions, measured = inputs
            for start in range(0, 2 * SUBSTEPS if spec.n_states else 0, 2):
                state = step(twin, p, state, motions[start : start + 3], h)
            return (state, total + squared(state, motions[-1], measured)), None

        rest = jnp.zeros((spec.n_states, *theta.shape[1:]))
        begin = rest, squared(rest, stages[0, 0], measured[0])
        (_, total), _ = lax.scan(interval, begin, (stages, measured[1:]), unroll=variant.unroll)
        return total

    layouts: dict[str, Callable[[Array, Array, Array], Array]] = {
        "simulate": jax.vmap(of_history, in_axes=(0, None, None)),
        "vmap": jax.vmap(in_one_scan, in_axes=(0, None, None)),
        "arrays": lambda theta, stages, measured: in_one_scan(theta.T, stages, measured),
    }
    return compiled_run(variant, layouts[variant.layout], workload.theta, workload.stages, workload.force)


def step(twin: Any, p: Any, state: Array, motions: Array, h: float) -> Array:
    """The state of a twin after one Runge-Kutta step, from the motion at its start, middle and end."""
    (x0, v0), (x1, v1), (x2, v2) = motions[0], motions[1], motions[2]
    first = twin.rate(p, state, x0, v0)
    second = twin.rate(p, state + 0.5 * h * first, x1, v1)
    third = twin.rate(p, state + 0.5 * h * second, x1, v1)
    fourth = twin.rate(p, state + h * third, x2, v2)
    after: Array = state + h / 6.0 * (first + 2.0 * (second + third) + fourth)
    return after
