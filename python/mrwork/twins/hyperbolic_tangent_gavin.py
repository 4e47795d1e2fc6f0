"""Hyperbolic tangent model of Gavin (2001)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = f_o tanh(v/V_r + x/d_r) + k0 x + c0 v + f0."""
    return p.f_o * jnp.tanh(v / p.V_r + x / p.d_r) + p.k0 * x + p.c0 * v + p.f0
