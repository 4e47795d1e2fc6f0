"""Saturating laws and monotone cubics: their curves, derivatives, limits, and the values of the core and of JAX."""

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
import pytest
import scipy.interpolate
from examples import examples
from hypothesis import assume, given
from hypothesis import strategies as st
from refusals import refusal
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.dampers.dependence import (
    LAWS_AT_COMMANDS,
    SATURATING_FORMS,
    Dependence,
    dependence_of,
    dependence_through,
    named_dependences,
)
from mrwork.dampers.simulation import Loading, simulate_force, simulate_sensitivities
from mrwork.dampers.spec import law_values
from mrwork.identification.equivalent import fitted_coefficients, in_other_dependences
from mrwork.twins.model_twins import parameters_at

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
NODES = [0.0, 0.3, 1.0, 1.2, 2.0, 2.5, 4.0, 5.0]
UNTESTED = np.array([0.1, 0.25, 0.75, 1.25])
POSITIVE = st.floats(1e-2, 1e4)
VALUES = st.lists(POSITIVE, min_size=2, max_size=8)
RISES = st.floats(0.05, 20.0)
FORMS = ("monotone:0,0.4,1,1.5", "tanh:0,1.5", "tanh:0.5,1.5", "exponential:0,1.5", "exponential:0.5,1.5")
EVERY = [
    *map(str, named_dependences()),
    *FORMS,
    *(f"{name}:0,0.4,1.5" for name in ("quadratic", "log_quadratic", "straight", "straight_log")),
]


def monotone(values: Sequence[float]) -> Dependence:
    return dependence_through(NODES[: len(values)], "monotone")


@examples(100)
@given(values=VALUES, share=st.floats(0.0, 1.0))
def test_monotone_cubics_are_those_of_scipy_with_their_tangents_beyond(
    values: list[float], share: float
) -> None:
    law = monotone(values)
    first, last = law.nodes[0], law.nodes[-1]
    reference = scipy.interpolate.PchipInterpolator(law.nodes, values)
    inside = first + share * (last - first)
    found = law.values(np.array(values), np.array([inside, first - share, last + share]))
    slope = reference.derivative()
    expected = [
        reference(inside),
        values[0] - share * slope(first),
        values[-1] + share * slope(last),
    ]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * max(values))


@examples(50)
@given(values=VALUES)
def test_monotone_values_give_a_monotone_curve(values: list[float]) -> None:
    command = np.linspace(-1.0, NODES[len(values) - 1] + 1.0, 500)
    for ordered in (sorted(values), sorted(values, reverse=True)):
        steps = np.diff(monotone(values).values(np.array(ordered), command))
        sign = 1.0 if ordered[-1] >= ordered[0] else -1.0
        assert np.min(sign * steps) >= -1e-12 * max(values)


@examples(50)
@given(values=VALUES, share=st.floats(0.0, 1.0))
def test_a_monotone_curve_stays_between_neighbouring_values(values: list[float], share: float) -> None:
    law = monotone(values)
    for number, (before, after) in enumerate(pairwise(values)):
        command = law.nodes[number] + share * (law.nodes[number + 1] - law.nodes[number])
        found = float(law.values(np.array(values), np.array(command)))
        slack = 1e-12 * max(values)
        assert min(before, after) - slack <= found <= max(before, after) + slack


def equation(
    form: str, values: Sequence[float], rate: float, nodes: Sequence[float], command: Floats
) -> Floats:
    """p0 + (p1 - p0) g as it is written, whose differences cancel at small rates."""
    rise = (lambda u: np.tanh(rate * u)) if form == "tanh" else (lambda u: -np.expm1(-rate * (u - nodes[0])))
    start, end = (rise(np.float64(node)) for node in nodes)
    return np.asarray(values[0] + (values[1] - values[0]) * (rise(command) - start) / (end - start))


