"""Bingham model of Stanway, Sproston and Stevens (1987)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array


class Theta(NamedTuple):
    """Parameters, in spec order."""

    f_c: Array
    v_s: Array
    c0: Array
    f0: Array


def rate(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """No state."""
    return state


def force(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """f = f_c tanh(v/v_s) + c0 v + f0."""
    return p.f_c * jnp.tanh(v / p.v_s) + p.c0 * v + p.f0
