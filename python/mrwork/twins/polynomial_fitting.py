"""Polynomial-fitting model: sigmoid mean and Gaussian thickness of the loop over velocity."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = F_m + tanh(x/x_s) T/2, with 2/(1 + exp(-y)) - 1 = tanh(y/2) in F_m."""
    mean = p.a * jnp.tanh(0.5 * p.b * (v - p.v0)) + p.c * v + p.f0
    thickness = p.h * jnp.exp(-0.5 * ((v - p.v1) / p.w) ** 2)
    return mean + 0.5 * jnp.tanh(x / p.x_s) * thickness
