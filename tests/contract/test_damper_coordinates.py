"""theta, unit and latent coordinates are one and the same point, on NumPy and on JAX.

The maps go coordinate by coordinate, and JAX compiles each operation once for each shape: on NumPy the models are gone
through one after the other, on JAX all at once, their parameters side by side.
"""

from dataclasses import replace

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from examples import examples
from hypothesis import given
from refusals import refusal

import mrwork.twins.model_twins  # noqa: F401  (sets double precision)
from mrwork.dampers import Box, damper_models

SIDE_BY_SIDE = replace(
    damper_models()[0],
    name="all_side_by_side",
    parameters=tuple(
        replace(parameter, name=f"{spec.name}.{parameter.name}")
        for spec in damper_models()
        for parameter in spec.parameters
    ),
)


def boxes(spec):
    """The admissible box, one with a parameter held fixed, and one narrowed around the nominal value."""
    whole = Box.of(spec)
    last = spec.parameters[-1]
    fixed = whole.with_bounds({last.name: (last.nominal, last.nominal)})
    narrowed = {}
    for parameter in spec.parameters:
        around = sorted((0.5 * parameter.nominal, 2.0 * parameter.nominal))
        if around[0] < around[1]:
            narrowed[parameter.name] = (max(around[0], parameter.lower), min(around[1], parameter.upper))
    return {"whole": whole, "one fixed": fixed, "narrowed": whole.with_bounds(narrowed)}


@pytest.fixture(params=["whole", "one fixed", "narrowed"])
def box(request, spec):
    return boxes(spec)[request.param]


@pytest.fixture
def xp(spec):
    return jnp if spec is SIDE_BY_SIDE else np


on_numpy_and_jax = pytest.mark.parametrize(
    "spec", [*damper_models(), SIDE_BY_SIDE], ids=lambda spec: spec.name
)
on_jax = pytest.mark.parametrize("spec", [SIDE_BY_SIDE], ids=["all_side_by_side"])


# Of every batch.
N_BATCH = 50


def units(box):
    return np.random.default_rng(51).uniform(0.001, 0.999, (N_BATCH, len(box.free)))


@on_numpy_and_jax
def test_theta_stays_in_the_box_to_the_last_bit(box, xp):
    n_free = len(box.free)
    faces = np.vstack([np.zeros(n_free), np.ones(n_free), units(box)[2:]])
    theta = np.asarray(box.theta_from_unit(xp.asarray(faces)))
    assert np.all((theta >= box.lower) & (theta <= box.upper))
    held = np.equal(box.lower, box.upper)
    assert np.sum(~held) == n_free
    np.testing.assert_array_equal(theta[:, held], np.tile(np.array(box.lower)[held], (N_BATCH, 1)))
    latent = np.linspace(-800.0, 800.0, N_BATCH)[:, None] * np.ones(n_free)
    far = np.asarray(box.theta_from_latent(xp.asarray(latent)))
    assert np.all((far >= box.lower) & (far <= box.upper))
    np.testing.assert_allclose(far[[0, -1]], [box.lower, box.upper], rtol=1e-12)


def test_unit_is_even_in_the_scale_of_the_parameter(spec):
    box = Box.of(spec)
    middle = box.theta_from_unit(np.full(len(box.free), 0.5))
    for parameter, value in zip(spec.parameters, middle, strict=True):
        if parameter.scale == "log":
            assert value == pytest.approx(np.sqrt(parameter.lower * parameter.upper), rel=1e-12)
        else:
            middle_value = 0.5 * (parameter.lower + parameter.upper)
            assert value == pytest.approx(middle_value, abs=1e-15 * parameter.upper)