@pytest.mark.parametrize("form", SATURATING_FORMS)
@examples(100)
@given(ends=st.tuples(POSITIVE, POSITIVE), rise=RISES, first=st.sampled_from([0.0, 0.25]))
def test_a_saturating_law_is_its_equation(
    form: str, ends: tuple[float, float], rise: float, first: float
) -> None:
    law = dependence_of(f"{form}:{first},1.5")
    rate = rise / (1.5 - first)
    command = np.linspace(first, 3.0, 13)
    found = law.values(np.array([*ends, rate]), command)
    np.testing.assert_allclose(found, equation(form, ends, rate, law.nodes, command), atol=1e-10 * max(ends))
    np.testing.assert_allclose(law.values((*ends, rate), np.array(law.nodes)), ends, atol=1e-12 * max(ends))


@pytest.mark.parametrize("form", SATURATING_FORMS)
def test_a_small_rate_is_the_straight_line_and_loses_no_digits(form: str) -> None:
    law, command = dependence_of(f"{form}:0,1.5"), np.linspace(0.0, 2.0, 9)
    straight = 10.0 + 20.0 * command / 1.5
    for rate in (1e-4, 1e-8, 1e-12):
        off = np.abs(law.values(np.array([10.0, 30.0, rate]), command) - straight)
        # Its curvature: of first order in the rate, but for rounding.
        assert np.max(off) <= 20.0 * rate + 1e-13


def test_a_saturated_law_far_below_its_commands_stays_a_number() -> None:
    for form in SATURATING_FORMS:
        law = dependence_of(f"{form}:100,101")
        assert np.isfinite(law.values((5.0, 5.0, 20.0), np.array([0.0, 100.0, 1e3]))).all()


@pytest.mark.parametrize("name", EVERY)
@examples(20)
@given(data=st.data())
def test_slopes_are_those_of_finite_differences(name: str, data: st.DataObject) -> None:
    law = dependence_of(name)
    shares = st.lists(st.floats(0.5, 2.0), min_size=law.n_coefficients, max_size=law.n_coefficients)
    # Rising values: where two are equal, or turn, the slopes of monotone cubics have a kink.
    rows = np.cumsum([data.draw(shares) for _ in range(2)], axis=1).T
    if law.saturates:
        rows[-1] = data.draw(st.lists(st.floats(0.1, 5.0), min_size=2, max_size=2))
    commands = np.array(data.draw(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=3)))
    found = law.slopes(rows, commands)
    assert found.shape == (law.n_coefficients, len(commands), 2)
    step = 1e-6
    for number, slope in enumerate(found):
        change = step * np.eye(law.n_coefficients)[number][:, None]
        ahead, behind = (law.values(rows + way * change, commands[:, None]) for way in (1.0, -1.0))
        expected = (ahead - behind) / (2.0 * step)
        scale = max(1.0, float(np.max(np.abs(ahead))))
        np.testing.assert_allclose(slope, np.broadcast_to(expected, slope.shape), atol=1e-7 * scale)


OTHERS = {"rho": 2000.0, "f0": 0.0}
MOTION = {"dt": 0.01, "displacement": np.linspace(0.0, 0.5, 40)}


def dahl(law: Dependence) -> mr.DamperSpec:
    return mr.damper("dahl").with_current_laws({"k_w": law}, unit="A")


@pytest.mark.parametrize("name", FORMS)
@examples(30)
@given(data=st.data(), command=st.floats(0.0, 3.0), rise=RISES)
def test_core_numpy_and_jax_have_the_same_values(
    name: str, data: st.DataObject, command: float, rise: float
) -> None:
    law = dependence_of(name)
    coefficients = data.draw(st.lists(POSITIVE, min_size=law.n_coefficients, max_size=law.n_coefficients))
    if law.saturates:
        coefficients[-1] = rise / (law.nodes[1] - law.nodes[0])
    found = float(law.values(np.array(coefficients), np.array(command)))
    theta = np.array([*coefficients, *OTHERS.values()])
    spec, plain = dahl(law), mr.damper("dahl")
    used = float(np.clip(found, plain.plain[0].lower, plain.plain[0].upper))
    by_jax = float(parameters_at(spec, theta, np.float64(command)).k_w)
    assert by_jax == pytest.approx(used, rel=1e-10, abs=1e-10 * max(coefficients))
    lawful = simulate_force(spec, theta, Loading(**MOTION, command=command, command_unit="A"))
    expected = simulate_force(plain, [used, *OTHERS.values()], Loading(**MOTION))
    np.testing.assert_allclose(lawful, expected, rtol=1e-9, atol=1e-9 * max(coefficients))


