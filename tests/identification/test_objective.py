"""Residuals of several tests at once: exact Jacobians for every observation, the bits of any threads."""

from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.dampers.parameters import DRIVER_RATES, Lag
from mrwork.identification import FitSettings, Objective
from mrwork.identification.fit_progress import on_every_test
from mrwork.identification.objective import NormalEquations, linearise_residuals
from mrwork.records import DamperTest, Observation, cut

SPEC = mr.damper("normalised_bouc_wen")


@pytest.fixture(scope="module")
def test() -> DamperTest:
    whole = mr.synthetic_test("spencer1997")
    return cut(whole, end=whole.start_time + 1200 * whole.dt)


def rows(rng: int, n_rows: int = 3) -> np.ndarray:
    return SPEC.nominal * np.exp(0.1 * np.random.default_rng(rng).standard_normal((n_rows, len(SPEC.names))))


def assert_exact(objective: Objective, theta: np.ndarray) -> None:
    """Central differences of 1e-6 leave 1e-9 of rounding, relative to the residuals, and about as much curvature."""
    columns = range(theta.shape[1])
    residuals, jacobian = linearise_residuals(objective, theta, columns)
    # BLAS sums the same products in another order for other shapes.
    np.testing.assert_allclose(residuals, objective.residuals(theta), rtol=0.0, atol=1e-12)
    for own, row in zip(jacobian, theta, strict=True):
        for column in columns:
            step = np.zeros_like(row)
            step[column] = 1e-6 * abs(row[column])
            ahead, behind = objective.residuals(np.stack([row + step, row - step]))
            quotient = (ahead - behind) / (2.0 * step[column])
            error = np.linalg.norm(own[column] - quotient)
            assert error <= 1e-5 * np.linalg.norm(quotient) + 1e-14 / step[column]


def settings_with(each: tuple[str, ...]) -> FitSettings:
    return FitSettings(observe=["detect", *(f"{name}=each" for name in each)])


def other(test: DamperTest) -> DamperTest:
    """Another test of the same motion: half the force."""
    return replace(test, name="other", force=0.5 * test.force + 30.0)


@pytest.mark.parametrize("each", [(), ("offset",), ("gain",), ("delay",), ("offset", "gain", "delay")])
@pytest.mark.parametrize("n_tests", [1, 2])
def test_jacobian_is_the_difference_quotient(test: DamperTest, each: tuple[str, ...], n_tests: int) -> None:
    tests = (test, other(test))[:n_tests]
    assert_exact(Objective.of(SPEC, tests, settings_with(each)), rows(1))


def test_jacobian_goes_through_the_observation(test: DamperTest) -> None:
    observed = replace(
        test,
        observation=Observation(
            delay_seconds=1.3 * test.dt, lowpass_hz=40.0, average_seconds=5 * test.dt, gain=-0.9, offset=50.0
        ),
    )
    assert_exact(Objective.of(SPEC, (observed,), FitSettings(observe="offset=each")), rows(2))


def test_jacobian_of_current_laws_over_several_tests(test: DamperTest) -> None:
    model = SPEC.with_current_laws({"k_w": "quadratic", "c": "linear"})
    theta = model.nominal
    theta[[model.names.index("k_w.1"), model.names.index("c.1")]] = 300.0, 200.0
    tests = tuple(
        replace(test, name=f"{current} A", current=current, force=(0.4 + current) * test.force)
        for current in (0.0, 0.5, 1.0)
    )
    objective = Objective.of(model, tests)
    columns = [model.names.index(name) for name in ("c.0", "c.1", "k_w.0", "k_w.1", "n")]
    _, (jacobian,) = linearise_residuals(objective, theta[None], columns)
    for own, column in zip(jacobian, columns, strict=True):
        step = np.zeros_like(theta)
        step[column] = 1e-6 * abs(theta[column])
        ahead, behind = objective.residuals(np.stack([theta + step, theta - step]))
        quotient = (ahead - behind) / (2.0 * step[column])
        assert np.linalg.norm(own - quotient) <= 1e-5 * np.linalg.norm(quotient)


LAWS = {
    "c": "monotone:0,0.5,0.8,1",
    "k": "linear:0,1",
    "k_w": "tanh:0,1",
    "rho": "straight_log:0,0.4,1",
    "sigma": "exponential",
}


@pytest.mark.parametrize("lag", DRIVER_RATES)
def test_normal_equations_at_constant_commands_are_the_products_of_the_jacobian(
    test: DamperTest, lag: Lag
) -> None:
    model = SPEC.with_current_laws(LAWS, lag=lag)
    rows = model.nominal * np.exp(0.1 * np.random.default_rng(6).standard_normal((3, len(model.names))))
    # A law that leaves its range, which has no slope there.
    rows[2, [model.names.index(f"sigma.{number}") for number in range(3)]] = -1e3, 0.5, 0.3
    # Commands that vary leave the laws to the simulation.
    ramp = np.linspace(0.0, 1.0, test.n_time)
    tests = tuple(
        replace(
            test, name=f"test {number}", current=current, observation=Observation(average_seconds=5 * test.dt)
        )
        for number, current in enumerate((0.0, 0.7, 1.2, ramp))
    )
    objective = Objective.of(model, tests)
    box = mr.Box.of(model).with_bounds({"n": (2.0, 2.0), "rho@0A": (1e3, 1e3)})
    included = np.array([[True] * 4, [True, False, True, True], [True] * 4])
    equations = NormalEquations.at(objective, box, rows, included)
    for index, each in enumerate(tests):
        alone = Objective.of(model, (each,))
        residuals, jacobian = linearise_residuals(alone, rows, box.free)
        for row in np.flatnonzero(included[:, index]):
            matrix = jacobian[row] @ jacobian[row].T
            scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
            difference = np.abs(equations.matrix[row, index] - matrix)
            assert np.all(difference <= 1e-9 * np.maximum(scale, np.finfo(float).tiny))
            pull = jacobian[row] @ residuals[row]
            size = np.sqrt(np.diag(matrix)) * np.linalg.norm(residuals[row])
            assert np.all(np.abs(equations.gradient[row, index] - pull) <= 1e-9 * size)
            assert equations.squared[row, index] == pytest.approx(residuals[row] @ residuals[row], rel=1e-9)


