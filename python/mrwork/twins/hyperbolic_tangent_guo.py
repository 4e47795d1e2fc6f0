"""Hyperbolic tangent model of Guo, Yang and Pan (2006)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array


class Theta(NamedTuple):
    """Parameters, in spec order."""

    A1: Array
    A2: Array
    A3: Array
    omega: Array
    f0: Array


def rate(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """No state."""
    return state


def force(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0."""
    shifted = v + p.omega * x
    return p.A1 * jnp.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0