@pytest.mark.parametrize("name", FORMS)
@pytest.mark.parametrize("command", [0.7, 1.9])
def test_the_core_has_the_slopes_of_the_law(name: str, command: float) -> None:
    law = dependence_of(name)
    coefficients = np.array([100.0, 250.0, 300.0, 320.0])[: law.n_coefficients]
    if law.saturates:
        coefficients[-1] = 1.3
    spec, plain = dahl(law), mr.damper("dahl")
    theta = np.array([*coefficients, *OTHERS.values()])
    loading = Loading(**MOTION, command=command, command_unit="A")
    found = simulate_sensitivities(spec, theta[None], loading.history()).jacobian[0][: law.n_coefficients]
    at_command = np.array([[float(law.values(coefficients, np.array(command))), *OTHERS.values()]])
    own = simulate_sensitivities(plain, at_command, Loading(**MOTION).history()).jacobian[0][0]
    slopes = law.slopes(coefficients[:, None], np.array([command]))[:, 0, 0]
    np.testing.assert_allclose(
        found, slopes[:, None] * own, atol=1e-9 * np.abs(slopes).max() * np.abs(own).max()
    )


@pytest.mark.parametrize("form", SATURATING_FORMS)
@examples(30)
@given(ends=st.tuples(POSITIVE, POSITIVE), rise=st.floats(0.1, 10.0))
def test_the_nearest_saturating_law_to_one_is_that_one(
    form: str, ends: tuple[float, float], rise: float
) -> None:
    assume(abs(ends[1] - ends[0]) > 0.1 * max(ends))
    assume(min(ends) > 1e-2 * max(ends))
    law, commands = dependence_of(f"{form}:0,1.5"), np.array([0.0, 0.25, 0.5, 1.0, 1.5])
    column = law.values((*ends, rise / 1.5), commands)
    found = law.through(mr.damper("dahl").plain[0], commands, column)
    np.testing.assert_allclose(law.values(found, commands), column, atol=1e-6 * max(ends))
    assert found[2] == pytest.approx(rise / 1.5, rel=0.01)


@pytest.mark.parametrize("name", FORMS)
def test_a_rescaled_command_is_the_law_there(name: str) -> None:
    law = dependence_of(name)
    rows = np.array([[100.0, 300.0, 400.0, 420.0], [90.0, 310.0, 405.0, 430.0]])[:, : law.n_coefficients]
    if law.saturates:
        rows[:, -1] = [0.8, 2.0]
    commands = np.array(law.nodes) if law.form == "monotone" else np.linspace(0.5, 2.0, 7)
    for values, rescaled in zip(rows, law.rescale_command(rows, 0.9), strict=True):
        np.testing.assert_allclose(
            law.values(rescaled, commands), law.values(values, 0.9 * commands), rtol=1e-9
        )


def test_a_law_of_constant_values_is_constant_whatever_its_rate() -> None:
    spec = mr.damper("dahl").with_current_laws({"k_w": "tanh:0,1.5"})
    commands = np.array([0.0, 0.5, 1.5])
    theta = fitted_coefficients(spec, commands, np.tile([7.0, *OTHERS.values()], (3, 1)))
    assert theta[:3].tolist() == pytest.approx([7.0, 7.0, 1.0 / 1.5])
    other = mr.damper("dahl").with_current_laws({"k_w": "monotone:0,0.5,1.5"})
    assert in_other_dependences(spec, theta, other, commands)[:3].tolist() == pytest.approx([7.0] * 3)


