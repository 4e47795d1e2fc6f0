"""Lyapunov and Riccati equations with solutions differentiable in weights and plant."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array, lax

# Doublings of the Smith iteration: 2^24 steps are enough for a mode that decays by a millionth in each.
_DOUBLINGS = 24
_MOST_ITERATIONS = 60
_SETTLED = 1e-13


def lyapunov(state: Array, weight: Array) -> Array:
    """P of `A'P + P A + Q = 0` for a stable A, by Smith's doubling; shape (m, m).

    Uses matrix products only, so that it is cheap to differentiate (R. A. Smith, SIAM J. Appl. Math. 16, 1968).
    """
    one = jnp.eye(state.shape[0])
    # Shift at the geometric mean of all modes.
    shift = lax.stop_gradient(jnp.exp(jnp.linalg.slogdet(state)[1] / state.shape[0]))
    inverse = jnp.linalg.inv(shift * one - state)
    step = inverse @ (shift * one + state)
    solution = 2.0 * shift * inverse.T @ weight @ inverse

    def doubled(pair: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        power, total = pair
        return (power @ power, total + power.T @ total @ power), None

    (_, solution), _ = lax.scan(doubled, (step, solution), None, length=_DOUBLINGS)
    symmetric: Array = 0.5 * (solution + solution.T)
    return symmetric


def lqr_gain(
    state: Array, effect: Array, state_weight: Array, control_weight: Array, cross_weight: Array | None = None
) -> Array:
    """K = R^-1 (B'P + N') of the linear quadratic regulator, by the iteration of Newton and Kleinman.

    The iteration starts without control, so the plant must be stable. Each iteration solves a Lyapunov equation. At the
    solution its derivative with respect to the iterate vanishes, so that differentiating one more iteration gives the
    exact derivatives of the solution.

    Parameters
    ----------
    state, effect
        A and B, shape (m, m) and (m, k).
    state_weight, control_weight, cross_weight
        Q, R and N of the integral of s'Q s + 2 s'N f + f'R f, shape (m, m), (k, k), (m, k).

    Returns
    -------
    Array
        Shape (k, m); the desired force is -K s.
    """
    n = jnp.zeros_like(effect) if cross_weight is None else cross_weight

    def iterate(gain: Array, a: Array, b: Array, q: Array, r: Array, n: Array) -> Array:
        closed = a - b @ gain
        cost = q + gain.T @ r @ gain - n @ gain - gain.T @ n.T
        better: Array = jnp.linalg.solve(r, b.T @ lyapunov(closed, cost) + n.T)
        return better

    inputs = state, effect, state_weight, control_weight, n
    fixed = jax.tree.map(lax.stop_gradient, inputs)

    def unsettled(carry: tuple[Array, Array, Array]) -> Array:
        _, change, count = carry
        return (change > _SETTLED) & (count < _MOST_ITERATIONS)

    def improve(carry: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        gain, _, count = carry
        better = iterate(gain, *fixed)
        return better, jnp.linalg.norm(better - gain) / jnp.linalg.norm(better), count + 1

    start = jnp.zeros_like(effect.T), jnp.float64(jnp.inf), jnp.int64(0)
    gain, _, _ = lax.while_loop(unsettled, improve, start)
    return iterate(lax.stop_gradient(gain), *inputs)
