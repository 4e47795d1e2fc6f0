"""The observer is the best linear one: its error has the covariance that it says."""

from dataclasses import replace

import numpy as np
import pytest
from control_samples import frame, in_units, plant
from refusals import refusal

import mrwork as mr
from mrwork.control import Plant, accelerations, deformations, observer_of, plant_of
from mrwork.control.linear.lqr import Observer
from mrwork.control.linear.plant import Outputs, stack_outputs

TS = 2e-3


def sensors(system: Plant) -> Outputs:
    return stack_outputs(accelerations(system), deformations(system))


def held_exactly(system: Plant, time: float) -> tuple[np.ndarray, np.ndarray]:
    """One sample by 4096 small steps of Runge-Kutta's rule: the state, and what a held unit of each input adds."""
    inputs = np.column_stack([system.B, system.E])
    state, added, h = np.eye(len(system.A)), np.zeros_like(inputs), time / 4096
    series = np.eye(len(system.A)) + h * system.A / 2 @ (
        np.eye(len(system.A)) + h * system.A / 3 @ (np.eye(len(system.A)) + h * system.A / 4)
    )
    for _ in range(4096):
        added = added + h * series @ (system.A @ added + inputs)
        state = state + h * series @ system.A @ state
    return state, added


def test_inputs_are_held_over_the_sample() -> None:
    system = plant(2)
    observer = observer_of(system, sensors(system), TS)
    state, added = held_exactly(system, TS)
    np.testing.assert_allclose(observer.Ad, state, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(observer.Bd, added[:, :2], rtol=1e-7, atol=1e-15)


@pytest.mark.parametrize(
    "chosen",
    [("acceleration floor 1", "acceleration floor 3"), ("deformation device 1", "acceleration floor 2")],
)
def test_errors_scatter_as_the_riccati_equation_says_and_have_no_mean(chosen: tuple[str, ...]) -> None:
    """200 runs of 1500 samples, some 4000 independent errors: variances scatter by 2 %, means by 1.6 %."""
    system = plant()
    measured = sensors(system).select(chosen)
    noise = np.array([2e-6, 0.5])[[int(name.startswith("acceleration")) for name in chosen]]
    observer = observer_of(system, measured, TS, noise_intensity=noise)
    _, added = held_exactly(system, TS)
    rng = np.random.default_rng(10)
    n_runs, n_start, n_samples = 200, 500, 2000
    state = np.zeros((6, n_runs))
    estimate = np.zeros((6, n_runs))
    errors = []
    for sample in range(n_samples):
        force = 50.0 * rng.standard_normal((1, n_runs))
        ground = rng.standard_normal((1, n_runs)) / np.sqrt(TS)
        scatter = rng.standard_normal((2, n_runs)) * np.sqrt(noise / TS)[:, None]
        if sample >= n_start:
            errors.append(estimate - state)
        y = measured.C @ state + measured.D @ force + scatter
        innovation = y - observer.C @ estimate - observer.D @ force
        estimate = observer.Ad @ estimate + observer.Bd @ force + observer.gain @ innovation
        state = observer.Ad @ state + added[:, :1] @ force + added[:, 1:] @ ground
    error = np.hstack(errors)
    # In units of the stated covariance: the identity, and no mean.
    values, vectors = np.linalg.eigh(
        np.linalg.solve(system.scaling, np.linalg.solve(system.scaling, observer.covariance).T)
    )
    whitened = (vectors / np.sqrt(values)).T @ np.linalg.solve(system.scaling, error)
    np.testing.assert_allclose(np.cov(whitened), np.eye(6), rtol=0.0, atol=0.1)
    np.testing.assert_allclose(whitened.mean(axis=1), 0.0, atol=0.1)


@pytest.mark.parametrize("n_devices", [1, 3])
def test_any_other_gain_leaves_a_larger_error(n_devices: int) -> None:
    system = plant(n_devices, mr.building("uts"))
    observer = observer_of(system, sensors(system), TS)
    _, added = held_exactly(system, TS)
    process = added[:, -1:] @ added[:, -1:].T / TS
    T = system.scaling
    in_z = np.linalg.solve(T, np.linalg.solve(T, process).T)
    process = process + 1e-6 * np.trace(in_z) * T @ T.T

    def size(gain: np.ndarray) -> float:
        closed = np.linalg.solve(T, (observer.Ad - gain @ observer.C) @ T)
        driven = np.linalg.solve(T, np.linalg.solve(T, process + gain @ gain.T / (50.0 * TS)).T)
        total, power = driven, closed
        for _ in range(30):  # doubling: the sum of closed^k driven closed'^k
            total = total + power @ total @ power.T
            power = power @ power
        return float(np.trace(total))

    least = size(observer.gain)
    stated = np.trace(np.linalg.solve(T, np.linalg.solve(T, observer.covariance).T))
    np.testing.assert_allclose(least, stated, rtol=1e-6)
    rng = np.random.default_rng(11)
    in_energy = np.linalg.solve(T, observer.gain)
    for _ in range(10):
        step = rng.standard_normal(in_energy.shape)
        step *= 0.02 * np.linalg.norm(in_energy) / np.linalg.norm(step)
        assert size(observer.gain + T @ step) > least * (1.0 + 1e-9)


def test_gain_over_sample_time_tends_to_the_continuous_filter() -> None:
    """By a first-order law: halving the sample time halves the distance, within a fifth."""
    system = plant()

    def per_time(time: float) -> np.ndarray:
        return np.linalg.solve(system.scaling, observer_of(system, sensors(system), time).gain) / time

    one, half, quarter = (per_time(time) for time in (2e-4, 1e-4, 5e-5))
    ratio = np.linalg.norm(one - half) / np.linalg.norm(half - quarter)
    assert 1.6 < ratio < 2.4


def test_other_units_give_the_same_estimate() -> None:
    system, metre = plant(), 1e3
    other = in_units(system, metre, 1.0, 1.0)
    observer = observer_of(system, sensors(system), TS)
    # Noises stated in the other unit, so that the ratio to the ground is the same.
    changed: Observer = observer_of(other, sensors(other), TS, noise_intensity=1.0 / 50.0)
    np.testing.assert_allclose(
        changed.gain, observer.gain, rtol=1e-5, atol=1e-9 * np.abs(observer.gain).max()
    )


def test_what_the_ground_does_not_move_is_corrected_too() -> None:
    """An undamped mass that only a device moves: its error is kept for ever where nothing unmodelled is allowed for."""
    mass, stiffness = np.diag([300.0, 1.0]), np.diag([1e5, 1e5])
    building = replace(
        frame("braced", mass, np.diag([300.0, 0.0]), stiffness),
        influence=np.array([1.0, 0.0]),
        floors=np.array([[1.0, 0.0]]),
        floor_names=("1",),
    )
    system = plant_of(building, [[1.0, -1.0]])

    def decay(unmodelled: float) -> float:
        observer = observer_of(
            system, sensors(system), TS, noise_intensity=[0.02, 1e-9], unmodelled=unmodelled
        )
        return float(np.abs(np.linalg.eigvals(observer.Ad - observer.gain @ observer.C)).max())

    assert decay(1e-6) < 1.0 - 1e-4
    refusal(decay, 0.0, match="every undamped mode is observable")


def test_a_free_mode_that_no_sensor_sees_is_refused() -> None:
    """Two masses, neither tied to the ground nor damped: accelerations do not tell where they drift."""
    stiffness = np.array([[1.0, -1.0], [-1.0, 1.0]])
    building = frame("adrift", np.eye(2), np.zeros((2, 2)), stiffness)
    system = plant_of(building, building.storeys[1:])
    refusal(observer_of, system, accelerations(system), TS, match="every undamped mode is observable")
