"""The steppers that the stiff-stepping study compares: they are what they claim to be, and so is its verdict."""

from __future__ import annotations

import numpy as np
import pytest

from mrwork import _rust
from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_forces
from studies.stiff_stepping import elementary
from studies.stiff_stepping.accuracy import scattered_errors
from studies.stiff_stepping.any_model import twin_force
from studies.stiff_stepping.batch import PRESET, forces, motion_table, random_record
from studies.stiff_stepping.cost import counted
from studies.stiff_stepping.steppers import TIMES

SPEC = damper(PRESET)
ORDERS = {"rk4": 4, "ros2": 2, "ros3": 3, "rodas3": 3, "exponential": 2, "exact_loop": 2}
DT = 1.0 / 3000.0


def largest_error(force: np.ndarray, exact: np.ndarray) -> float:
    return float(np.max(np.abs(force - exact)) / np.max(np.abs(exact)))


def test_lane_functions_agree_with_the_library() -> None:
    x = np.random.default_rng(1).uniform(0.0, 20.0, 200)
    np.testing.assert_allclose([elementary.exp(-value) for value in x], np.exp(-x), rtol=1e-14)
    np.testing.assert_allclose([elementary.ln(value) for value in x], np.log(x), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose([elementary.power(value, 1.7) for value in x], x**1.7, rtol=1e-13)


def test_motions_are_those_of_the_core() -> None:
    history = random_record(1, n_time=50)
    table = motion_table(history, 2, (0.0, 0.5, 1.0)).reshape(-1, 2, 3, 3)
    stages = history.stages(2)
    # Velocities reach 0.6 m/s; the cubic through four stages magnifies their rounding a few times.
    np.testing.assert_allclose(table[:, 0, :, :2], stages[:, 0:3], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(table[:, 1, :, :2], stages[:, 2:5], rtol=0.0, atol=1e-14)


def test_explicit_stepper_is_the_rule_of_the_core() -> None:
    history = random_record(1, n_time=300)
    run = simulate_forces(SPEC, SPEC.nominal[None], history)
    force = forces("rk4", SPEC.nominal[None], history, int(run.substeps[0]))
    # Only the rounding differs: fused operations, and the order of a few sums.
    assert largest_error(force, run.force[:, :-1]) < 1e-11


@pytest.mark.parametrize("method", ["ros2", "rodas3"])
def test_hand_written_jacobian_is_that_of_the_twin(method: str) -> None:
    history = random_record(2, n_time=200)
    theta = np.where(np.arange(9) == 8, 1.7, SPEC.nominal)
    force = forces(method, theta[None], history, 8)[0]
    assert largest_error(np.asarray(twin_force(method, SPEC, theta, history, 8)), force) < 1e-9


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


def test_damped_steps_hold_a_saturated_loop_where_explicit_ones_do_not() -> None:
    # From rest to 0.6 m/s in 20 ms: the loop is saturated after 1 ms, while steps are still short against it; at
    # the end step times relaxation is 16.
    time = DT * np.arange(61)
    history = Loading(dt=DT, displacement=0.5 * 30.0 * time**2).history()
    theta = SPEC.nominal[None]
    exact = simulate_forces(SPEC, theta, history, substep_factor=64).force[:, :-1]

    def settled(method: str) -> float:
        return largest_error(forces(method, theta, history, 1)[:, 30:], exact[:, 30:])

    assert not settled("rk4") < 1.0
    for method in TIMES.keys() - {"rk4"}:
        assert settled(method) < 1e-3, method


def test_damped_steps_overshoot_from_the_middle_of_the_loop() -> None:
    # At w = 0 the slope of |w|^2 is zero, so the Jacobian does not see the saturation that the step runs into:
    # w comes out near h rho g, several times its limit. The exact loop cannot leave its bounds.
    history = random_record(2, n_time=60)
    theta = SPEC.nominal[None]
    exact = simulate_forces(SPEC, theta, history, substep_factor=64).force[:, :-1]
    for method in ("ros2", "ros3", "rodas3"):
        assert largest_error(forces(method, theta, history, 1), exact) > 1.0, method
    assert largest_error(forces("exact_loop", theta, history, 1), exact) < 0.1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rule_of_the_core_keeps_to_a_thousandth_on_random_motion(seed: int) -> None:
    for name in (PRESET, "modified_bouc_wen"):
        spec = damper(name)
        history = random_record(seed)
        assert 0.59 < history.peak_velocity < 0.61
        # The error falls with the fourth power of the step.
        exact = simulate_forces(spec, spec.nominal[None], history, substep_factor=16).force
        assert largest_error(simulate_forces(spec, spec.nominal[None], history).force, exact) < 1e-3


def test_damped_steps_leave_more_candidates_beyond_a_thousandth() -> None:
    # The verdict of the study in small: at equal sub-steps and at half of them.
    errors = scattered_errors(("rk4", "ros2", "rodas3"), (0.5, 1.0), 64)
    within = {method: {f: np.mean(e < 1e-3) for f, e in by.items()} for method, by in errors.items()}
    assert within["rk4"][1.0] > 0.95
    for method in ("ros2", "rodas3"):
        assert within[method][1.0] < within["rk4"][1.0]
        assert within[method][0.5] < 0.6


def test_counted_operations_are_near_those_of_the_core() -> None:
    # The study's steppers hoist c0 + c1, share sums among g and w', and leave the residual out.
    ours = counted("rk4", general=False)
    assert ours.powers == 4
    assert 0.5 < ours.flops / _rust.flops_per_step(PRESET, SPEC.nominal) < 1.0
