"""Maxwell element: a spring in series with a dashpot."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """z' = v - z/tau."""
    return jnp.stack([v - state[0] / p.tau])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = k z + c v + f0."""
    return p.k * state[0] + p.c * v + p.f0
