"""Residuals and misfits as functions of JAX: values and derivatives of `mr.objective`, whatever its pipeline has."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from posterior_samples import MODEL, small_test
from refusals import refusal

import mrwork as mr
from mrwork.identification import CandidateObjective

TESTS = (small_test(), small_test(7, 90))
FIRST, SECOND = mr.damper(MODEL).names[:2]
PIPELINES: dict[str, dict[str, Any]] = {
    "tied, offset, gain and delay": {
        "ties": {FIRST: f"3*{SECOND}/2 + {SECOND}**0.5"},
        "observe": ["offset=each", "gain=each", "delay=each"],
        "force_exponent": 0.5,
    },
    "held, weights and masks": {
        "bounds": {FIRST: (2400.0, 2400.0)},
        "weights": [np.linspace(0.0, 2.0, 150), None],
        "masks": [np.arange(150) % 7 != 0, None],
    },
    "huber, late": {"loss": "huber", "loss_scale": 30.0, "observe": "delay=0.011"},
    "cauchy, early and averaged": {
        **{"loss": "cauchy", "loss_scale": 30.0},
        "observe": ["delay=-0.011", "average=0.07"],
    },
    "soft_l1, lagging": {"loss": "soft_l1", "loss_scale": 30.0, "observe": "lag=0.02"},
    "arctan, low-passed": {"loss": "arctan", "loss_scale": 30.0, "observe": "lowpass=9"},
}


def objective_of(**pipeline: Any) -> CandidateObjective:
    return mr.objective(MODEL, TESTS, **pipeline)


def place(objective: CandidateObjective) -> np.ndarray:
    """A point off the middle of the search box."""
    unit = np.linspace(0.35, 0.6, len(objective.names))
    theta = objective.box.theta_from_unit(unit)
    return np.asarray(objective.box.points_from(theta, objective.coordinates))


def are_close(found: Any, expected: Any, share: float = 1e-12) -> bool:
    expected = np.asarray(expected)
    return bool(np.all(np.abs(np.asarray(found) - expected) <= share * np.abs(expected).max()))


@pytest.mark.long
@pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)
def test_value_gradient_and_jacobian_are_those_of_the_objective(pipeline: dict[str, Any]) -> None:
    objective = objective_of(**pipeline)
    point = place(objective)
    misfit, residuals = mr.jax.misfit(objective), mr.jax.residuals(objective)
    value, gradient = jax.value_and_grad(misfit)(jnp.asarray(point))
    assert are_close(value, objective(point))
    assert are_close(gradient, objective.gradient(point))
    assert are_close(residuals(point), objective.residuals(point))
    jacobian, expected = jax.jacrev(residuals)(jnp.asarray(point)), objective.jacobian(point)
    assert all(are_close(*columns) for columns in zip(jacobian.T, expected.T, strict=True))


@pytest.mark.parametrize("coordinates", ["theta", "unit", "latent"])
def test_points_bounds_and_start_are_those_of_the_objective(coordinates: Any) -> None:
    objective = objective_of(coordinates=coordinates)
    misfit = mr.jax.misfit(MODEL, TESTS, coordinates=coordinates)
    assert misfit.names == objective.names
    assert np.array_equal(misfit.lower, objective.lower)
    assert np.array_equal(misfit.upper, objective.upper)
    assert np.array_equal(misfit.start, objective.start)
    assert np.isfinite(misfit.start).all()
    point = place(objective)
    assert are_close(misfit(point), objective(point))
    assert are_close(jax.grad(misfit)(jnp.asarray(point)), objective.gradient(point))
    step = 1e-6 * np.maximum(np.abs(point), 1.0)
    ends = [[objective(point + side * row) for row in np.diag(step)] for side in (1.0, -1.0)]
    differences = (np.array(ends[0]) - ends[1]) / (2.0 * step)
    assert are_close(objective.gradient(point), differences, 1e-6)


def test_derivatives_on_a_face_of_the_cube_are_whole() -> None:
    objective = objective_of(coordinates="unit")
    corner = np.zeros(len(objective.names))
    assert are_close(
        jax.grad(mr.jax.misfit(objective))(jnp.asarray(corner)), objective.gradient(corner), 1e-9
    )


def test_a_point_outside_the_cube_or_that_fails_has_an_infinite_misfit_with_a_gradient_of_zero() -> None:
    misfit, residuals = (kind(MODEL, TESTS, coordinates="unit") for kind in (mr.jax.misfit, mr.jax.residuals))
    outside = jnp.full(len(misfit.names), 0.5).at[0].set(1.1)
    assert misfit(outside) == np.inf
    assert not np.asarray(jax.grad(misfit)(outside)).any()
    assert np.all(residuals(outside) == 1.0)
    assert not np.asarray(jax.jacrev(residuals)(outside)).any()
    physical = mr.jax.misfit(MODEL, TESTS)
    stiff = jnp.asarray(physical.start).at[physical.names.index("rho")].set(1e12)
    both = jnp.stack([jnp.asarray(physical.start), stiff])
    values, gradients = jax.vmap(jax.value_and_grad(physical))(both)
    assert np.isfinite(values[0])
    assert values[1] == np.inf
    assert not np.asarray(gradients[1]).any()
    assert are_close(gradients[0], objective_of().gradient(np.asarray(both[0])))


def test_a_perfect_fit_has_a_gradient_of_zero() -> None:
    spec = mr.damper("bingham")
    exact = mr.synthetic_test("spencer1997")
    perfect = mr.test_from_arrays(
        time=exact.time,
        displacement=exact.displacement,
        velocity=exact.velocity,
        force=mr.simulate(spec, spec.nominal, exact),
    )
    misfit = mr.jax.misfit(mr.objective(spec, perfect, observe="none"))
    value, gradient = jax.value_and_grad(misfit)(jnp.array(spec.nominal))
    assert value == 0.0
    assert not np.asarray(gradient).any()
    given = mr.objective(spec, [perfect, exact])
    found = jax.jacfwd(mr.jax.residuals(given))(jnp.array(spec.nominal))
    assert are_close(found, given.jacobian(np.array(spec.nominal)))


def test_a_tie_that_leaves_its_bounds_fails() -> None:
    objective = objective_of(ties={FIRST: f"1e9*{SECOND}"})
    misfit = mr.jax.misfit(objective)
    assert misfit(place(objective)) == objective(place(objective)) == np.inf


def test_many_points_have_many_values() -> None:
    misfit, objective = mr.jax.misfit(MODEL, TESTS), objective_of()
    points = place(objective) * np.random.default_rng(0).uniform(0.9, 1.1, (2, 3, len(objective.names)))
    values = misfit(points)
    assert values.shape == (2, 3)
    assert are_close(values[1], objective(points[1]))


def test_objectives_that_jax_cannot_have_are_refused() -> None:
    refusal(mr.jax.misfit, "bingham", match="`tests` are missing")
    refusal(mr.jax.residuals, objective_of(), TESTS, match="leave `tests` out")
    by_numpy = {"loss": lambda z: np.stack([z, 1.0 + 0.0 * z]), "loss_scale": 1.0}
    refusal(mr.jax.misfit, mr.objective("bingham", small_test(), **by_numpy), match="function in NumPy")
