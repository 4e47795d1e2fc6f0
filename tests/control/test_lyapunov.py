"""A Lyapunov function falls at the rate that was asked for."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from control_samples import in_units, plant
from refusals import refusal

import mrwork as mr
from mrwork.control import lyapunov_function


@pytest.mark.parametrize("n_devices", [1, 3])
def test_the_function_falls_as_stated(n_devices: int) -> None:
    system = plant(n_devices, mr.building("uts"))
    function = lyapunov_function(system)
    rng = np.random.default_rng(9)
    for _ in range(5):
        s, f = system.scaling @ rng.standard_normal(10), 100.0 * rng.standard_normal(n_devices)
        slope = s @ function.P @ (system.A @ s + system.B @ f)
        stated = -0.5 * s @ function.weight @ s + function.vectors @ s @ f
        np.testing.assert_allclose(slope, stated, rtol=1e-8)
    assert np.linalg.eigvalsh(system.scaling.T @ function.P @ system.scaling)[0] > 0.0


def test_without_a_weight_the_units_do_not_matter() -> None:
    """sigma f is energy over time times time, so sigma is a length: in millimetres, it is 1000 times the number."""
    system = plant()
    other = in_units(system, metre=1e3, second=1.0, newton=1.0)
    back = lyapunov_function(other).vectors * np.full(6, 1e3) / 1e3
    np.testing.assert_allclose(back, lyapunov_function(system).vectors, rtol=1e-7, atol=1e-12)


def test_its_value_along_a_free_motion_is_what_is_still_to_be_lost() -> None:
    """V(0) - V(t) is the integral of s'Q_P s / 2; the trapezoidal rule at steps of 1e-3 of the fastest period."""
    system = plant()
    function = lyapunov_function(system)
    states = [system.scaling @ np.random.default_rng(3).standard_normal(6)]
    dt = 2e-3 * np.pi / np.abs(np.linalg.eigvals(system.A)).max()
    step = scipy.linalg.expm(system.A * dt)
    for _ in range(2000):
        states.append(step @ states[-1])
    rate = 0.5 * np.einsum("ti,ij,tj->t", states, function.weight, states)
    value = function.value(states)
    np.testing.assert_allclose(value[0] - value[-1], dt * np.trapezoid(rate), rtol=1e-5)
    assert value[-1] < 0.99 * value[0]


def test_what_has_no_function_is_refused() -> None:
    undamped = replace(mr.building("dyke1996"), damping=np.zeros((3, 3)))
    refusal(lyapunov_function, plant(1, undamped), match="needs damping in every mode")
