"""Steps of least squares are straight in the forces, and stop at bounds that the misfit falls across."""

import numpy as np
import pytest

import mrwork as mr
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.minimise.straight import Straight
from mrwork.identification.objective import NormalEquations

SPEC = mr.damper("normalised_bouc_wen")
THETA = np.array([[900.0, 2e3, 0.01, 400.0, 800.0, 3.0, 2.0], [50.0, -700.0, 0.2, 90.0, 300.0, 0.5, 1.5]])
COORDINATES = Straight(SPEC, mr.Box.of(SPEC))
FREE = np.zeros(THETA.shape, dtype=np.bool_)


@pytest.mark.parametrize("held", [(), ("x0",)])
def test_slopes_are_those_of_the_steps(held: tuple[str, ...]) -> None:
    still = FREE | np.isin(SPEC.names, held)
    slope = COORDINATES.slope(THETA, still)
    for column in np.flatnonzero(~still[0]):
        step = np.zeros((2, 2, len(SPEC.names)))
        size = 1e-6 * (np.abs(THETA[:, 1] * THETA[:, 2]) if column == 2 else 1.0 + np.abs(THETA[:, column]))
        step[:, 0, column], step[:, 1, column] = -size, size
        less, more = np.moveaxis(COORDINATES.after(THETA, still, step), 1, 0)
        differences = (more - less) / (2.0 * size[:, None])
        np.testing.assert_allclose(differences, slope[:, :, column], rtol=1e-5, atol=1e-9)


def test_a_step_keeps_the_force_of_the_spring_at_zero_stroke_unless_it_changes_it() -> None:
    step = np.zeros((2, 1, len(SPEC.names)))
    step[:, 0, 1] = [500.0, 1500.0]
    after = COORDINATES.after(THETA, FREE, step)[:, 0]
    np.testing.assert_allclose(after[:, 1] * after[:, 2], THETA[:, 1] * THETA[:, 2])
    # The second stiffness has changed its sign, and the free length with it.
    assert after[1, 1] > 0.0 > after[1, 2]


def test_a_positive_force_stays_positive_and_within_its_bounds() -> None:
    step = np.zeros((2, 1, len(SPEC.names)))
    step[:, 0, 3] = -1e6
    after = COORDINATES.after(THETA, FREE, step)[:, 0, 3]
    np.testing.assert_allclose(after, 0.1 * THETA[:, 3])
    step[:, 0, 6] = 100.0
    np.testing.assert_array_equal(COORDINATES.after(THETA, FREE, step)[:, 0, 6], SPEC.parameters[6].upper)


def test_limits_of_a_model_have_far_rates_and_the_same_forces() -> None:
    points = COORDINATES.limits(THETA[0], np.random.default_rng(0))
    rates = np.isin(SPEC.names, ("rho", "sigma"))
    np.testing.assert_array_equal(points[:, ~rates], np.tile(THETA[0, ~rates], (len(points), 1)))
    far = np.abs(np.log10(points[:, rates] / THETA[0, rates])) > 0.9
    # Each alone and both together.
    assert {tuple(row) for row in far.tolist()} == {(True, False), (False, True), (True, True)}
    assert np.all(points >= COORDINATES.box.lower)
    assert np.all(points <= COORDINATES.box.upper)


def stroke_that_never_comes_back() -> mr.DamperTest:
    """A sliding spring beside a spring and a dashpot, on a stroke with a swing: no model of the package."""
    time = np.linspace(0.0, 3.0, 400)
    stroke = 0.03 * (time / 3.0 + 0.08 * np.sin(2.0 * np.pi * time))
    velocity = np.gradient(stroke, time)
    slider, force = 0.0, np.zeros(time.size)
    for index in range(1, time.size):
        slider = float(np.clip(slider + 2e5 * (stroke[index] - stroke[index - 1]), -700.0, 700.0))
        force[index] = slider
    return mr.test_from_arrays(time, stroke, force + 2e4 * stroke + 3e3 * velocity, name="stroke")


def test_a_damping_that_starts_near_zero_is_found() -> None:
    objective = mr.identification.Objective.of(SPEC, (stroke_that_never_comes_back(),), threads=1)
    box = mr.Box.of(SPEC)
    start = np.array([[SPEC.parameters[0].lower, 1.5e4, 0.0, 500.0, 300.0, 2.0, 1.5]])
    minima = find_minima(objective, box, start, max_iterations=100)
    assert minima.converged[0]
    assert minima.misfit[0] < 0.01
    assert 1e3 < minima.theta[0, 0] < 1e4


def test_a_parameter_is_still_on_a_bound_that_the_misfit_falls_across_and_leaves_it_inwards() -> None:
    objective = mr.identification.Objective.of(SPEC, (stroke_that_never_comes_back(),), threads=1)
    narrow = mr.Box.of(SPEC).with_bounds({"c": (1e-3, 1e3), "n": (1.0, 6.0)})
    start = np.array([[1e3, 1.5e4, 0.0, 500.0, 300.0, 2.0, 6.0]])
    minima = find_minima(objective, narrow, start, max_iterations=100)
    assert minima.theta[0, 0] == 1e3
    assert minima.converged[0]
    equations = NormalEquations.at(objective, narrow, minima.theta, np.ones((1, 1), dtype=np.bool_))
    still = Straight(SPEC, narrow).outward(minima.theta, equations.joint(objective.shares[None])[0])
    assert still[0, 0]
    inwards = find_minima(objective, narrow, np.array([[1e-3, *start[0, 1:]]]), max_iterations=100)
    assert inwards.theta[0, 0] == 1e3
    assert inwards.misfit[0] == pytest.approx(minima.misfit[0], rel=1e-3)


def test_steps_of_all_simulations_are_counted() -> None:
    test = mr.synthetic_test("spencer1997")
    theta = SPEC.nominal * np.exp(np.random.default_rng(0).normal(0.0, 1.0, (9, len(SPEC.names))))
    theta = np.clip(theta, mr.Box.of(SPEC).lower, mr.Box.of(SPEC).upper)
    direct, with_offset = (mr.identification.Objective.of(SPEC, (test,), threads=1) for _ in range(2))
    direct(theta)
    assert direct.tally.steps > 9 * test.n_time
    every = np.ones((9, 1), dtype=np.bool_)
    NormalEquations.at(with_offset, mr.Box.of(SPEC), theta, every)
    assert with_offset.tally.steps == direct.tally.steps
