"""Bingham model of Stanway, Sproston and Stevens (1987)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = f_c tanh(v/v_s) + c0 v + f0."""
    return p.f_c * jnp.tanh(v / p.v_s) + p.c0 * v + p.f0
