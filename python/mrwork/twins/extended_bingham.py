"""Extended Bingham model of Gamota and Filisko."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """x_b' = sgn(q) max(|q| - f_c, 0) / c0, x_k' = (a (x - x_b - x_k) - x_k) / tau."""
    q = spring_force(p, state, x)
    flowing = jnp.sign(q) * jnp.maximum(jnp.abs(q) - p.f_c, 0.0)
    return jnp.stack([flowing / p.c0, (p.a * (x - state[0] - state[1]) - state[1]) / p.tau])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = q + f0."""
    return spring_force(p, state, x) + p.f0


def spring_force(p: Parameters, state: Array, x: Array) -> Array:
    """q = rho f_c (x - x_b - x_k)."""
    return p.rho * p.f_c * (x - state[0] - state[1])
