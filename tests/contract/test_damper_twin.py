"""The JAX twin is the Rust model: same names, same numbers, same trajectories, differentiable throughout."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from damper_samples import DT, noise, random_theta

from mrwork import _rust
from mrwork.dampers import damper_models
from mrwork.dampers.simulation import Loading, simulate_forces, simulate_sensitivities
from mrwork.twins.model_twins import twin_of
from mrwork.twins.record_arrays import RecordArrays
from mrwork.twins.stepping import simulate

# Sub-steps beyond this only make the twin slow, they exercise no other line of it.
SUBSTEPS_TO_COMPARE = 32


@pytest.fixture(scope="module")
def trajectory(spec):
    return jax.jit(lambda theta, record, substeps: simulate(spec, theta, record, substeps), static_argnums=2)


@pytest.fixture(scope="module")
def jacobian(spec):
    forward = jax.jacfwd(lambda theta, record, substeps: simulate(spec, theta, record, substeps))
    return jax.jit(forward, static_argnums=2)


def rows_to_compare(spec, history, n_random):
    """The nominal set and random ones, with its sub-steps or the next commonest: each wants a compilation."""
    theta = np.vstack([spec.nominal, random_theta(spec, 64, rng=3)])
    substeps = simulate_forces(spec, theta, history).substeps
    few = substeps[(substeps > 0) & (substeps <= SUBSTEPS_TO_COMPARE) & (substeps != substeps[0])]
    numbers, rows = np.unique(few, return_counts=True)
    return theta[np.isin(substeps, [substeps[0], *numbers[np.argsort(-rows)][:1]])][: n_random + 1]


def test_rate_and_force_agree_at_random_points(spec):
    # Terms of a rate cancel as the loop saturates, so agreement is measured against the largest rate over
    # the states at the same parameters and motion. States run over four decades, both signs.
    rng = np.random.default_rng(11)
    twin = twin_of(spec)
    n_theta, n_states = 40, 12
    magnitude = 10.0 ** rng.uniform(-4.0, 0.3, (n_theta, n_states, spec.n_states))
    states = magnitude * rng.choice([-1.0, 1.0], magnitude.shape)
    motions = rng.normal(size=(n_theta, 2)) * [0.01, 0.2]
    theta = random_theta(spec, n_theta, rng=12)

    def equations(theta, state, motion):
        p = twin.Theta(*theta)
        return twin.rate(p, state, *motion), twin.force(p, state, *motion)

    at_states = jax.jit(jax.vmap(equations, in_axes=(None, 0, None)))
    for row, motion, points in zip(theta, motions, states, strict=True):
        rates = np.array([_rust.rate(spec.name, row, state, *motion) for state in points])
        twin_rates, twin_forces = map(np.asarray, at_states(row, points, motion))
        assert np.max(np.abs(twin_rates - rates), initial=0.0) <= 1e-12 * np.max(np.abs(rates), initial=0.0)
        forces = np.array([_rust.force(spec.name, row, state, *motion) for state in points])
        assert np.max(np.abs(twin_forces - forces)) <= 1e-12 * np.max(np.abs(forces))


def test_trajectories_agree(spec, motion, trajectory):
    history = motion.history()
    theta = rows_to_compare(spec, history, 4)
    assert len(theta) == 5
    run = simulate_forces(spec, theta, history)
    for row, force, substeps in zip(theta, run.force, run.substeps, strict=True):
        twin_force = np.asarray(trajectory(row, RecordArrays.of(history), int(substeps)))
        assert np.max(np.abs(twin_force - force)) <= 1e-10 * np.max(np.abs(force))


def test_derivative_is_that_of_the_kernel(spec, jacobian):
    # Both differentiate the same steps, so only rounding is between them; a stiff loop near a kink magnifies it.
    history = noise().history()
    rows = rows_to_compare(spec, history, 6)
    run = simulate_sensitivities(spec, rows, history)
    # Those that take as many sub-steps as the nominal one, for which the twin is compiled.
    for k in np.flatnonzero(run.substeps == run.substeps[0]):
        expected = np.asarray(jacobian(rows[k], RecordArrays.of(history), int(run.substeps[0]))).T
        error, norm = (np.linalg.norm(each, axis=1) for each in (run.jacobian[k] - expected, expected))
        # Columns that the force does not feel are let be.
        felt = norm * np.abs(rows[k]) > 1e-12 * np.linalg.norm(run.force[k])
        assert np.all(error[felt] <= 1e-8 * norm[felt])


@pytest.fixture(scope="module")
def slopes_at_the_start(spec):
    """Derivatives of rate and force at rest, backward; a simulation, above, has those forward."""
    twin = twin_of(spec)
    state = jnp.zeros(spec.n_states)

    def both(theta, state, velocity):
        p = twin.Theta(*theta)
        return twin.rate(p, state, 0.0, velocity), twin.force(p, state, 0.0, velocity)

    return jax.jit(lambda theta, velocity: jax.jacrev(both, argnums=(0, 1))(theta, state, velocity))


@pytest.mark.parametrize("velocity", [0.0, 0.1, -0.1])
def test_derivatives_are_finite_where_the_loop_starts(spec, slopes_at_the_start, velocity):
    # |w|^n has an infinite derivative in n, and a kink in w, at w = 0: every simulation starts there.
    lowest = np.array([parameter.lower for parameter in spec.parameters])
    for theta in (spec.nominal, lowest):
        for derivative in jax.tree.leaves(slopes_at_the_start(theta, velocity)):
            assert np.all(np.isfinite(derivative))


def test_derivative_of_a_damper_that_never_moves_is_finite(spec, jacobian):
    history = noise().history()
    substeps = int(simulate_forces(spec, spec.nominal[None], history).substeps[0])
    # As many sub-steps as of the motion above, for which this is compiled.
    record = RecordArrays.of(history)
    still = record._replace(splines=0.0 * record.splines, facts=record.facts.at[1:].set(0.0))
    assert np.all(np.isfinite(jacobian(jnp.array(spec.nominal), still, substeps)))


# The step is differentiated by JAX, whatever the model, whose own equations are above: a compilation of a small one.
_SMALLEST_LAST = sorted(damper_models(), key=lambda spec: -len(spec.parameters))
OF_STATES = {spec.n_states: spec for spec in _SMALLEST_LAST}


@pytest.mark.parametrize("spec", OF_STATES.values(), ids=lambda spec: spec.name)
def test_gradients_side_by_side_trace_once_and_are_those_of_the_kernel(spec):
    traces = 0
    history = Loading(dt=DT, displacement=noise().displacement[:60]).history()
    theta = random_theta(spec, 64, rng=8)
    run = simulate_sensitivities(spec, theta, history)
    numbers, rows = np.unique(run.substeps[run.substeps > 0], return_counts=True)
    chosen = np.flatnonzero(run.substeps == numbers[np.argmax(rows)])[:4]
    assert len(chosen) == 4
    theta, record, substeps = theta[chosen], RecordArrays.of(history), int(run.substeps[chosen[0]])

    def energy(theta, record):
        nonlocal traces
        traces += 1
        return jnp.sum(simulate(spec, theta, record, substeps) ** 2)

    gradients = jax.jit(jax.vmap(jax.grad(energy), in_axes=(0, None)))
    first = gradients(theta, record)
    second = gradients(theta[::-1], record)
    assert traces == 1
    gradients(theta, record._replace(splines=0.5 * record.splines))
    assert traces == 1
    np.testing.assert_allclose(first, second[::-1], rtol=1e-12)
    assert np.all(np.isfinite(first))
    assert np.any(first != 0.0)
    force, jacobian = run.force[chosen], run.jacobian[chosen]
    kernel = 2.0 * np.einsum("bt,bpt->bp", force, jacobian)
    # A parameter that this motion does not feel has a gradient of rounding only; terms of a sum cancel.
    size = 2.0 * np.einsum("bt,bpt->bp", np.abs(force), np.abs(jacobian))
    rounding = 1e-12 * np.sum(force**2, axis=1)[:, None] / np.abs(theta)
    assert np.all(np.abs(first - kernel) <= 1e-8 * size + rounding)
