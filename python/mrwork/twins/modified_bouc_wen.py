"""Modified Bouc-Wen model of Spencer et al. (1997)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters
from mrwork.twins.bouc_wen import loop_rate


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """y', and z' of the loop for the velocity v - y'."""
    y_rate = series_rate(p, state, x, v)
    return jnp.stack([y_rate, loop_rate(p.gamma, p.beta, p.A, p.n, state[1], v - y_rate)])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c1 y' + k1 (x - x0)."""
    return p.c1 * series_rate(p, state, x, v) + p.k1 * (x - p.x0)


def series_rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """y' = (alpha z + c0 v + k0 (x - y)) / (c0 + c1)."""
    y, z = state[0], state[1]
    return (p.alpha * z + p.c0 * v + p.k0 * (x - y)) / (p.c0 + p.c1)
