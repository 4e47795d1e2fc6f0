"""Regulators are optimal, stable, the same in all units of the building, and those of published weights."""

import mpmath
import numpy as np
import pytest
from control_samples import frame, in_units, mean_cost, plant
from refusals import refusal

import mrwork as mr
from mrwork.control import (
    Plant,
    accelerations,
    drifts,
    regulator_gains,
    regulator_of_outputs,
    regulator_of_state,
)
from mrwork.control.linear.lqr import PUBLISHED_REGULATORS
from mrwork.control.linear.plant import Outputs

THIRD_FLOOR = (0.0, 0.0, 1.0)


def weights(outputs: Outputs, W: object, control_weight: float) -> tuple[np.ndarray, ...]:
    W = np.diag(W)
    C, D = outputs.C, outputs.D
    return C.T @ W @ C, control_weight * np.eye(D.shape[1]) + D.T @ W @ D, C.T @ W @ D


def exact_gain(system: Plant, Q: np.ndarray, R: np.ndarray, N: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Kleinman's iteration in 60 digits, until it no longer moves."""
    size = len(system.A)
    with mpmath.workdps(60):
        A, B, Q, R, N, K = (mpmath.matrix(each.tolist()) for each in (system.A, system.B, Q, R, N, start))
        for _ in range(12):
            closed, weight = A - B * K, Q - N * K - K.T * N.T + K.T * R * K
            equations = mpmath.matrix(size**2, size**2)
            for i in range(size):
                for j in range(size):
                    for k in range(size):
                        equations[i * size + j, k * size + j] += closed[k, i]
                        equations[i * size + j, i * size + k] += closed[k, j]
            entries = mpmath.lu_solve(equations, -mpmath.matrix([*weight]))
            P = mpmath.matrix(size, size)
            for index in range(size**2):
                P[index // size, index % size] = entries[index]
            new = R**-1 * (B.T * P + N.T)
            moved, K = mpmath.mnorm(new - K) / mpmath.mnorm(new), new
            if moved < 1e-30:
                return np.array(K.tolist(), dtype=float)
    raise AssertionError("Kleinman's iteration did not settle")


@pytest.mark.parametrize("W", [THIRD_FLOOR, (1.0, 1.0, 1.0)])
def test_weights_of_dyke_give_the_gain_of_sixty_digits(W: tuple[float, ...]) -> None:
    """Control weight 1e-17 per N^2: in SI and without scaling, the gain comes out 1e-5 to 1e-4 wrong."""
    (dyke,) = (each for each in PUBLISHED_REGULATORS if each.name == "dyke1996")
    assert (dyke.weights, dyke.control_weight) == (THIRD_FLOOR, 1e-17)
    system = plant()
    outputs = accelerations(system)
    regulator = regulator_of_outputs(system, outputs, W, 1e-17)
    exact = exact_gain(system, *weights(outputs, W, 1e-17), start=regulator.gain)
    np.testing.assert_allclose(regulator.gain, exact, rtol=0.0, atol=1e-6 * np.abs(exact).max())
    in_energy = np.linalg.norm((regulator.gain - exact) @ system.scaling)
    assert in_energy <= 1e-6 * np.linalg.norm(exact @ system.scaling)


@pytest.mark.parametrize("control_weight", [1e-17, 1e-8])
def test_other_units_give_the_same_wanted_force(control_weight: float) -> None:
    metre, second, newton = 1e3, 1e-2, 0.2248
    system = plant()
    other = in_units(system, metre, second, newton)
    gain = regulator_of_outputs(system, accelerations(system), THIRD_FLOOR, control_weight).gain
    # y'y + R f^2 keeps its minimum where R is written per unit of force squared over acceleration squared.
    written = control_weight * (metre / second**2) ** 2 / newton**2
    changed = regulator_of_outputs(other, accelerations(other), THIRD_FLOOR, written).gain
    back = changed * np.repeat([metre, metre / second], 3) / newton
    error = np.linalg.norm((back - gain) @ system.scaling)
    assert error <= 1e-6 * np.linalg.norm(gain @ system.scaling)


@pytest.mark.parametrize("n_devices", [1, 2])
def test_any_other_gain_costs_more(n_devices: int) -> None:
    system = plant(n_devices)
    outputs = accelerations(system)
    Q, R, N = weights(outputs, (1.0, 1.0, 1.0), 1e-7)
    regulator = regulator_of_outputs(system, outputs, (1.0, 1.0, 1.0), 1e-7)
    least = mean_cost(system, regulator.gain, Q, R, N)
    rng = np.random.default_rng(8)
    scale = np.linalg.norm(regulator.gain @ system.scaling)
    for _ in range(20):
        step = rng.standard_normal((n_devices, 6))
        step = 0.02 * scale * step / np.linalg.norm(step) @ np.linalg.inv(system.scaling)
        assert mean_cost(system, regulator.gain + step, Q, R, N) > least * (1.0 + 1e-9)
    np.testing.assert_allclose(
        least, np.trace(system.scaling.T @ regulator.riccati @ system.scaling), rtol=1e-9
    )


def test_the_cross_term_counts() -> None:
    """A floor on which the device acts: leaving out C'W D gives another gain, which costs more."""
    system = plant()
    outputs = accelerations(system)
    Q, R, N = weights(outputs, (1.0, 0.0, 0.0), 1e-6)
    with_it = regulator_of_outputs(system, outputs, (1.0, 0.0, 0.0), 1e-6).gain
    without = regulator_gains(system.A, system.B, Q, R, scaling=system.scaling).gain[0]
    assert mean_cost(system, without, Q, R, N) > 1.01 * mean_cost(system, with_it, Q, R, N)


def test_return_difference_is_that_of_an_optimal_loop() -> None:
    """`(1 + L)* R (1 + L) = H*H + R` with L = K (jw - A)^-1 B (Kalman, J. Basic Eng. 86, 1964, 51-60)."""
    system = plant(2, mr.building("uts"))
    outputs = drifts(system)
    regulator = regulator_of_outputs(system, outputs, np.full(5, 1e4), 1e-7)
    for frequency in (0.5, 3.0, 8.7, 17.0, 60.0):
        response = np.linalg.solve(2j * np.pi * frequency * np.eye(10) - system.A, system.B)
        loop = np.eye(2) + regulator.gain @ response
        H = 100.0 * outputs.C @ response
        left = loop.conj().T @ regulator.control_weight @ loop
        np.testing.assert_allclose(left, H.conj().T @ H + regulator.control_weight, rtol=1e-7)


def test_a_damping_force_is_wanted_where_energy_is_weighed() -> None:
    """With Q the energy and R small enough, `f_c v > 0` where the building only moves: f_c is a resisting force."""
    system = plant()
    regulator = regulator_of_state(system, system.energy, 1e-3)
    moving = np.array([0.0, 0.0, 0.0, 0.1, 0.1, 0.1])
    assert (-regulator.gain @ moving)[0] * (system.attachment @ moving[3:])[0] > 0.0


def test_closed_loop_is_stable_and_faster() -> None:
    for n_devices in (1, 3, 5):
        system = plant(n_devices, mr.building("uts"))
        regulator = regulator_of_state(system, system.energy, 1e-4)
        assert regulator.poles.real.max() < np.linalg.eigvals(system.A).real.max() < 0.0
        poles = np.linalg.eigvals(system.A - system.B @ regulator.gain)
        np.testing.assert_allclose(np.sort(poles.real), np.sort(regulator.poles.real), rtol=1e-6)


def test_an_undamped_mode_that_is_not_weighed_is_refused() -> None:
    building = frame("undamped", np.eye(2), np.zeros((2, 2)), np.array([[2.0, -1.0], [-1.0, 1.0]]))
    refusal(
        regulator_of_state, plant(1, building), np.zeros((4, 4)), 1.0, match="every mode that is not damped"
    )
