"""The twin of the loop takes the documented steps, and its energies balance."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from loop_twin_run import run_loop
from loop_twin_samples import LARGEST, STEP, a_ground, five_storeys, two_storeys
from twin_laws import ClippedOptimal, LqrDirect, Passive

import mrwork as mr
from mrwork.errors import SettingError
from mrwork.twins.loop_stepping import LoopDevice, half_steps
from studies.speed.loop_plain import PlainLoop
from studies.speed.loop_workload import KEPT, LAG, LARGEST_COMMAND, loop_workload


def run(law: Any, devices: tuple[LoopDevice, ...] | None = None, n_steps: int = 400, **settings: Any) -> Any:
    plant, ours = two_storeys()
    ground = settings.pop("ground", None)
    return run_loop(
        plant,
        ours if devices is None else devices,
        law,
        a_ground(n_steps) if ground is None else ground,
        **({"step_time": STEP, "largest_command": jnp.array([LARGEST])} | settings),
    )


def currents(law: Any, n_steps: int = 400, **settings: Any) -> Any:
    """Coil current at the start of each step: by how much each step adds to the sum of those that are counted."""

    def total(counted: Array) -> Any:
        return run(law, n_steps=n_steps, counted=counted, **settings).reductions.current_sum[0]

    sums = jax.vmap(total)(jnp.arange(1.0, n_steps + 1.0))
    return np.diff(np.asarray(sums), prepend=0.0)


def commands(law: Any, n_steps: int = 400, **settings: Any) -> Any:
    """Command of each step but the last, from the currents before and after it."""
    current, left = currents(law, n_steps, **settings), np.exp(-LAG * STEP)
    return (current[1:] - left * current[:-1]) / (1.0 - left)


def test_five_storeys_move_as_in_plain_steps() -> None:
    workload = loop_workload(1, 1, 1.0)
    plant, devices = five_storeys(workload)
    # The record is coarser than the step, so that each step starts where the one before ended.
    steps = workload.ground[0]
    found = run_loop(
        plant,
        devices,
        ClippedOptimal(jnp.asarray(workload.gains)),
        jnp.append(steps[:, :2].ravel(), steps[-1, 2]),
        step_time=1e-3,
        largest_command=jnp.array([LARGEST_COMMAND]),
    )
    expected = PlainLoop.of(workload, 0).run(0)
    columns = np.concatenate([found.summary()[name] for name in KEPT])
    np.testing.assert_allclose(columns, expected, rtol=1e-11)


def test_a_pair_of_an_odd_model_acts_as_two() -> None:
    _, (damper,) = two_storeys()
    pair = run(Passive(jnp.array([2.0])), (replace(damper, differential=True),)).summary()
    two = run(Passive(jnp.array([2.0])), (replace(damper, count=2.0),)).summary()
    for name in ("peak_displacement", "peak_force", "device_energy"):
        np.testing.assert_allclose(pair[name], two[name], rtol=1e-10)


def test_dampers_at_different_storeys_follow_their_own_commands() -> None:
    plant, (damper,) = two_storeys()
    devices = (damper, replace(damper, row=plant.storeys[1]))
    found = run(Passive(jnp.array([2.0, 0.0])), devices, largest_command=jnp.full(2, LARGEST)).summary()
    np.testing.assert_allclose(found["mean_current"], [2.0, 0.0], rtol=1e-12)
    np.testing.assert_allclose(found["peak_stroke"], found["peak_drift"], rtol=1e-12)


def test_halving_the_step_of_a_passive_run_leaves_a_sixteenth_of_the_error() -> None:
    # A damper without a knee, so that the order of convergence is visible.
    plain = mr.damper("hyperbolic_tangent_gavin")
    theta = jnp.array([20.0, 0.1, 0.01, 100.0, 20.0, 0.0])
    device = (LoopDevice(spec=plain, theta=theta, row=jnp.eye(2)[0]),)

    def peak(n_steps: int) -> Array:
        # A ramp, so that no kink of the ground motion is inside a step.
        ground = jnp.asarray(half_steps(np.array([0.0, 5.0]), 0.5, 0.5 / n_steps, n_steps))
        found = run(Passive(jnp.zeros(1)), device, ground=ground, step_time=0.5 / n_steps)
        return jnp.stack([found.kinetic, found.strain, found.energies.entered, *found.energies.devices])

    coarse, middle, fine = (peak(n_steps) for n_steps in (50, 100, 200))
    assert 12.0 < float(jnp.linalg.norm(coarse - middle) / jnp.linalg.norm(middle - fine)) < 20.0


def test_what_enters_is_stored_or_dissipated() -> None:
    gain = jnp.array([[0.0, 0.0, 300.0, 0.0]])
    errors = [
        float(run(ClippedOptimal(gain), n_steps=800 * m, ground=a_ground(800 * m, STEP / m), **settings).energy_error)
        for m in (1, 4)
        for settings in ({"step_time": STEP / m, "steps_per_sample": m},)
    ]  # fmt: skip
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 16.0


def test_a_late_command_is_the_same_command_later() -> None:
    # On at the first motion, so that the second control sample switches for every delay.
    law = ClippedOptimal(jnp.array([[0.0, 0.0, -1e9, 0.0]]))
    for delay in (1, 4, 6):
        command = commands(law, 40, steps_per_sample=4, delay=delay)
        assert not command[: 4 + delay].any()
        np.testing.assert_allclose(command[4 + delay : 8], LARGEST, rtol=1e-9)


def test_the_first_command_has_been_there_since_long_before() -> None:
    received = currents(Passive(jnp.array([3.0])), 40, steps_per_sample=4, delay=6)
    np.testing.assert_allclose(received, 3.0, rtol=1e-12)


def test_the_coil_follows_with_its_lag() -> None:
    received = currents(ClippedOptimal(jnp.array([[0.0, 0.0, -1e9, 0.0]])), 12, steps_per_sample=4)
    np.testing.assert_allclose(
        received[5:9], LARGEST * (1.0 - np.exp(-LAG * STEP * np.arange(1, 5))), rtol=1e-12
    )


def test_a_belief_about_the_damper_stands_in_for_it() -> None:
    # With a believed damper whose force does not depend on the current, the command is zero.
    plant, _ = two_storeys()
    believed = mr.damper("static_hysteretic")
    theta = jnp.asarray(believed.nominal)
    devices = (LoopDevice(spec=believed, theta=theta, row=plant.storeys[0]),)
    law = LqrDirect(jnp.array([[0.0, 0.0, -0.5, 0.0]]))
    assert float(run(law).summary()["mean_current"].max()) > 0.01
    assert float(run(law, believed=devices).summary()["mean_current"].max()) < 1e-12


def test_a_command_is_held_until_the_next_sample() -> None:
    command = commands(ClippedOptimal(jnp.array([[0.0, 0.0, 300.0, 0.0]])), steps_per_sample=8)
    held = command[:392].reshape(-1, 8)
    np.testing.assert_allclose(held, held[:, :1].repeat(8, axis=1), atol=1e-9 * LARGEST)
    assert 0.05 < np.mean(held[:, 0] > 1e-6 * LARGEST) < 0.9


def test_runs_side_by_side_are_the_runs_alone() -> None:
    gains = jnp.linspace(-200.0, 400.0, 3)[:, None, None] * jnp.array([[0.0, 0.0, 1.0, 0.5]])

    def peaks(gain: Array) -> Array:
        found: Array = run(ClippedOptimal(gain)).summary()["peak_acceleration"]
        return found

    together = jax.vmap(peaks)(gains)
    np.testing.assert_allclose(together, [peaks(gain) for gain in gains], rtol=1e-10)


def test_the_ground_runs_straight_between_samples_and_rests_after_them() -> None:
    ground = half_steps(np.array([1.0, 3.0, 2.0]), 0.3, 0.1, 7)
    # Halves of 0.1 s: samples at 0, 6 and 12.
    np.testing.assert_allclose(ground[[0, 3, 6, 9, 12]], [1.0, 2.0, 3.0, 2.5, 2.0], rtol=1e-14)
    assert not ground[13:].any()


@pytest.mark.parametrize("settings", [{"steps_per_sample": 7}, {"delay": -1}])
def test_steps_that_fill_no_control_sample_are_refused(settings: dict[str, int]) -> None:
    with pytest.raises(SettingError, match="whole control samples"):
        run(Passive(jnp.zeros(1)), **settings)
