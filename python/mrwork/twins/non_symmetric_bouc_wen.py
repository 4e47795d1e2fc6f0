"""Non-symmetric Bouc-Wen model of Kwok et al., with a velocity shift by the sign of its state."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters
from mrwork.twins.normalised_bouc_wen import loop_rate


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """w' of the loop for the velocity v - mu s, s = tanh(w/w_s)."""
    shifted = v - p.mu * jnp.tanh(state[0] / p.w_s)
    return jnp.stack([loop_rate(p.rho, p.sigma, p.n, state[0], shifted)])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c (v - share mu s) + k (x - x0) + k_w w."""
    shifted = v - p.share * p.mu * jnp.tanh(state[0] / p.w_s)
    return p.c * shifted + p.k * (x - p.x0) + p.k_w * state[0]
