"""Normalised Bouc-Wen model behind a dead zone of the displacement."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from mrwork.twins._base import Parameters
from mrwork.twins.normalised_bouc_wen import loop_rate

_WIDTH = 2e-4
"""s [m]: the slope of the dead zone changes from 0 to 1 over it."""


def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """w' of the loop for the velocity u."""
    slope, _ = _slope_and_displacement(p.g, x)
    return jnp.stack([loop_rate(p.rho, p.sigma, p.n, state[0], slope * v)])


def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c u + k (d - x0) + k_w w."""
    slope, displacement = _slope_and_displacement(p.g, x)
    return p.c * slope * v + p.k * (displacement - p.x0) + p.k_w * state[0]


def _slope_and_displacement(g: Array, x: Array) -> tuple[Array, Array]:
    """u/v and d, with tanh and cosh by r = exp(-2 g/s) and q = exp(-2 |x|/s), which do not overflow."""
    r, q = jnp.exp(-2.0 * g / _WIDTH), jnp.exp(-2.0 * jnp.abs(x) / _WIDTH)
    above, below = 1.0 + q * r, q + r
    slope = r * (1.0 + q * (q + 2.0 * r)) / (above * below)
    return slope, jnp.sign(x) * (jnp.abs(x) - 0.5 * _WIDTH * jnp.log(above / below))
