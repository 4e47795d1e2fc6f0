"""Elasto-visco-plastic model: a spring in series with a core that yields smoothly."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """u' = (rho f_y (v - u) - r q(u)) / q'(u)."""
    u = state[0]
    e = jnp.exp(-2.0 * jnp.abs(u) / p.v_r)
    slope = p.f_y / p.v_r * 4.0 * e / (1.0 + e) ** 2 + p.c
    return jnp.stack([(p.rho * p.f_y * (v - u) - p.r * flow(p, u)) / slope])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = q(u) + k x + f0."""
    return flow(p, state[0]) + p.k * x + p.f0


def flow(p: Parameters, u: Array) -> Array:
    """q(u) = f_y tanh(u/v_r) + c u."""
    return p.f_y * jnp.tanh(u / p.v_r) + p.c * u
