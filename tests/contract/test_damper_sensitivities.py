"""Forward sensitivities of every model: the force to the bit, the derivatives of the twin, and of the kernel itself."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from damper_samples import DT, noise, random_theta, sine
from refusals import refusal
from test_damper_batch import assert_same_bits
from test_damper_current_laws import followed, stepped_command, theta_of, with_laws
from test_damper_twin import OF_STATES

from mrwork.dampers.simulation import Loading, Outcome, simulate_forces, simulate_sensitivities
from mrwork.twins.model_twins import parameters_at
from mrwork.twins.record_arrays import RecordArrays
from mrwork.twins.stepping import simulate

MOST_SUBSTEPS = 16

# Derivatives of the first instruction set in which a model has run.
OF_BATCH: dict[str, np.ndarray] = {}


@pytest.fixture(scope="module")
def history():
    return noise().history()


@pytest.fixture(scope="module")
def theta(spec, history):
    """Candidates whose sub-steps differ, in random order, with the nominal one among them."""
    candidates = np.vstack([spec.nominal, random_theta(spec, 60, rng=31)])
    return candidates[simulate_forces(spec, candidates, history).substeps <= MOST_SUBSTEPS][:20]


# The chain rule of laws and lag does not know the model but for its states; each wants a compilation.
@pytest.mark.parametrize("spec", OF_STATES.values(), ids=lambda spec: spec.name)
def test_coefficients_of_laws_and_the_lag_are_differentiated_too(spec):
    model = with_laws(spec, lag="two_rates")
    theta = theta_of(model)
    history = replace(sine(), command=stepped_command(), command_unit="A").history()
    run = simulate_sensitivities(model, theta[None], history)
    assert_same_bits(run.force, simulate_forces(model, theta[None], history).force)
    record, substeps = RecordArrays.of(history), int(run.substeps[0])
    jacobian = jax.jit(jax.jacfwd(lambda theta: simulate(model, theta, record, substeps)))
    expected = np.asarray(jacobian(theta)).T
    error, norm = (np.linalg.norm(each, axis=1) for each in (run.jacobian[0] - expected, expected))
    # Columns that the force does not feel are let be.
    felt = norm * np.abs(theta) > 1e-12 * np.linalg.norm(run.force[0])
    assert np.all(error[felt] <= 1e-8 * norm[felt])


def test_at_a_held_command_coefficients_have_the_derivatives_of_their_parameters(spec):
    # f(a, b) = F(a + b u): the derivative with respect to a is that of the plain model, to b that times u.
    model = spec.with_current_laws(dict.fromkeys(followed(spec), "linear"))
    theta = theta_of(model)
    u = 0.6
    plain = np.array(parameters_at(model, theta, u))
    inner = simulate_sensitivities(spec, plain[None], sine().history()).jacobian[0]
    history = replace(sine(), command=u, command_unit="A").history()
    outer = simulate_sensitivities(model, theta[None], history).jacobian[0]
    for own, name in zip(outer, model.names, strict=True):
        parameter, _, power = name.partition(".")
        expected = inner[spec.names.index(parameter)] * u ** int(power or 0)
        # The laws are fused here and not there: parameters one rounding apart.
        assert np.linalg.norm(own - expected) <= 1e-9 * np.linalg.norm(expected)


def test_rows_are_those_of_plain_simulations_and_independent_of_batch_and_instruction_set(
    spec, theta, history, instruction_set
):
    batch, plain = simulate_sensitivities(spec, theta, history), simulate_forces(spec, theta, history)
    assert_same_bits(batch.force, plain.force)
    np.testing.assert_array_equal(batch.substeps, plain.substeps)
    np.testing.assert_array_equal(batch.outcome, plain.outcome)
    assert_same_bits(batch.jacobian, OF_BATCH.setdefault(spec.name, batch.jacobian))
    for index in (0, 7, len(theta) - 1):
        alone = simulate_sensitivities(spec, theta[index][None], history)
        assert_same_bits(alone.force[0], batch.force[index])
        assert_same_bits(alone.jacobian[0], batch.jacobian[index])


def test_threads_give_the_same_bits(spec, history):
    # Above the 60 000 steps from which a second thread is worth waking, also for a model without sub-steps.
    theta = random_theta(spec, 80, rng=32)
    one, three = (simulate_sensitivities(spec, theta, history, threads=threads) for threads in (1, 3))
    assert_same_bits(three.force, one.force)
    assert_same_bits(three.jacobian, one.jacobian)
    np.testing.assert_array_equal(three.substeps, one.substeps)


def test_only_the_columns_asked_for_are_there(spec, theta, history, instruction_set):
    whole = simulate_sensitivities(spec, theta, history)
    last = len(spec.parameters) - 1
    # Where all of them enter the force only, the states are those of a plain simulation.
    for columns in ([], *([column] for column in range(last)), [last, 0]):
        part = simulate_sensitivities(spec, theta, history, columns=columns)
        assert_same_bits(part.force, whole.force)
        assert_same_bits(part.jacobian, whole.jacobian[:, columns])
    refusal(simulate_sensitivities, spec, theta, history, columns=[last + 1], match=f"column {last + 1} of")


def test_derivatives_are_finite_where_the_loop_starts_and_at_the_lowest_exponent(spec):
    # |w|^n at w = 0: n x^(n-1) is 1 or 0 there, x^n ln x is 0.
    lowest = np.array([p.lower if p.name == "n" else p.nominal for p in spec.parameters])
    # Sampled finely enough for every nominal set.
    still = Loading(dt=DT, displacement=np.zeros(50)).history()
    for row in (spec.nominal, lowest):
        for history in (still, sine(n_time=50, dt=0.05 * DT).history()):
            run = simulate_sensitivities(spec, row[None], history)
            assert run.outcome[0] == Outcome.FINISHED
            assert np.all(np.isfinite(run.jacobian))


def test_whole_and_broken_exponents_have_derivatives_that_meet(spec, history):
    # Exactly 1, 2 and 3 are products, the others exponentials: the derivative must not know.
    if "n" not in spec.names:
        return
    index = spec.names.index("n")
    for n in (2.0, 3.0):
        rows = np.repeat(spec.nominal[None], 3, axis=0)
        rows[:, index] = n * (1.0 + np.array([-1e-9, 0.0, 1e-9]))
        below, at, above = simulate_sensitivities(spec, rows, history).jacobian
        size = np.linalg.norm(at, axis=1)
        assert np.all(np.linalg.norm(0.5 * (below + above) - at, axis=1) <= 1e-6 * size)


def test_a_failed_row_is_infinite_and_leaves_its_neighbours_alone(spec, theta, history):
    clean = simulate_sensitivities(spec, theta, history)
    broken = theta.copy()
    broken[::3] = np.nan
    run = simulate_sensitivities(spec, broken, history)
    failed = np.arange(len(theta)) % 3 == 0
    assert np.all(np.isin(run.outcome[failed], [Outcome.DIVERGED, Outcome.UNRESOLVED]))
    assert np.all(np.isposinf(run.force[failed]))
    assert np.all(np.isposinf(run.jacobian[failed]))
    assert_same_bits(run.jacobian[~failed], clean.jacobian[~failed])


def test_empty_batch_has_empty_results(spec, history):
    n_params = len(spec.parameters)
    run = simulate_sensitivities(spec, np.empty((0, n_params)), history)
    assert run.force.shape == (0, history.n_time)
    assert run.jacobian.shape == (0, n_params, history.n_time)
