"""Modified LuGre model of Jimenez and Alvarez-Icaza (2005)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """z' = v - a0 |v| z."""
    return jnp.stack([v - p.a0 * jnp.abs(v) * state[0]])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = sigma_0 z + sigma_1 z' + sigma_2 v + f0."""
    return p.sigma_0 * state[0] + p.sigma_1 * rate(p, state, x, v)[0] + p.sigma_2 * v + p.f0
