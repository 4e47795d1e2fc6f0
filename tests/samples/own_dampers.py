"""Dampers of a user: models of the package written again, also as a file for the command line."""

from typing import Any

import numpy as np

import mrwork as mr

GUO = mr.damper("hyperbolic_tangent_guo")
LOOP = mr.damper("normalised_bouc_wen")
STATIC = mr.damper("static_hysteretic")


def static_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0."""
    side = np.tanh(displacement / p.x_s)
    return p.c * velocity + p.k * displacement + p.alpha * np.tanh(p.beta * velocity + p.delta * side) + p.f0


def slide(p: Any, velocity: Any, displacement: Any) -> Any:
    return velocity + p.omega * displacement


def guo_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0."""
    shifted = slide(p, velocity, displacement)
    return p.A1 * np.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0


def loop_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = c v + k (x - x0) + k_w w."""
    return p.c * velocity + p.k * (displacement - p.x0) + p.k_w * state[0]


def loop_rate(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    w, v = state[0], velocity
    w_n = mr.twins.power(np.abs(w), p.n)
    return np.stack([p.rho * (v - p.sigma * np.abs(v) * np.sign(w) * w_n + (p.sigma - 1.0) * v * w_n)])


def loop_relaxation(p: Any, displacement: Any, velocity: Any) -> Any:
    """That of the core where sigma is 1/2, while the loop loads."""
    return p.rho * p.n * np.abs(velocity)


def again(model: mr.DamperSpec, name: str, force: Any, **more: Any) -> mr.DamperSpec:
    return mr.own_damper(name, parameters={each.name: each for each in model.parameters}, force=force, **more)


guo = again(GUO, "my_guo", guo_force)
static = again(STATIC, "my_static", static_force)
in_states = {"rate": loop_rate, "states": 1}
loop = again(LOOP, "my_loop", loop_force, **in_states, spring=("k", "x0"))
bounded_loop = again(LOOP, "my_bounded_loop", loop_force, **in_states, relaxation=loop_relaxation)


def branches_force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    """f = c v + k (z_1 + z_2 + z_3), three springs in series with dashpots side by side."""
    return p.c * velocity + p.k * np.sum(state)


def branches_rate(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return velocity - state * np.array([1.0, 4.0, 9.0]) / p.tau


branches = mr.own_damper(
    "my_branches",
    parameters={"c": ("N s/m", 1, 100, 1e4), "k": ("N/m", 1, 1e4, 1e6), "tau": ("s", 1e-3, 0.1, 10)},
    force=branches_force,
    rate=branches_rate,
    states=3,
)