def test_tests_side_by_side_give_the_bits_of_one_after_the_other(test: DamperTest) -> None:
    tests = tuple(replace(test, name=str(index), force=(1.0 + index) * test.force) for index in range(5))
    one = linearise_residuals(Objective.of(SPEC, tests, threads=1), rows(3), [0, 3])
    for threads in (0, 3):
        several = linearise_residuals(Objective.of(SPEC, tests, threads=threads), rows(3), [0, 3])
        for left, right in zip(one, several, strict=True):
            np.testing.assert_array_equal(left, right)


def test_a_failed_row_has_residuals_of_one_and_no_slope(test: DamperTest) -> None:
    theta = rows(4)
    theta[1] = np.nan
    objective = Objective.of(SPEC, (test,), FitSettings(observe="offset=each"))
    residuals, jacobian = linearise_residuals(objective, theta, [0, 1])
    assert np.all(residuals[1] == 1.0)
    assert np.all(jacobian[1] == 0.0)
    clean = linearise_residuals(objective, theta[[0, 2]], [0, 1])
    np.testing.assert_allclose(jacobian[[0, 2]], clean[1], rtol=1e-12)


def test_simulated_force_has_zero_residuals(test: DamperTest) -> None:
    loading = mr.Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity)
    own = replace(test, force=mr.simulate_force(SPEC, SPEC.nominal, loading))
    residuals, _ = linearise_residuals(Objective.of(SPEC, (own,)), SPEC.nominal[None], [0])
    assert np.all(residuals == 0.0)


def test_a_force_exponent_of_zero_compares_errors_in_newtons(test: DamperTest) -> None:
    tests, theta = (test, other(test)), rows(2)
    in_newtons = np.zeros(len(theta))
    for each in Objective.of(SPEC, tests).compared:
        residuals, _ = each.residuals(theta)
        in_newtons += np.mean(residuals**2, axis=1)
    weighted = Objective.of(SPEC, tests, FitSettings(force_exponent=0.0))
    ratio = weighted(theta) ** 2 / in_newtons
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)
    assert np.array_equal(weighted.on(SPEC, tests[:1])(theta), Objective.of(SPEC, tests[:1])(theta))


def test_jacobian_has_the_weights_of_a_force_exponent(test: DamperTest) -> None:
    assert_exact(Objective.of(SPEC, (test, other(test)), FitSettings(force_exponent=0.5)), rows(1))


def given_tests(count: int) -> tuple[DamperTest, ...]:
    whole = mr.synthetic_test("spencer1997")
    return tuple(
        replace(
            cut(whole, end=0.3 + 0.1 * number),
            name=f"test {number}",
            force=(1.0 + number) * cut(whole, end=0.3 + 0.1 * number).force,
        )
        for number in range(count)
    )


def with_one_unresolved() -> np.ndarray:
    theta = rows(3, 5)
    # One that no simulation resolves.
    theta[2, SPEC.names.index("rho")] = 0.9 * SPEC.parameters[SPEC.names.index("rho")].upper
    return theta


@pytest.mark.parametrize("each", [(), ("offset",)])
@pytest.mark.parametrize("n_tests", [1, 5])
def test_threads_change_no_bit_of_an_objective(n_tests: int, each: tuple[str, ...]) -> None:
    tests, theta = given_tests(n_tests), with_one_unresolved()
    alone, *several = (
        Objective.of(SPEC, tests, settings_with(each), threads=threads) for threads in (1, 0, 2, 3)
    )
    for objective in several:
        np.testing.assert_array_equal(objective(theta), alone(theta))
        np.testing.assert_array_equal(objective.squared_nrmse(theta), alone.squared_nrmse(theta))
        np.testing.assert_array_equal(objective.residuals(theta), alone.residuals(theta))
        for run, expected in zip(objective.misfits(theta), alone.misfits(theta), strict=True):
            np.testing.assert_array_equal(run.squared_error, expected.squared_error)
    assert len({(each.tally.simulations, each.tally.steps) for each in several}) == 1


@pytest.mark.parametrize("n_tests", [1, 2, 3, 7])
@pytest.mark.parametrize("threads", [1, 2, 4])
def test_results_are_in_the_order_of_the_tests_and_no_thread_is_idle(n_tests: int, threads: int) -> None:
    given = on_every_test(n_tests, threads, lambda index, own: (index, own))
    assert [index for index, _ in given] == list(range(n_tests))
    # Tests that are left over share the threads.
    for index, own in given:
        left_over = n_tests % threads
        is_left_over = threads > 1 and index >= n_tests - left_over
        assert own == (threads // left_over if is_left_over else 1 if n_tests > 1 else threads)


def test_the_error_of_the_first_test_that_fails_is_raised() -> None:
    def work(index: int, threads: int) -> int:
        if index in (1, 2):
            raise mr.errors.SettingError(f"test {index}")
        return threads

    for _ in range(20):
        with pytest.raises(mr.errors.SettingError, match="test 1"):
            on_every_test(6, 3, work)
