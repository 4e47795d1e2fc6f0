"""Hyperbolic tangent model of Gavin (2001)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array


class Theta(NamedTuple):
    """Parameters, in spec order."""

    f_o: Array
    V_r: Array
    d_r: Array
    k0: Array
    c0: Array
    f0: Array


def rate(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """No state."""
    return state


def force(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """f = f_o tanh(v/V_r + x/d_r) + k0 x + c0 v + f0."""
    return p.f_o * jnp.tanh(v / p.V_r + x / p.d_r) + p.k0 * x + p.c0 * v + p.f0
