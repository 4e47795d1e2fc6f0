"""Normalised Bouc-Wen model of Ikhouane and Rodellar."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters, power


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """w' of the loop for the velocity v."""
    return jnp.stack([loop_rate(p.rho, p.sigma, p.n, state[0], v)])


def loop_rate(rho: Array, sigma: Array, n: Array, w: Array, v: Array) -> Array:
    """w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n)."""
    w_n = power(jnp.abs(w), n)
    return rho * (v - sigma * jnp.abs(v) * jnp.sign(w) * w_n + (sigma - 1.0) * v * w_n)


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c v + k (x - x0) + k_w w."""
    return p.c * v + p.k * (x - p.x0) + p.k_w * state[0]
