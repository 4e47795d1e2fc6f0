"""Laws by values at commands: the curve through them, its tangents, its names; where laws leave what a model admits."""

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from refusals import refusal

import mrwork as mr
from mrwork.dampers import LawName
from mrwork.dampers.dependence import Dependence, dependence_of, named_dependences
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import law_limits, worst_laws

POSITIVE = st.floats(1e-2, 1e4)


@examples(50)
@given(values=st.tuples(POSITIVE, POSITIVE, POSITIVE), command=st.floats(0.0, 2.0))
def test_a_positive_parameter_stays_positive(values: tuple[float, ...], command: float) -> None:
    law = dependence_of("log_quadratic:0,0.5,2")
    assert law.values(np.array(values), np.array([command]))[0] > 0.0


@examples(50)
@given(values=st.tuples(POSITIVE, POSITIVE, POSITIVE))
def test_a_law_takes_its_values_at_its_commands(values: tuple[float, ...]) -> None:
    for name in ("log_quadratic:0,0.5,2", "quadratic:0,0.5,2", "straight:0,0.5,2", "straight_log:0,0.5,2"):
        law = dependence_of(name)
        np.testing.assert_allclose(law.values(np.array(values), np.array(law.nodes)), values, rtol=1e-9)


def test_a_polynomial_through_values_is_the_polynomial_by_its_coefficients() -> None:
    coefficients, nodes = np.array([200.0, 960.0, -480.0]), np.array([0.0, 0.4, 1.0])
    command = np.linspace(0.0, 1.0, 11)
    expected = np.polynomial.polynomial.polyval(command, coefficients)
    at_nodes = np.polynomial.polynomial.polyval(nodes, coefficients)
    found = dependence_of("quadratic:0,0.4,1").values(at_nodes, command)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_law_takes_the_logarithms_that_its_name_says() -> None:
    ends = np.array([100.0, 400.0])
    assert dependence_of("log_linear:0,1").values(ends, np.array([0.5]))[0] == pytest.approx(200.0)
    assert dependence_of("linear:0,1").values(ends, np.array([0.5]))[0] == pytest.approx(250.0)


def test_logarithms_of_what_may_be_negative_are_refused_with_the_law_that_has_none() -> None:
    model = mr.damper("dahl")
    for law, other in (("log_linear", "linear"), ("straight_log:0,1", "straight:0,1")):
        refusal(model.with_current_laws, {"f0": law}, match=f"give f0={other}")
    refusal(
        model.with_current_laws, {"k_w": "log_quadratic"}, match="give them, as in k_w=log_quadratic:0,1,2"
    )


@examples(50)
@given(
    values=st.lists(POSITIVE, min_size=2, max_size=8),
    command=st.floats(0.0, 10.0),
    name=st.sampled_from(("straight", "straight_log")),
)
def test_straight_lines_are_those_of_numpy_and_of_the_core(
    values: list[float], command: float, name: str
) -> None:
    nodes = [0.0, 0.3, 1.0, 2.5, 3.0, 5.0, 8.0, 9.0][: len(values)]
    law = dependence_of(f"{name}:{','.join(map(str, nodes))}")
    found = float(law.values(np.array(values), np.array(command)))
    if command <= nodes[-1]:
        line = np.interp(command, nodes, values)
        if name == "straight_log":
            line = np.exp(np.interp(command, nodes, np.log(values)))
        assert found == pytest.approx(line, rel=1e-9)
    spec, theta = dahl(str(law), *values)
    motion = {"dt": 0.01, "displacement": np.linspace(0.0, 0.5, 40)}
    lawful = simulate_force(spec, theta, Loading(**motion, command=command, command_unit="A"))
    used = np.clip(found, spec.plain[0].lower, spec.plain[0].upper)
    plain = simulate_force(mr.damper("dahl"), [used, *DAHL.values()], Loading(**motion))
    np.testing.assert_allclose(lawful, plain, rtol=1e-9, atol=1e-9 * max(values))


@pytest.mark.parametrize(
    "name", ["log_quadratic:0,0.5,2", "quadratic:0,0.5,2", "straight:0,0.5,2", "straight_log:0,0.5,2"]
)
def test_a_rescaled_command_is_the_law_there(name: str) -> None:
    law, rows = dependence_of(name), np.array([[100.0, 300.0, 400.0], [90.0, 310.0, 405.0]])
    nodes = np.array(law.nodes)
    for values, rescaled in zip(rows, law.rescale_command(rows, 0.9), strict=True):
        expected = law.values(values, 0.9 * nodes)
        np.testing.assert_allclose(law.values(rescaled, nodes), expected, rtol=1e-9)


def test_beyond_its_commands_a_law_continues_along_its_tangent() -> None:
    law, values = dependence_of("quadratic:0,0.5,1"), np.array([100.0, 300.0, 400.0])
    step = 1e-6
    inside, end, outside, far = law.values(values, np.array([1.0 - step, 1.0, 1.0 + step, 1.5]))
    slope = (end - inside) / step
    assert (outside - end) / step == pytest.approx(slope, rel=1e-4)
    assert far == pytest.approx(end + 0.5 * slope, rel=1e-4)


def test_nodes_are_the_tested_commands_nearest_to_evenly_spaced_ones() -> None:
    tested = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
    for law, placed in (
        ("quadratic", "quadratic:0,0.5,1"),
        ("linear", "linear:0,1"),
        ("log_cubic", "log_cubic:0,0.25,0.75,1"),
        ("quadratic:0,0.2,1", "quadratic:0,0.2,1"),
        ("exponential", "exponential"),
    ):
        assert str(dependence_of(law).at_commands(tested)) == placed
    # Fewer commands than values: the search refuses the law in a sentence of its own.
    assert str(dependence_of("quadratic").at_commands([0.0, 1.0])) == "quadratic"


