"""Laws of the twin: commands, and derivatives that agree with finite differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from loop_twin_samples import LARGEST, STEP, a_ground, two_storeys
from twin_laws import ClippedOptimal, LyapunovBangBang, ModifiedClippedOptimal, switch

from mrwork.twins.loop_laws import LyapunovDirect
from mrwork.twins.loop_stepping import Measurement, run_loop


def measured(state: Any, force: float) -> Measurement:
    return Measurement(
        state=jnp.asarray(state, dtype=jnp.float64),
        deformation=jnp.zeros(1),
        rate=jnp.zeros(1),
        force=jnp.array([force]),
        force_at=lambda i: 3.0 + 2.0 * i - 0.25 * i**2,
        largest=jnp.array([2.0]),
    )


def test_the_slope_is_that_of_the_parabola() -> None:
    np.testing.assert_allclose(measured([0.0, 1.0], 0.0).slope(), [2.0], rtol=1e-14)


@pytest.mark.parametrize(
    ("wanted", "force", "on"), [(5.0, 3.0, 1), (2.0, 3.0, 0), (-5.0, -3.0, 1), (5.0, -3.0, 0)]
)
def test_clipped_optimal_is_on_where_more_is_wanted_of_what_it_gives(
    wanted: float, force: float, on: int
) -> None:
    gain = jnp.array([[0.0, -wanted]])
    at = measured([0.0, 1.0], force)
    assert float(ClippedOptimal(gain).command(at)[0]) == 2.0 * on
    share = min(abs(wanted) / 4.0, 1.0)
    assert float(ModifiedClippedOptimal(gain, jnp.array([4.0])).command(at)[0]) == 2.0 * share * on


@pytest.mark.parametrize("velocity", [-0.3, 0.3])
def test_lyapunov_laws_command_where_the_damper_takes_from_the_measure(velocity: float) -> None:
    # B has the sign of a resisting force, so sigma = s'P B opposes the velocity, and a force along it dissipates.
    weight = jnp.array([[0.0], [-1.0]])
    for force in (-3.0, 3.0):
        command = LyapunovBangBang(weight).command(measured([0.0, velocity], force))
        assert float(command[0]) == (2.0 if velocity * force > 0.0 else 0.0)
    direct = LyapunovDirect(jnp.array(0.5), weight).command(measured([0.0, velocity], 0.0))
    np.testing.assert_allclose(direct, [0.5 * velocity * 2.0], rtol=1e-14)


def test_a_narrow_switch_is_the_one_of_the_paper() -> None:
    x = jnp.array([-1.0, -0.1, 0.1, 1.0])
    np.testing.assert_allclose(switch(x, 1e-3), switch(x, 0.0), atol=1e-12)
    assert float(switch(jnp.array(0.0), 0.0)) == 0.0


def roughness(law: Any) -> Array:
    """A criterion of a run of 1.2 s, smooth except where the command reaches its limits."""
    plant, devices = two_storeys()
    result = run_loop(
        plant,
        devices,
        law,
        a_ground(588),
        step_time=STEP,
        largest_command=jnp.array([LARGEST]),
        steps_per_sample=3,
        delay=2,
    )
    return (
        result.summary()["peak_drift"].max() / 1e-3
        + result.summary()["rms_acceleration"].max()
        + result.summary()["mean_current"].max()
    )


def lyapunov_direct(weights: Array) -> Any:
    weight = jnp.concatenate([jnp.zeros(2), weights[:2]])[:, None]
    return LyapunovDirect(10.0 * jnp.exp(weights[2]), -weight)


def softened(weights: Array) -> Any:
    return ClippedOptimal(1e2 * weights[None, :2] @ jnp.eye(2, 4, k=2), width=jnp.exp(weights[2]) * 10.0)


@pytest.mark.parametrize("law", [lyapunov_direct, softened])
def test_derivatives_of_criteria_are_those_of_differences(law: Callable[[Array], Any]) -> None:
    at = jnp.array([0.4, 0.3, -0.2])

    @jax.jit
    def value_and_slope(weights: Array) -> tuple[Array, Array]:
        return jax.value_and_grad(lambda w: roughness(law(w)))(weights)

    step = 1e-5
    differences = [
        (value_and_slope(at + step * axis)[0] - value_and_slope(at - step * axis)[0]) / (2.0 * step)
        for axis in jnp.eye(3)
    ]
    slope = value_and_slope(at)[1]
    assert (np.abs(slope) > 1e-6).all(), slope
    np.testing.assert_allclose(slope, differences, rtol=1e-5, atol=1e-7)


def test_memory_of_a_derivative_grows_as_the_root_of_the_record() -> None:
    plant, devices = two_storeys()

    def bytes_of(n_steps: int) -> int:
        def criterion(gain: Array) -> Array:
            law = ClippedOptimal(gain, width=10.0)
            settings = {"step_time": STEP, "largest_command": jnp.array([LARGEST])}
            return run_loop(plant, devices, law, a_ground(n_steps), **settings).summary()["rms_drift"].max()

        compiled = jax.jit(jax.grad(criterion)).lower(jnp.ones((1, 4))).compile()
        return int(compiled.memory_analysis().temp_size_in_bytes)

    # Four times the memory for a record sixteen times as long, apart from the small table of the ground motion.
    assert bytes_of(6400) / 6400 < 0.5 * bytes_of(400) / 400
