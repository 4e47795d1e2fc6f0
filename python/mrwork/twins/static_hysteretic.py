"""Static hysteretic model of Kwok et al. (2006)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array


class Theta(NamedTuple):
    """Parameters, in spec order."""

    c: Array
    k: Array
    alpha: Array
    beta: Array
    delta: Array
    x_s: Array
    f0: Array


def rate(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """No state."""
    return state


def force(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0."""
    return p.c * v + p.k * x + p.alpha * jnp.tanh(p.beta * v + p.delta * jnp.tanh(x / p.x_s)) + p.f0
