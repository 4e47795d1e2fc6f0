"""The Rosenbrock steps for any damper, the Jacobian by forward differentiation of its twin."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.dampers import DamperSpec, LoadingHistory
from mrwork.twins import twin_of
from studies.stiff_stepping.batch import motion_table
from studies.stiff_stepping.steppers import ENDS, GAMMA_ROS2

Rate = Callable[[Array, Array], Array]


def ros2(rate: Rate, state: Array, motion: Array, h: float) -> Array:
    """Verwer et al. 1999; motion has rows x, v, v' at the start and the end of the step."""
    start, end = motion[0], motion[1]
    by_time = jax.jvp(lambda m: rate(state, m), (start,), (_moving(start),))[1]
    jacobian = jax.jacfwd(rate)(state, start)
    solve = jnp.linalg.inv(jnp.eye(len(state)) - h * GAMMA_ROS2 * jacobian)
    ht = h * GAMMA_ROS2 * by_time
    first = solve @ (h * (rate(state, start) + ht))
    second = solve @ (h * (rate(state + first, end) - ht) - 2.0 * first)
    return state + 1.5 * first + 0.5 * second


def rodas3(rate: Rate, state: Array, motion: Array, h: float) -> Array:
    """RODAS3 of Sandu et al. 1997."""
    start, end = motion[0], motion[1]
    by_time = jax.jvp(lambda m: rate(state, m), (start,), (_moving(start),))[1]
    jacobian = jax.jacfwd(rate)(state, start)
    hg = 0.5 * h
    solve = jnp.linalg.inv(jnp.eye(len(state)) - hg * jacobian)
    here = rate(state, start)
    first = solve @ (hg * (here + 0.5 * h * by_time))
    second = solve @ (hg * (here + 1.5 * h * by_time) + 2.0 * first)
    state = state + 2.0 * first
    past = 0.5 * (first - second)
    third = solve @ (hg * rate(state, end) + past)
    state = state + third
    return state + solve @ (hg * rate(state, end) + past - 4.0 / 3.0 * third)


def _moving(motion: Array) -> Array:
    return jnp.array([motion[1], motion[2], 0.0])


STEPS = {"ros2": ros2, "rodas3": rodas3}


def twin_force(method: str, spec: DamperSpec, theta: Array, history: LoadingHistory, substeps: int) -> Array:
    """Force [N] of a damper from rest, shape (n_time - 1,): without the last sample."""
    table = jnp.asarray(motion_table(history, substeps, ENDS))
    return _run(STEPS[method], spec, theta, table.reshape(*table.shape[:2], 3, 3), history.dt)


@partial(jax.jit, static_argnums=(0, 1))
def _run(step: Callable[..., Array], spec: DamperSpec, theta: Array, table: Array, dt: float) -> Array:
    twin = twin_of(spec)
    p = twin.Theta(*theta)
    h = dt / table.shape[1]

    def sample(state: Array, motions: Array) -> tuple[Array, Array]:
        force = twin.force(p, state, motions[0, 0, 0], motions[0, 0, 1])

        def substep(state: Array, motion: Array) -> tuple[Array, None]:
            return step(lambda state, m: twin.rate(p, state, m[0], m[1]), state, motion, h), None

        return jax.lax.scan(substep, state, motions)[0], force

    return jax.lax.scan(sample, jnp.zeros(spec.n_states), table)[1]
