"""Sine, cosine and angles that are recorded are those of libm to about a unit in the last place, in the core too."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

import mrwork as mr
from mrwork import _rust

PARAMETERS = {"c": ("1", 0.1, 1.0, 10.0)}


def on_core(function: Callable[[Any, Any], Any]) -> Callable[[float, float], float]:
    """A function of two numbers, walked by the core as the force of a damper."""
    spec = mr.own_damper("angles", parameters=PARAMETERS, force=lambda p, _, x, v: p.c * function(x, v))

    def computed(x: float, v: float) -> float:
        return float(_rust.force(spec.core_name, spec.nominal, np.zeros(0), x, v))

    return computed


FUNCTIONS: dict[str, tuple[Callable[[Any, Any], Any], Callable[[float, float], float], float]] = {
    # Units in the last place beside those of libm.
    "sine": (lambda x, _: np.sin(x), lambda x, _: math.sin(x), 1.0),
    "cosine": (lambda x, _: np.cos(x), lambda x, _: math.cos(x), 1.0),
    "tangent": (lambda x, _: np.tan(x), lambda x, _: math.tan(x), 3.0),
    "angle": (lambda x, v: np.arctan2(v, x), lambda x, v: math.atan2(v, x), 2.0),
    "angle of a slope": (lambda x, _: np.arctan(x), lambda x, _: math.atan(x), 1.0),
}
SIZES = st.floats(1e-300, 1e6) | st.floats(0.01, 10.0) | st.sampled_from([0.0, 0.5 * math.pi, 1e5 * math.pi])
NUMBERS = st.builds(math.copysign, SIZES, st.sampled_from([1.0, -1.0]))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_core_has_the_numbers_of_libm(name: str) -> None:
    function, exact, units = FUNCTIONS[name]
    computed = on_core(function)

    @examples(300)
    @given(NUMBERS, NUMBERS)
    def agree(x: float, v: float) -> None:
        expected = exact(x, v)
        assert abs(computed(x, v) - expected) <= units * np.spacing(abs(expected))
        assert math.copysign(1.0, computed(x, v)) == math.copysign(1.0, expected)

    agree()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_lanes_have_the_bits_of_one_number_on_every_instruction_set(name: str, instruction_set: str) -> None:
    function, _, _ = FUNCTIONS[name]
    spec = mr.own_damper("angles", parameters=PARAMETERS, force=lambda p, _, x, v: function(p.c * x, v))
    rng = np.random.default_rng(4)
    theta = rng.uniform(0.5, 2.0, (19, 1))
    x, v = rng.normal(size=(2, 40)) * 10.0 ** rng.uniform(-3.0, 4.0, (2, 40))
    found = mr.simulate(spec, theta, mr.Loading(dt=0.01, displacement=x, velocity=v))
    one = [
        [_rust.force(spec.core_name, row, np.zeros(0), *at) for at in zip(x, v, strict=True)] for row in theta
    ]
    np.testing.assert_array_equal(found, one)


def test_special_numbers_are_those_of_numpy() -> None:
    special = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, -1.0, 1e300, -1e-310)
    angle = on_core(lambda x, v: np.arctan2(v, x))
    for x in special:
        for v in special:
            np.testing.assert_array_equal(angle(x, v), np.arctan2(v, x))
    for name in ("sine", "cosine"):
        computed = on_core(FUNCTIONS[name][0])
        assert all(math.isnan(computed(x, 0.0)) for x in special[:3])


def test_large_angles_lose_no_more_than_their_last_bits() -> None:
    """Beyond a million radians the error is absolute; beyond 1e15 there is no sine."""
    sine, cosine = (on_core(FUNCTIONS[name][0]) for name in ("sine", "cosine"))
    for x in 10.0 ** np.random.default_rng(0).uniform(6.0, 10.0, 300):
        assert abs(sine(x, 0.0) - math.sin(x)) < 4e-16
        assert abs(cosine(x, 0.0) - math.cos(x)) < 4e-16
    assert math.isnan(sine(1e16, 0.0))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives_are_differences(name: str) -> None:
    spec = mr.own_damper(
        "angles",
        parameters={"c": ("1", 0.1, 0.5, 2.0)},
        force=lambda p, _, x, v: FUNCTIONS[name][0](p.c * x, 1.0 + v),
    )
    motion = mr.Loading(dt=0.1, displacement=np.linspace(0.3, 1.2, 8))
    slope = mr.sensitivities(spec, [0.5], motion).jacobian.reshape(-1)
    ends = [mr.simulate_force(spec, [0.5 + step], motion) for step in (1e-4, -1e-4)]
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-4, rtol=1e-6)
