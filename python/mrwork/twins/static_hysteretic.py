"""Static hysteretic model of Kwok et al. (2006)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0."""
    return p.c * v + p.k * x + p.alpha * jnp.tanh(p.beta * v + p.delta * jnp.tanh(x / p.x_s)) + p.f0
