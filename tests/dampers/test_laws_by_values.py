"""Laws by values at commands: the curve through them, its tangents, what names them."""

from __future__ import annotations

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from sentences import Refused

import mrwork as mr
from mrwork.dampers.parameters import law_by_values, law_named, law_through

POSITIVE = st.floats(1e-2, 1e4)


@examples(50)
@given(values=st.tuples(POSITIVE, POSITIVE, POSITIVE), command=st.floats(0.0, 2.0))
def test_a_positive_parameter_stays_positive(values: tuple[float, ...], command: float) -> None:
    law = law_named("values:0,0.5,2")
    assert law.values(np.array(values), np.array([command]), log=True)[0] > 0.0


@examples(50)
@given(values=st.tuples(POSITIVE, POSITIVE, POSITIVE))
def test_a_law_takes_its_values_at_its_commands(values: tuple[float, ...]) -> None:
    for name in ("values:0,0.5,2", "quadratic:0,0.5,2"):
        law = law_named(name)
        np.testing.assert_allclose(
            law.values(np.array(values), np.array(law.nodes), log=True), values, rtol=1e-9
        )


def test_a_polynomial_through_values_is_the_polynomial_by_its_coefficients() -> None:
    coefficients, nodes = np.array([200.0, 960.0, -480.0]), np.array([0.0, 0.4, 1.0])
    command = np.linspace(0.0, 1.0, 11)
    expected = np.polynomial.polynomial.polyval(command, coefficients)
    at_nodes = np.polynomial.polynomial.polyval(nodes, coefficients)
    found = law_named("quadratic:0,0.4,1").values(at_nodes, command, log=True)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_logarithms_are_interpolated_where_the_scale_is_logarithmic_only() -> None:
    law, ends = law_named("values:0,1"), np.array([100.0, 400.0])
    assert law.values(ends, np.array([0.5]), log=True)[0] == pytest.approx(200.0)
    assert law.values(ends, np.array([0.5]), log=False)[0] == pytest.approx(250.0)


def test_beyond_its_commands_a_law_continues_along_its_tangent() -> None:
    law, values = law_named("values:0,0.5,1"), np.array([100.0, 300.0, 400.0])
    step = 1e-6
    inside, end, outside, far = law.values(values, np.array([1.0 - step, 1.0, 1.0 + step, 1.5]))
    slope = (end - inside) / step
    assert (outside - end) / step == pytest.approx(slope, rel=1e-4)
    assert far == pytest.approx(end + 0.5 * slope, rel=1e-4)


def test_nodes_are_the_tested_commands_nearest_to_evenly_spaced_ones() -> None:
    tested = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
    assert law_by_values("quadratic", tested) == "values:0,0.5,1"
    assert law_through("linear", tested) == "linear:0,1"
    assert law_by_values("cubic", tested) == "values:0,0.25,0.75,1"
    # Fewer commands than values: the search refuses the law in a sentence of its own.
    assert law_by_values("quadratic", [0.0, 1.0]) == "quadratic"
    assert law_by_values("exponential", tested) == "exponential"


def test_a_value_is_a_parameter_in_the_unit_of_its_law() -> None:
    spec = mr.damper("dahl").with_current_laws({"k_w": "values: 0, 0.5, 1"}, unit="V")
    assert spec.names[:3] == ("k_w@0V", "k_w@0.5V", "k_w@1V")
    plain = mr.damper("dahl").plain[0]
    assert {(each.unit, each.scale, each.lower) for each in spec.parameters[:3]} == {
        (plain.unit, plain.scale, plain.lower)
    }
    assert spec.current is not None
    assert spec.current.laws[0] == "values:0,0.5,1"


def test_a_law_without_rising_commands_is_refused(refused: Refused) -> None:
    for name in (
        "values:1,0",
        "values:0",
        "values:0,abc",
        "values:0,inf",
        "quadratic:0,1",
        "values:",
        "exponential:0,1",
    ):
        refused(mr.damper("dahl").with_current_laws, {"k_w": name})
