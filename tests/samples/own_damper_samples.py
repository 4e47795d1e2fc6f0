"""Dampers of a user with the equations of registered models, which must agree with them."""

from __future__ import annotations

from functools import cache
from typing import Any

import jax.numpy as jnp
from jax import Array

import mrwork as mr
from mrwork.dampers import DamperSpec


def static_force(p: Any, state: Array, displacement: Array, velocity: Array) -> Array:
    """f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0."""
    side = jnp.tanh(displacement / p.x_s)
    return p.c * velocity + p.k * displacement + p.alpha * jnp.tanh(p.beta * velocity + p.delta * side) + p.f0


def loop_force(p: Any, state: Array, displacement: Array, velocity: Array) -> Array:
    """f = c v + k (x - x0) + k_w w."""
    return p.c * velocity + p.k * (displacement - p.x0) + p.k_w * state[0]


def loop_rate(p: Any, state: Array, displacement: Array, velocity: Array) -> Array:
    """w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n)."""
    w_n = mr.twins.power(jnp.abs(state[0]), p.n)
    along = p.sigma * jnp.abs(velocity) * jnp.sign(state[0]) * w_n
    return jnp.stack([p.rho * (velocity - along + (p.sigma - 1.0) * velocity * w_n)])


@cache
def own_static() -> DamperSpec:
    """The damper of a user that is static_hysteretic."""
    parameters = {each.name: each for each in mr.damper("static_hysteretic").parameters}
    return mr.own_damper("own_static", parameters=parameters, force=static_force)


@cache
def own_loop() -> DamperSpec:
    """The damper of a user that is normalised_bouc_wen."""
    parameters = {each.name: each for each in mr.damper("normalised_bouc_wen").parameters}
    return mr.own_damper("own_loop", parameters=parameters, force=loop_force, rate=loop_rate, states=1)
