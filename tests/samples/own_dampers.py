"""Dampers of a user: models of the package written again, also as a file for the command line."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

import mrwork as mr

GUO = mr.damper("hyperbolic_tangent_guo")
LOOP = mr.damper("normalised_bouc_wen")
STATIC = mr.damper("static_hysteretic")


def static_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0."""
    side = jnp.tanh(displacement / p.x_s)
    return p.c * velocity + p.k * displacement + p.alpha * jnp.tanh(p.beta * velocity + p.delta * side) + p.f0


def slide(p: Any, velocity: Any, displacement: Any) -> Any:
    return velocity + p.omega * displacement


def guo_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0."""
    shifted = slide(p, velocity, displacement)
    return p.A1 * jnp.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0


def loop_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = c v + k (x - x0) + k_w w."""
    return p.c * velocity + p.k * (displacement - p.x0) + p.k_w * state[0]


def loop_rate(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    w, v = state[0], velocity
    w_n = mr.twins.power(jnp.abs(w), p.n)
    return jnp.stack([p.rho * (v - p.sigma * jnp.abs(v) * jnp.sign(w) * w_n + (p.sigma - 1.0) * v * w_n)])


def loop_relaxation(p: Any, displacement: Any, velocity: Any) -> Any:
    """That of the core where sigma is 1/2, while the loop loads."""
    return p.rho * p.n * jnp.abs(velocity)


guo = mr.own_damper("my_guo", parameters={each.name: each for each in GUO.parameters}, force=guo_force)
static = mr.own_damper(
    "my_static", parameters={each.name: each for each in STATIC.parameters}, force=static_force
)
loop = mr.own_damper(
    "my_loop",
    parameters={each.name: each for each in LOOP.parameters},
    force=loop_force,
    rate=loop_rate,
    states=1,
    spring=("k", "x0"),
)
bounded_loop = mr.own_damper(
    "my_bounded_loop",
    parameters={each.name: each for each in LOOP.parameters},
    force=loop_force,
    rate=loop_rate,
    states=1,
    relaxation=loop_relaxation,
)
