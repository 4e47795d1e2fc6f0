"""The steppers that the stiff-stepping study compares: they are what they claim to be, and so is its verdict."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_forces
from studies.stiff_stepping.batch import PRESET, forces, random_record
from studies.stiff_stepping.steppers import TIMES

SPEC = damper(PRESET)
ORDERS = {"rk4": 4, "ros2": 2, "ros3": 3, "rodas3": 3, "exponential": 2, "exact_loop": 2}
DT = 1.0 / 3000.0


def largest_error(force: np.ndarray, exact: np.ndarray) -> float:
    return float(np.max(np.abs(force - exact)) / np.max(np.abs(exact)))


def test_explicit_stepper_is_the_rule_of_the_core() -> None:
    history = random_record(1, n_time=300)
    run = simulate_forces(SPEC, SPEC.nominal[None], history)
    force = forces("rk4", SPEC.nominal[None], history, int(run.substeps[0]))
    # Only the rounding differs: fused operations, and the order of a few sums.
    assert largest_error(force, run.force[:, :-1]) < 1e-11


@pytest.mark.parametrize("method", TIMES)
def test_every_method_converges_at_its_order(method: str) -> None:
    # A stroke in one direction from rest: neither g nor w changes sign, the rates are smooth.
    ramp = np.linspace(0.0, 1.0, 33)
    history = Loading(dt=DT, displacement=5e-4 * (ramp + 0.5 * ramp**2)).history()
    theta = SPEC.nominal[None]
    exact = simulate_forces(SPEC, theta, history, substep_factor=64).force[:, :-1]
    error = [largest_error(forces(method, theta, history, substeps), exact) for substeps in (4, 8, 16)]
    assert error[-1] > 1e-12, "the error drowns in rounding, the order cannot be seen"
    assert np.log2(error[1] / error[2]) == pytest.approx(ORDERS[method], abs=0.35)


@pytest.mark.parametrize("seed", [1, 2])
def test_rule_of_the_core_keeps_to_a_thousandth_on_random_motion(seed: int) -> None:
    for name in (PRESET, "modified_bouc_wen"):
        spec = damper(name)
        history = random_record(seed)
        assert 0.59 < history.peak_velocity < 0.61
        # The error falls with the fourth power of the step.
        exact = simulate_forces(spec, spec.nominal[None], history, substep_factor=16).force
        assert largest_error(simulate_forces(spec, spec.nominal[None], history).force, exact) < 1e-3
