"""Lyapunov and Riccati solutions of the twin agree with SciPy, and their derivatives with finite differences."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from jax import Array
from loop_twin_samples import storeys_of

from mrwork.twins.loop.plant import LoopPlant
from mrwork.twins.loop.riccati import lqr_gain, lyapunov


def chain(n: int) -> tuple[Array, Array]:
    """Equal storeys of 330 kg and 1.45 MN/m, 1 % damping in the first mode; a force at the lowest."""
    stiffness = 1.448e6 * (storeys_of(n).T @ storeys_of(n))
    lowest = float(np.sqrt(np.linalg.eigvalsh(stiffness / 330.0)[0]))
    plant = LoopPlant.of(
        mass=330.0 * np.eye(n),
        damping=0.02 / lowest * stiffness,
        stiffness=stiffness,
        influence=np.ones(n),
        floors=np.eye(n),
        storeys=storeys_of(n),
    )
    zero, one = jnp.zeros((n, n)), jnp.eye(n)
    state = jnp.block([[zero, one], [-plant.stiffness_per_mass, -plant.damping_per_mass]])
    return state, jnp.zeros((2 * n, 1)).at[n, 0].set(-1.0 / 330.0)


def energy(n: int) -> Array:
    stiffness = 1.448e6 * (storeys_of(n).T @ storeys_of(n))
    return jnp.asarray(scipy.linalg.block_diag(stiffness, 330.0 * np.eye(n)))


@pytest.mark.parametrize("n", [1, 5, 20])
def test_lyapunov_solution_is_that_of_scipy(n: int) -> None:
    state, _ = chain(n)
    expected = scipy.linalg.solve_continuous_lyapunov(np.asarray(state).T, -np.asarray(energy(n)))
    found = lyapunov(state, energy(n))
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("n", [1, 5, 20])
def test_gain_is_that_of_scipy(n: int) -> None:
    state, effect = chain(n)
    cross = 0.1 * energy(n) @ effect * 330.0
    for cost in (1e-3, 1e-6):
        weight = cost * jnp.eye(1)
        expected = scipy.linalg.solve_continuous_are(
            np.asarray(state), np.asarray(effect), np.asarray(energy(n)), np.asarray(weight), s=1e-2 * cross
        )
        expected = (np.asarray(effect).T @ expected + 1e-2 * np.asarray(cross).T) / cost
        found = lqr_gain(state, effect, energy(n), weight, 1e-2 * cross)
        np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_derivatives_of_the_gain_are_those_of_differences() -> None:
    state, effect = chain(3)

    @jax.jit
    def first(weights: Array) -> Array:
        strain, kinetic, cost, stiffening = jnp.exp(weights)
        state_weight = energy(3) * jnp.repeat(jnp.stack([strain, kinetic]), 3)
        softened = state.at[3:].multiply(stiffening)
        gain = lqr_gain(softened, effect, 0.5 * (state_weight + state_weight.T), 1e-5 * cost * jnp.eye(1))
        return jnp.log(jnp.sum(gain**2))

    at = jnp.array([0.3, -0.4, 0.2, 0.1])
    steps = 1e-5 * jnp.eye(4)
    differences = jnp.stack([(first(at + step) - first(at - step)) / 2e-5 for step in steps])
    np.testing.assert_allclose(jax.grad(first)(at), differences, rtol=1e-6, atol=1e-8)
