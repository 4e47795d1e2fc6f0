"""What all twins share: finding one, checking it against the Rust spec, running it through a history."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any, Protocol

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.errors import UnknownNameError
from mrwork.spec import DamperSpec

# The physics is double precision in Rust; a twin in single precision would not be one.
jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call] # jax leaves it unannotated


class Twin(Protocol):
    """A damper model in JAX."""

    Theta: Any

    def rate(self, p: Any, state: Array, x: Array, v: Array) -> Array:
        """Time derivative of the states, shape (n_states,)."""

    def force(self, p: Any, state: Array, x: Array, v: Array) -> Array:
        """Force [N]."""


@cache
def twin_of(spec: DamperSpec) -> Twin:
    """Return the twin of a model.

    Raises
    ------
    UnknownNameError
        Where the model has no twin, or its parameters differ from the spec in name or order.
    """
    try:
        twin: Any = import_module(f"mrwork.twins.{spec.name}")
    except ModuleNotFoundError as error:
        raise UnknownNameError(f"{spec.name} has no JAX twin; write mrwork/twins/{spec.name}.py") from error
    if twin.Theta._fields != spec.names:
        raise UnknownNameError(
            f"the twin of {spec.name} has parameters {twin.Theta._fields}, the spec has {spec.names}; "
            "give them the same names in the same order"
        )
    found: Twin = twin
    return found


def power(base: Array, exponent: Array) -> Array:
    """`base ** exponent` for base >= 0 and exponent >= 1, with finite derivatives at zero."""
    positive = base > 0.0
    return jnp.where(positive, jnp.where(positive, base, 1.0) ** exponent, 0.0)


def simulate(spec: DamperSpec, theta: Array, stages: Array, dt: float) -> Array:
    """Force of a damper from rest, by the stepping rule of the Rust core.

    Parameters
    ----------
    theta
        Parameters in spec order, shape (n_params,).
    stages
        Displacement [m] and velocity [m/s] at the stage times, shape (n_time - 1, 2 substeps + 1, 2),
        from `_rust.LoadingHistory.stages`.
    dt
        Sampling step [s].

    Returns
    -------
    Array
        Force [N], shape (n_time,).
    """
    twin = twin_of(spec)
    p = twin.Theta(*(theta[index] for index in range(len(spec.parameters))))
    substeps = (stages.shape[1] - 1) // 2
    samples = jnp.concatenate([stages[:, 0, :], stages[-1:, -1, :]])
    if spec.n_states == 0:
        no_state = jnp.zeros(0)
        return jax.vmap(lambda motion: twin.force(p, no_state, motion[0], motion[1]))(samples)
    h = dt / substeps

    def rate(state: Array, motion: Array) -> Array:
        return twin.rate(p, state, motion[0], motion[1])

    def substep(state: Array, motions: Array) -> Array:
        first = rate(state, motions[0])
        second = rate(state + 0.5 * h * first, motions[1])
        third = rate(state + 0.5 * h * second, motions[1])
        fourth = rate(state + h * third, motions[2])
        return state + h / 6.0 * (first + 2.0 * (second + third) + fourth)

    def record(state: Array, motions: Array) -> tuple[Array, Array]:
        return substep(state, motions), state

    # One scan over all sub-steps, each with the motion at its start, middle and end.
    motions = jnp.stack([stages[:, :-1:2], stages[:, 1::2], stages[:, 2::2]], axis=2)
    last, states = jax.lax.scan(record, jnp.zeros(spec.n_states), motions.reshape(-1, 3, 2))
    states = jnp.concatenate([states[::substeps], last[None]])
    return jax.vmap(lambda state, motion: twin.force(p, state, motion[0], motion[1]))(states, samples)
