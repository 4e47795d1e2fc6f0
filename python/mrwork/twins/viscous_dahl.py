"""Viscous and Dahl model of Ikhouane and Dyke (2007)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """w' = rho (v - |v| w)."""
    return jnp.stack([p.rho * (v - jnp.abs(v) * state[0])])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = k_x v + k_w w + f0."""
    return p.k_x * v + p.k_w * state[0] + p.f0
