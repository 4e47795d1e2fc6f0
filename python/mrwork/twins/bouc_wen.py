"""Bouc-Wen model in the form of Spencer et al. (1997)."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters, power


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """z' of the loop for the velocity v."""
    return jnp.stack([loop_rate(p.gamma, p.beta, p.A, p.n, state[0], v)])


def loop_rate(gamma: Array, beta: Array, A: Array, n: Array, z: Array, v: Array) -> Array:
    """z' = -gamma |v| z |z|^(n-1) - beta v |z|^n + A v."""
    z_n = power(jnp.abs(z), n)
    return -gamma * jnp.abs(v) * jnp.sign(z) * z_n - beta * v * z_n + A * v


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c0 v + k0 (x - x0) + alpha z."""
    return p.c0 * v + p.k0 * (x - p.x0) + p.alpha * state[0]