def test_a_rate_is_a_parameter_of_the_command_alone() -> None:
    spec = mr.damper("dahl").with_current_laws({"k_w": "tanh:0.5,1.5"}, unit="V")
    assert spec.names[:3] == ("k_w@0.5V", "k_w@1.5V", "k_w.rate")
    rate = spec.parameters[2]
    assert (rate.unit, rate.scale, rate.plain_name) == ("1/V", "log", "k_w")
    assert (rate.lower, rate.upper) == pytest.approx((0.05, 20.0))
    assert "k_w = tanh in u through its values at 0.5, 1.5 V with the rate k_w.rate" in spec.equations


def test_laws_without_commands_take_tested_ones() -> None:
    tested = [0.0, 0.1, 0.25, 0.5, 0.75, 1.0]
    for law, placed in (
        ("tanh", "tanh:0,1"),
        ("monotone", "monotone:0,0.1,0.25,0.5,0.75,1"),
        ("exponential", "exponential"),
    ):
        assert str(dependence_of(law).at_commands(tested)) == placed
    every = np.linspace(0.0, 2.0, 21).tolist()
    assert len(dependence_of("monotone").at_commands(every).nodes) == 8


@pytest.mark.parametrize("law", LAWS_AT_COMMANDS, ids=str)
def test_a_law_that_has_values_only_at_commands_asks_for_them(law: Dependence) -> None:
    assert dependence_of(str(law)) == law
    refusal(mr.damper("dahl").with_current_laws, {"k_w": law}, match=f"give them, as in k_w={law}:0,1")


@pytest.mark.parametrize("name", ["tanh:0,1,2", "tanh:0", "exponential:0", "exponential:1,0", "monotone:1"])
def test_a_wrong_number_of_commands_is_refused_by_the_law_and_by_the_core(name: str) -> None:
    refusal(mr.damper("dahl").with_current_laws, {"k_w": name}, match="or two where it saturates")
    with pytest.raises(ValueError, match="exponential:0,1 or tanh:0,1"):
        mr._rust.damper_text("dahl", [], [1e-3], [name, "constant", "constant"])


def test_values_come_before_logarithms_and_straight_lines_last() -> None:
    force, rate, offset = mr.damper("dahl").plain
    law = dependence_of("log_quadratic:0,0.5,1")
    names = [str(each).partition(":")[0] for each in law.other_forms(force)]
    assert names == ["quadratic", "monotone", "straight", "straight_log"]
    assert [str(each).partition(":")[0] for each in dependence_of("quadratic:0,0.5,1").other_forms(rate)] == [
        "monotone",
        "log_quadratic",
        "straight_log",
        "straight",
    ]
    assert [
        str(each).partition(":")[0] for each in dependence_of("quadratic:0,0.5,1").other_forms(offset)
    ] == [
        "monotone",
        "straight",
    ]
    assert dependence_of("tanh:0,1").other_forms(force) == []


@pytest.mark.long
def test_a_saturating_law_is_recovered_with_its_values_at_untested_commands() -> None:
    law, truth = dependence_of("tanh:0,1.5"), (110.0, 1410.0, 1.6)
    tests = [
        sinusoidal_test(
            "viscous_dahl",
            (800.0, float(law.values(truth, np.array(command))), 2000.0, 20.0),
            motion,
            noise=0.02,
            rng=seed,
            command=command,
        )
        for seed, (motion, command) in enumerate(product(MOTIONS[:2], (0.0, 0.5, 1.5)))
    ]
    fit = mr.identify(mr.damper("viscous_dahl").with_current_laws({"k_w": law}), tests, rng=1, threads=1)
    (found,) = (each for each in law_values(fit.spec, np.array(fit.theta), UNTESTED) if each[0].name == "k_w")
    np.testing.assert_allclose(found[1], law.values(truth, UNTESTED), rtol=0.01)
