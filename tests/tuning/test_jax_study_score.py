"""The score of a study as a function of JAX: value and derivatives of the loop, in every way that JAX asks for them."""

import math
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tuning_samples
from refusals import refusal

import mrwork as mr
from mrwork.study import TuneTable
from mrwork.tuning.tuning_run import plan_of

LAW = "proportional_direct"
# The building of two storeys has a gain of one number in a setting, and its designs take no time.
MOTION = tuning_samples.motion("A", 1).replace("duration = 3", "duration = 1")


def study() -> mr.Study:
    return tuning_samples.study_with(motions=MOTION, tune="", building=tuning_samples.TWO_STOREYS)


@cache
def score_of(coordinates: Any = "unit") -> mr.jax.StudyScore:
    return mr.jax.study_score(study(), LAW, coordinates=coordinates, threads=1)


def place() -> jax.Array:
    return jnp.array(score_of().start) * 0.9


def test_value_and_gradient_are_those_of_the_loop() -> None:
    plan = plan_of(study(), TuneTable(laws=(LAW,)), 1)
    names = [each.label for each in plan.space.free if each.name != "largest_command"]
    assert list(score_of().names) == names
    unit = np.append(np.asarray(place()), 0.99)
    value, expected = plan.slopes(unit)
    found = jax.value_and_grad(score_of())(place())
    assert float(found[0]) == pytest.approx(value, rel=1e-12)
    np.testing.assert_allclose(found[1], expected[: len(names)], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("coordinates", ["theta", "unit", "latent"])
def test_a_study_with_the_law_of_a_point_has_its_score(coordinates: Any, tmp_path: Path) -> None:
    """To the bit; what the function holds, the weight of the drifts, is shown and among the settings."""
    score = score_of(coordinates)
    point = 0.93 * jnp.array(score.start)
    assert "drifts 1" in score.held
    assert score.held in str(score)
    settings = score.settings(point)
    assert settings["drifts"] == 1.0
    assert score.law(point) == {"law": LAW, "settings": settings}
    numbers = ", ".join(f"{name} = {value!r}" for name, value in settings.items())
    law = f'[[controller]]\nlaw = "{LAW}"\nlabel = "found"\nsettings = {{ {numbers} }}\n'
    text = tuning_samples.study_file(tmp_path, motions=MOTION, tune=law, building=tuning_samples.TWO_STOREYS)
    results = mr.run_study(mr.read_study(text))
    row = next(number for number, each in enumerate(results.rows) if each.label == "found")
    assert results.score(row).mean == float(score(point))


def test_a_point_without_a_law_has_no_settings() -> None:
    for point in (place() * 0.0 + 1.5, place() * jnp.nan, jnp.stack([place(), place()])):
        refusal(score_of().settings, point, match="not one inside the ranges")


@pytest.mark.parametrize("coordinates", ["theta", "latent"])
def test_other_coordinates_have_the_derivatives_of_the_chain_rule(coordinates: Any) -> None:
    score = score_of(coordinates)
    point = jnp.array(score.start)
    step = 1e-5 * jnp.maximum(jnp.abs(point), 1.0 if coordinates == "latent" else 0.0)
    found = jax.grad(score)(point)
    largest = float(jnp.abs(found * step).max())
    for index in range(len(point)):
        moves = step[index] * jnp.eye(len(point))[index]
        difference = (score(point + moves) - score(point - moves)) / (2.0 * step[index])
        assert float(found[index] * step[index]) == pytest.approx(
            float(difference * step[index]), abs=1e-6 * largest
        )


@pytest.mark.long
def test_it_goes_through_every_transformation() -> None:
    score, points = score_of(), jnp.stack([place(), 0.8 * place(), 0.7 * place()])
    values, gradients = jax.jit(jax.vmap(jax.value_and_grad(score)))(points)
    for point, value, gradient in zip(points, values, gradients, strict=True):
        alone = jax.value_and_grad(score)(point)
        assert float(alone[0]) == float(value)
        np.testing.assert_array_equal(alone[1], gradient)
    forward, backward = (way(score)(place()) for way in (jax.jacfwd, jax.jacrev))
    np.testing.assert_allclose(forward, backward, rtol=1e-12)
    _, along = jax.lax.scan(lambda carry, point: (carry, score(point)), 0.0, points)
    np.testing.assert_array_equal(along, values)
    nested = jax.vmap(jax.vmap(score))(points[None])
    # Candidates side by side differ from one alone by rounding.
    np.testing.assert_allclose(nested[0], values, rtol=1e-12)
    assert jax.vmap(score)(points[:0]).shape == (0,)


def test_points_outside_the_ranges_have_an_infinite_score_and_no_slope() -> None:
    physical = score_of("theta")
    beyond = jnp.array(physical.upper) * (1.0 + 1e-6)
    for score, point in (
        (score_of(), place() * 0.0 + 1.5),
        (score_of(), place() * jnp.nan),
        (physical, beyond),
    ):
        value, gradient = jax.value_and_grad(score)(point)
        assert value == score(point) == math.inf
        assert not np.asarray(gradient).any()


def test_threads_of_python_at_once_have_the_same_bits() -> None:
    both = jax.jit(jax.value_and_grad(score_of()))
    alone = both(place())
    with ThreadPoolExecutor(8) as pool:
        for value, gradient in pool.map(both, [place()] * 24):
            assert value == alone[0]
            np.testing.assert_array_equal(gradient, alone[1])


def test_what_has_no_derivative_is_refused_by_name() -> None:
    refusal(mr.jax.study_score, study(), "clipped_optimal", match="clipped_optimal switches")
    refusal(mr.jax.study_score, study(), TuneTable(laws=(LAW, "active")), match="2 laws")
    refusal(jax.hessian(score_of()), place(), match="differences of gradients")
