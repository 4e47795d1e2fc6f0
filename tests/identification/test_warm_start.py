"""Starts that are given: an earlier fit is carried over to more laws and to kindred models, or refused by name."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from sinusoidal_tests import driven_test

import mrwork as mr
from mrwork.identification import Fit, FitSettings, start_from
from mrwork.identification.fit_progress import Identifying
from mrwork.identification.identify import starting_points
from mrwork.identification.problem import Problem

# Too short to find anything by itself.
BARELY = mr.search.EfficientGA(population=8, stop=mr.search.StopRules(max_generations=2))
SHORT = mr.search.EfficientGA(stop=mr.search.StopRules(max_generations=30))
BOUC_WEN = mr.damper("normalised_bouc_wen")
LAWS: dict[str, mr.dampers.LawName] = {"k_w": "linear", "c": "linear"}


def record(current: float) -> mr.DamperTest:
    """A sinusoidal test of a damper whose yield force is quadratic in the current, with noise in the force alone."""
    spec = BOUC_WEN.with_current_laws({"k_w": "quadratic", "c": "linear"})
    values = {
        **{"c.0": 800.0, "c.1": 1500.0, "k": 900.0, "x0": 0.003, "rho": 1500.0, "sigma": 0.9, "n": 1.5},
        **{"k_w.0": 120.0, "k_w.1": 900.0, "k_w.2": -200.0},
    }
    theta, draws = [values[name] for name in spec.names], [0, round(100 * current)]
    shape = {"dt": 2e-3, "n_time": 1250, "noise_n": 5.0, "rng": draws, "command": current}
    return replace(driven_test(spec, theta, (0.01, 1.0), **shape), n_settle=200)


@pytest.fixture(scope="module")
def tests() -> tuple[mr.DamperTest, ...]:
    return tuple(record(current) for current in (0.0, 0.5, 1.0))


@pytest.fixture(scope="module")
def fit(tests: tuple[mr.DamperTest, ...]) -> Fit:
    return mr.identify(BOUC_WEN.with_current_laws(LAWS), tests, search=SHORT, rng=1)


def values(fit: Fit) -> dict[str, float]:
    return dict(zip(fit.spec.names, fit.theta, strict=True))


def test_a_raised_law_starts_where_the_lower_one_ended(fit: Fit) -> None:
    raised = BOUC_WEN.with_current_laws(
        {"k_w": "quadratic", "c": "cubic", "rho": "exponential", "n": "linear"}
    )
    start, was = start_from(fit, raised), values(fit)
    assert set(start) == set(raised.names)
    assert all(start[name] == was[name] for name in ("k_w.0", "k_w.1", "c.1", "k"))
    phase = np.linspace(0.0, 20.0, 500)
    loading = mr.Loading(
        dt=1e-3,
        displacement=0.01 * np.sin(phase),
        velocity=0.4 * np.cos(phase),
        command=0.7,
        command_unit="A",
    )
    then = mr.simulate_force(fit.spec, np.array(fit.theta), loading)
    now = mr.simulate_force(raised, np.array([start[name] for name in raised.names]), loading)
    # The polynomials are the same numbers; evaluating them to a higher degree may round elsewhere.
    np.testing.assert_allclose(now, then, rtol=0, atol=1e-9 * np.ptp(then))


@pytest.mark.parametrize("law", ["tanh:0,1", "exponential:0.2,1", "monotone:0,0.5,1"])
def test_a_law_by_values_starts_on_the_curve_of_another_one(fit: Fit, law: mr.dampers.LawName) -> None:
    model = BOUC_WEN.with_current_laws({**LAWS, "k_w": law})
    start, commands = start_from(fit, model), np.linspace(0.2, 1.0, 9)
    own = np.array([start[each.name] for each in model.parameters if each.plain_name == "k_w"])
    line = values(fit)["k_w.0"] + values(fit)["k_w.1"] * commands
    # The straightest curve that saturates is within .7 % of its rise.
    off = model.laws_by_name["k_w"].values(own, commands) - line
    assert np.max(np.abs(off)) <= 0.007 * np.ptp(line) + 1e-9 * np.max(line)


def test_given_starts_stand_after_those_that_were_found(tests: tuple[mr.DamperTest, ...], fit: Fit) -> None:
    raised = BOUC_WEN.with_current_laws({"k_w": "quadratic", "c": "linear"})
    settings = FitSettings(search=BARELY, bounds={"n": (1.0, 1.2)}, rng=1)
    problem = Problem.of(raised, tests, settings)
    explored = starting_points(problem, Identifying(tally=problem.objective.tally))
    whole, part = start_from(fit, raised), {"k_w.2": -150.0, "n": 7.0}
    joined = explored.with_given(raised, [whole, part])
    np.testing.assert_array_equal(joined.theta[:-2], explored.theta)
    columns = dict(zip(raised.names, joined.theta[-2:].T, strict=True))
    for name in ("k_w.0", "k_w.1", "c.0", "c.1", "rho"):
        assert columns[name][0] == pytest.approx(whole[name], rel=1e-9)
    assert columns["k_w.2"][1] == pytest.approx(-150.0, rel=1e-9)
    assert columns["rho"][1] == pytest.approx(dict(zip(raised.names, explored.theta[0], strict=True))["rho"])
    assert 1.2 - 1e-6 < columns["n"][1] < 1.2


def test_a_fit_goes_on_from_where_it_started(tests: tuple[mr.DamperTest, ...], fit: Fit) -> None:
    raised = BOUC_WEN.with_current_laws({"k_w": "quadratic", "c": "linear"})
    start = start_from(fit, raised)
    again = mr.identify(raised, tests, search=BARELY, starts=[start], rng=1)
    assert again.nrmse < fit.nrmse
    assert again.provenance.settings["starts"] == [start]


def test_an_incomplete_start_is_completed_and_pulled_inside(tests: tuple[mr.DamperTest, ...]) -> None:
    start = {"sigma": 0.9, "n": 5.0, "k_w": 500.0}
    found = mr.identify(BOUC_WEN, tests[1], search=SHORT, bounds={"n": (1.0, 2.0)}, starts=[start], rng=1)
    assert found.rmse_n == pytest.approx(5.0, rel=0.05)
    assert 1.0 <= values(found)["n"] <= 2.0


def test_a_kindred_model_shares_what_has_the_same_name_and_unit(fit: Fit) -> None:
    modified = mr.damper("normalised_modified_bouc_wen").with_current_laws({"k_w": "quadratic"})
    start = start_from(fit, modified)
    # c of the one is not c0 of the other; x0, k_w and the loop are the same.
    assert set(start) == {"x0", "k_w.0", "k_w.1", "k_w.2", "rho", "sigma", "n"}
    assert start["k_w.2"] == 0.0


def test_a_redundant_form_takes_a_start_as_a_whole(tests: tuple[mr.DamperTest, ...]) -> None:
    spencer = mr.identify("bouc_wen", tests[1], search=SHORT, rng=1)
    start = start_from(spencer, mr.damper("bouc_wen"))
    again = mr.identify("bouc_wen", tests[1], search=BARELY, starts=[start], rng=2)
    assert again.nrmse == pytest.approx(spencer.nrmse, rel=1e-3)
    refusal(mr.identify, "bouc_wen", tests[1], starts=[{"n": 2.0}], match="only as a whole")


def test_an_unusable_start_is_named_before_anything_is_searched(tests: tuple[mr.DamperTest, ...]) -> None:
    refusal(
        *(mr.identify, BOUC_WEN, tests[1]),
        starts=[{"k_w.0": 1.0}],
        on_progress=lambda progress: pytest.fail("searched"),
        match="k_w.0",
    )


def test_a_fit_that_cannot_be_carried_over_says_why(fit: Fit) -> None:
    for model, word in (
        (BOUC_WEN.with_current_laws({"k_w": "exponential", "c": "linear"}), "k_w is linear .* exponential"),
        (BOUC_WEN, "c is linear .* constant"),
        (BOUC_WEN.with_current_laws(LAWS, unit="V"), "take A, .* V"),
        (mr.damper("hyperbolic_tangent_guo"), "no parameter"),
    ):
        refusal(start_from, fit, model, match=word)
