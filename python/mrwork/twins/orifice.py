"""Orifice damper: a loss of head that grows with the square of the velocity."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = d |v| v + c v + f0."""
    return p.d * jnp.abs(v) * v + p.c * v + p.f0
