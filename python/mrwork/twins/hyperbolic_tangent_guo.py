"""Hyperbolic tangent model of Guo, Yang and Pan (2006)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0."""
    shifted = v + p.omega * x
    return p.A1 * jnp.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0