@on_numpy_and_jax
def test_points_on_the_faces_are_pulled_to_where_latent_is_finite(box, xp):
    faces = xp.asarray(np.tile([box.lower, box.upper], (N_BATCH // 2, 1)))
    inside = box.inside(faces)
    assert np.all(np.isfinite(box.latent_from_theta(inside)))
    assert np.all((np.asarray(inside) >= box.lower) & (np.asarray(inside) <= box.upper))
    theta = xp.asarray(box.theta_from_unit(units(box)))
    span = np.subtract(box.upper, box.lower)
    allowed = np.where(box.log, 1e-13 * np.abs(theta), 1e-15 * span)
    assert np.all(np.abs(box.inside(theta) - theta) <= allowed), "inner points stay"


@on_numpy_and_jax
def test_log_slope_is_finite_far_out(box, xp):
    far = np.linspace(-500.0, 500.0, N_BATCH)[:, None] * np.ones(len(box.free))
    assert np.all(np.isfinite(box.log_slope(xp.asarray(far))))


@on_jax
def test_numpy_and_jax_agree_and_stay_what_they_are(box):
    unit = units(box)
    theta = box.theta_from_unit(unit)
    latent = box.latent_from_theta(theta)
    for method, argument in (
        (box.theta_from_unit, unit),
        (box.unit_from_theta, theta),
        (box.latent_from_theta, theta),
        (box.theta_from_latent, latent),
        (box.log_slope, latent),
    ):
        plain, traced = method(argument), method(jnp.asarray(argument))
        assert isinstance(plain, np.ndarray)
        assert isinstance(traced, jax.Array)
        assert plain.dtype == traced.dtype == np.float64
        np.testing.assert_allclose(traced, plain, rtol=1e-12, atol=1e-14)


@on_jax
def test_maps_are_differentiable(box):
    latent = jnp.asarray(np.random.default_rng(53).normal(size=len(box.free)))
    both = jax.jit(lambda latent: (jax.jacfwd(box.theta_from_latent)(latent), box.log_slope(latent)))
    derivative, log_slope = both(latent)
    jacobian = np.asarray(derivative)[np.array(box.free)]
    assert np.all(np.diag(jacobian) > 0.0)
    sign, log_determinant = np.linalg.slogdet(jacobian)
    assert sign == 1.0
    assert float(log_slope.sum()) == pytest.approx(log_determinant, abs=1e-9)


@pytest.mark.parametrize("wrong", ["called", "reversed", "admits"])
def test_bounds_that_make_no_sense_are_refused(spec, wrong):
    parameter = spec.parameters[0]
    bounds = {
        "called": {"no_such_parameter": (0.0, 1.0)},
        "reversed": {parameter.name: (parameter.upper, parameter.lower)},
        "admits": {parameter.name: (parameter.lower, 2.0 * parameter.upper)},
    }[wrong]
    refusal(Box.of(spec).with_bounds, bounds, match=wrong)


@st.composite
def random_boxes(draw, spec):
    """A box of random ranges within the admissible ones, some of them a single number."""
    bounds = {}
    for parameter in spec.parameters:
        ends = st.floats(parameter.lower, parameter.upper)
        bounds[parameter.name] = tuple(sorted(draw(st.tuples(ends, ends) | ends.map(lambda end: (end, end)))))
    return Box.of(spec).with_bounds(bounds)


@examples(15)
@given(data=st.data())
def test_any_box_is_gone_through_and_back(spec, data):
    box = data.draw(random_boxes(spec))
    n_free = len(box.free)
    share = st.floats(1e-6, 1.0 - 1e-6)
    unit = np.array(data.draw(st.lists(share, min_size=n_free, max_size=n_free)))
    theta = box.theta_from_unit(unit)
    lower, upper = np.array(box.lower), np.array(box.upper)
    assert np.all((theta >= lower) & (theta <= upper))
    back = box.theta_from_unit(box.unit_from_theta(theta))
    # On its own scale a number keeps 1e-16 of the larger end.
    size = np.maximum(np.abs(lower), np.abs(upper))
    logarithm = np.maximum(
        np.abs(np.log(np.where(box.log, lower, 1.0))), np.abs(np.log(np.where(box.log, upper, 1.0)))
    )
    allowed = 1e-15 * np.where(box.log, (4.0 + 2.0 * logarithm) * np.abs(theta), 4.0 * size)
    assert np.all(np.abs(back - theta) <= allowed)
    latent = np.log(unit) - np.log1p(-unit)
    through = box.theta_from_latent(latent)
    assert np.all(np.abs(through - theta) <= 10.0 * allowed)
    assert np.all(np.isfinite(box.log_slope(latent)))


def test_a_range_of_two_neighbouring_numbers_makes_no_nan(spec):
    nominal = {each.name: each.nominal for each in spec.parameters}
    box = Box.of(spec).with_bounds({name: (low, np.nextafter(low, np.inf)) for name, low in nominal.items()})
    unit = np.full(len(box.free), 0.5)
    theta = box.theta_from_unit(unit)
    np.testing.assert_allclose(theta, list(nominal.values()), rtol=1e-15, atol=1e-300)
    assert np.all(np.isfinite(box.unit_from_theta(theta)))
    assert np.all(np.isfinite(box.log_slope(np.zeros(len(box.free)))))
