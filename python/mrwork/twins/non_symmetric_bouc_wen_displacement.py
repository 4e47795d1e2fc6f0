"""Non-symmetric Bouc-Wen model of Kwok et al., with a velocity shift by the sign of the displacement."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from mrwork.twins.normalised_bouc_wen import loop_rate


class Theta(NamedTuple):
    """Parameters, in spec order."""

    c: Array
    k: Array
    x0: Array
    k_w: Array
    rho: Array
    sigma: Array
    n: Array
    mu: Array
    share: Array
    x_s: Array


def rate(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """w' of the loop for the velocity v - mu s, s = tanh(x/x_s)."""
    shifted = v - p.mu * jnp.tanh(x / p.x_s)
    return jnp.stack([loop_rate(p.rho, p.sigma, p.n, state[0], shifted)])


def force(p: Theta, state: Array, x: Array, v: Array) -> Array:
    """f = c (v - share mu s) + k (x - x0) + k_w w."""
    shifted = v - p.share * p.mu * jnp.tanh(x / p.x_s)
    return p.c * shifted + p.k * (x - p.x0) + p.k_w * state[0]