def test_a_value_is_a_parameter_in_the_unit_of_its_law() -> None:
    spec = mr.damper("dahl").with_current_laws({"k_w": "log_quadratic: 0, 0.5, 1"}, unit="V")
    assert spec.names[:3] == ("k_w@0V", "k_w@0.5V", "k_w@1V")
    plain = mr.damper("dahl").plain[0]
    assert {(each.unit, each.scale, each.lower) for each in spec.parameters[:3]} == {
        (plain.unit, plain.scale, plain.lower)
    }
    assert str(spec.laws[0]) == "log_quadratic:0,0.5,1"


@pytest.mark.parametrize(
    "name", ["log_linear:1,0", "straight:0", "straight:0,inf", "quadratic:0,1", "values:0,1", "linaer"]
)
def test_a_law_without_rising_commands_is_refused(name: str) -> None:
    refusal(mr.damper("dahl").with_current_laws, {"k_w": name}, match="rising commands: as many")


DAHL = {"rho": 2000.0, "f0": 0.0}


def dahl(law: LawName, *coefficients: float) -> tuple[mr.DamperSpec, list[float]]:
    return mr.damper("dahl").with_current_laws({"k_w": law}, unit="A"), [*coefficients, *DAHL.values()]


def test_a_law_that_turns_negative_is_named_with_its_commands() -> None:
    (found,) = law_limits(*dahl("linear", -100.0, 1000.0), (0.0, 1.0))
    assert (found.parameter, found.value, found.used, found.command) == ("k_w", -100.0, 1e-3, 0.0)
    assert (found.first, found.last) == (0.0, 0.1)
    assert found.in_words == "the law of k_w turns negative: -100 N at 0 A, taken as 0.001 N from 0 to 0.1 A"


@pytest.mark.parametrize(
    ("law", "coefficients", "commands", "words"),
    [
        ("linear", (-100.0, 1000.0), (0.25, 1.0), ""),
        ("linear", (100.0, 900.0), (0.0, 1.0), ""),
        ("quadratic", (500.0, 1500.0, -1600.0), (0.0, 1.0), ""),
        ("quadratic", (500.0, 1500.0, -1600.0), (0.0, 1.25), "turns negative: -125 N at 1.25 A"),
        # Between commands at which it is positive.
        ("quadratic", (490.0, -2000.0, 2000.0), (0.0, 1.0), "turns negative: -10 N at 0.5 A"),
        ("exponential", (1.0e4, 5.0, 10.0), (0.0, 1.0), ""),
        ("exponential", (1.0e4, 5.0, 20.0), (0.0, 1.5), "leaves the admissible range"),
        ("exponential", (0.5, 1.0, 9.0), (0.0, 1.0), "vanishes: 1.5 N at 0 A"),
        ("linear", (1.0, 900.0), (0.0, 0.0), ""),
    ],
)
def test_a_law_is_named_where_it_leaves_its_range_and_only_there(
    law: LawName, coefficients: tuple[float, ...], commands: tuple[float, float], words: str
) -> None:
    found = law_limits(*dahl(law, *coefficients), commands)
    assert len(found) == (1 if words else 0)
    if words:
        assert words in found[0].in_words


def test_a_value_on_the_bound_does_not_leave_the_range_by_rounding() -> None:
    spec = mr.damper("normalised_bouc_wen").with_current_laws(
        {"sigma": "log_quadratic:0,0.77,2.25"}, unit="V"
    )
    values = dict(zip(spec.names, spec.nominal.tolist(), strict=True))
    (upper,) = (each.upper for each in spec.plain if each.name == "sigma")
    theta = [*(values | {"sigma@0V": 100.0, "sigma@0.77V": 105.0, "sigma@2.25V": upper}).values()]
    assert law_limits(spec, theta, (0.0, 2.25)) == ()


def test_an_offset_may_be_negative_and_a_constant_has_no_law() -> None:
    spec = mr.damper("dahl").with_current_laws({"f0": "linear"}, unit="A")
    assert law_limits(spec, [500.0, 2000.0, 10.0, -50.0], (0.0, 1.0)) == ()
    assert law_limits(mr.damper("dahl"), [500.0, 2000.0, 0.0], (0.0, 1.0)) == ()


def test_of_several_runs_the_worst_command_of_a_parameter_is_kept() -> None:
    spec, theta = dahl("linear", -100.0, 1000.0)
    runs = [limit for lowest in (0.05, 0.0, 0.08) for limit in law_limits(spec, theta, (lowest, 1.0))]
    assert [each.command for each in worst_laws(runs)] == [0.0]


@pytest.mark.parametrize("law", named_dependences(), ids=str)
def test_the_values_of_a_law_are_those_of_its_equation(law: Dependence) -> None:
    coefficients = np.array([3.0, -2.0, 0.7, 0.2])[: law.n_coefficients]
    command = np.array([0.0, 0.4, 1.3])
    expected = sum(value * command**power for power, value in enumerate(coefficients))
    if law.is_exponential:
        expected = 3.0 - 2.0 * np.exp(0.7 * command)
    np.testing.assert_allclose(law.values(coefficients, command), expected, rtol=1e-12)


def test_a_command_that_no_driver_gives_is_refused() -> None:
    for command, word in ((-5.0, "give its magnitude"), (1e9, "no driver gives more than 1000")):
        loading = Loading(dt=0.01, displacement=np.zeros(20), command=command, command_unit="A")
        refusal(loading.history, match=word)
