"""Choice of current laws: those that made the data are chosen, also after an interrupt; bad input is refused."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from refusals import refusal
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.dampers import damper
from mrwork.dampers.between_commands import hidden_extrema
from mrwork.dampers.spec import law_values
from mrwork.identification import FitSettings, Objective
from mrwork.identification.equivalent import identifiable_form, in_other_dependences, joint_box
from mrwork.identification.excerpts import middle_excerpt, middle_excerpts
from mrwork.identification.identify import identify_with
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.result import BuildingCost
from mrwork.records import DamperTest
from mrwork.search import EfficientGA, StopRules
from mrwork.uncertainty import Choice, choose_laws
from mrwork.uncertainty.candidate_tests import candidate_grid
from mrwork.uncertainty.choice.objections import objections_to

COMMANDS = (0.0, 0.5, 1.0)


def yield_force(command: float) -> float:
    """Saturates: 200, 560, 680 N."""
    return 200.0 + 960.0 * command - 480.0 * command**2


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    """Of viscous_dahl: k_x and rho are constant, k_w is quadratic in the command."""
    return tuple(
        sinusoidal_test(
            "viscous_dahl",
            (800.0, yield_force(command), 2000.0, 20.0),
            motion,
            noise=0.02,
            rng=seed,
            command=command,
        )
        for seed, (motion, command) in enumerate(product(MOTIONS[:3], COMMANDS))
    )


@pytest.fixture(scope="module")
def settings() -> FitSettings:
    # A parameter with bounds remains constant: fewer laws are tried.
    return FitSettings(search=EfficientGA(stop=StopRules(max_generations=10)), bounds={"f0": (0.0, 100.0)})


@pytest.fixture(scope="module")
def choice(tests: tuple[DamperTest, ...], settings: FitSettings) -> Choice:
    return choose_laws("viscous_dahl", tests, settings=settings, threads=1)


def test_the_laws_that_made_the_data_are_chosen(choice: Choice) -> None:
    chosen = choice.ranking.chosen_standing
    # No test tells the forms of a law apart that has a value at each command: the polynomial is less curved.
    assert chosen.laws == {"k_w": "quadratic"}
    assert chosen.n_params == 6
    at_nodes = [each for each in choice.best.spec.parameters if each.plain_name == "k_w"]
    assert len(at_nodes) == 3
    values = dict(zip(choice.best.spec.names, choice.best.theta, strict=True))
    for each in at_nodes:
        assert each.coefficient is not None
        assert values[each.name] == pytest.approx(yield_force(each.coefficient.command), rel=0.05)
    assert values["k_x"] == pytest.approx(800.0, rel=0.05)
    # Noise of 2 % is all that is left.
    assert chosen.left_out_percent == pytest.approx(98.0, abs=0.4)
    assert choice.best.status == "converged"


def test_laws_are_chosen_with_the_mass_that_is_fitted(
    tests: tuple[DamperTest, ...], settings: FitSettings
) -> None:
    loaded = [replace(test, force=test.force + 60.0 * test.acceleration) for test in tests[:6]]
    constant = {"f0": (0.0, 100.0), "k_x": (1.0, 1e5), "rho": (1.0, 1e4)}
    settings = replace(settings, observe="mass=free", bounds=constant)
    choice = choose_laws("viscous_dahl", loaded, settings=settings, threads=1)
    assert choice.ranking.chosen_standing.laws == {"k_w": "quadratic"}
    assert choice.ranking.chosen_standing.left_out_percent > 97.0
    assert choice.best.effects[0].value == pytest.approx(60.0, abs=5.0)
    assert all(other.settings.observe != settings.observe for other in choice.best.others)


def test_chosen_laws_that_their_own_search_does_not_meet_are_doubted(
    tests: tuple[DamperTest, ...], settings: FitSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = list[mr.Fit]()

    def go_astray(*arguments: Any, **named: Any) -> mr.Fit:
        fit = identify_with(*arguments, **named)
        if not named.get("examines", True):
            alone.append(fit)
            if len(alone) == 2:
                return replace(
                    fit, estimates=tuple(replace(each, value=1.1 * each.value) for each in fit.estimates)
                )
        return fit

    monkeypatch.setattr("mrwork.uncertainty.choice.choose_laws.identify_with", go_astray)
    best = choose_laws("viscous_dahl", tests, settings=settings, threads=1).best
    first, own = alone
    assert len(own.spec.names) < len(first.spec.names)
    assert own.spec.names == best.spec.names
    assert best.status == "lower_minimum_possible"
    assert best.status_reason.startswith("only fits from other laws met the least one")


def test_laws_with_the_force_of_simpler_ones_are_not_listed(settings: FitSettings) -> None:
    # Without noise every law that contains the true one is fitted by it.
    tests = [
        sinusoidal_test("dahl", (200.0 + 400.0 * command, 2000.0, 20.0), motion, noise=0.0, command=command)
        for motion, command in product(MOTIONS[:3], (0.0, 1.0))
    ]
    ranking = choose_laws("dahl", tests, settings=settings, threads=1).ranking
    assert ranking.chosen_standing.laws == {"k_w": "linear"}
    assert "laws_not_listed" in {each.code for each in ranking.remarks}


def test_given_laws_and_parameters_with_bounds_are_not_chosen(
    tests: tuple[DamperTest, ...], settings: FitSettings
) -> None:
    held = replace(settings, bounds={"rho": (100.0, 1e4)})
    found = choose_laws("viscous_dahl", tests, laws={"k_w": "quadratic"}, settings=held, threads=1)
    assert all(each.laws["k_w"] == "quadratic" for each in found.ranking.standings)
    assert all("rho" not in each.laws for each in found.ranking.standings)
    names = [each.plain_name for each in found.best.spec.parameters]
    assert names == ["k_x", "k_w", "k_w", "k_w", "rho", "f0"]


def test_other_sets_are_kept_as_they_were_fitted_to_excerpts(choice: Choice) -> None:
    assert choice.best.others
    for other in choice.best.others:
        assert {quality.test for quality in other.quality} == {
            quality.test for quality in choice.best.quality
        }
        assert other.fit_percent == pytest.approx(choice.best.fit_percent, abs=0.5)
        assert not any(each.standard_error for each in other.estimates)


def test_a_row_without_a_fold_ends_where_a_fit_to_the_other_tests_ends(tests: tuple[DamperTest, ...]) -> None:
    spec = damper("viscous_dahl").with_current_laws({"k_w": "quadratic"})
    box = joint_box(identifiable_form(spec, {}), tests, np.array(COMMANDS))
    start = np.array([700.0, 150.0, 800.0, -300.0, 1500.0, 0.0])
    shares = np.full((2, len(tests)), 1.0 / len(tests))
    shares[1] = np.where(np.arange(len(tests)) < 3, 0.0, 1.0 / (len(tests) - 3))
    together = Objective.of(spec, tests, threads=1)
    found = find_minima(together, box, np.stack([start, start]), max_iterations=60, shares=shares)
    rest = find_minima(Objective.of(spec, tests[3:], threads=1), box, start[None], max_iterations=60)
    assert found.theta[1] == pytest.approx(rest.theta[0], rel=1e-4)
    assert found.misfit[1] == pytest.approx(rest.misfit[0], rel=1e-9)
    whole = find_minima(together, box, start[None], max_iterations=60)
    assert found.theta[0] == pytest.approx(whole.theta[0], rel=1e-4)


def test_a_law_of_a_higher_degree_starts_as_the_same_model() -> None:
    plain = damper("viscous_dahl")
    earlier = plain.with_current_laws({"k_w": "linear"})
    richer = plain.with_current_laws({"k_w": "quadratic", "k_x": "linear"})
    theta = np.array([800.0, 200.0, 500.0, 2000.0, 20.0])
    found = in_other_dependences(earlier, theta, richer, np.array(COMMANDS))
    assert found == pytest.approx([800.0, 0.0, 200.0, 500.0, 0.0, 2000.0, 20.0], abs=1e-9)
    assert in_other_dependences(richer, found, earlier, np.array(COMMANDS)) == pytest.approx(theta)


@pytest.mark.parametrize(
    ("chosen", "settings", "word"),
    [
        (slice(0, 1), FitSettings(), "one test was given"),
        (slice(0, None, 3), FitSettings(), "at 1 command"),
        (slice(None), FitSettings(starts=({"k_x": 1.0},)), "no starts"),
        (slice(None), FitSettings(bounds={"k_w.0": (0.0, 1.0)}), "'k_w.0'"),
    ],
)
def test_what_cannot_be_chosen_is_refused(
    tests: tuple[DamperTest, ...], chosen: slice, settings: FitSettings, word: str
) -> None:
    refusal(choose_laws, "viscous_dahl", tests[chosen], settings=settings, match=word)


def test_laws_are_compared_on_cycles_from_the_middle_of_a_record() -> None:
    test = sinusoidal_test("viscous_dahl", (800.0, 300.0, 2000.0, 20.0), (0.010, 1.0), noise=0.0, cycles=20)
    short = middle_excerpt(test)
    ends = short.start_time, short.start_time + short.n_time * short.dt
    assert np.mean(ends) == pytest.approx(10.0, abs=0.1)
    assert ends[1] - ends[0] == pytest.approx(3.0 + test.n_settle * test.dt, abs=0.1)
    few = replace(
        test, displacement=test.displacement[:90], velocity=test.velocity[:90], force=test.force[:90]
    )
    assert middle_excerpt(few).n_time == 90
    fine = mr.synthetic_test("spencer1997")
    assert middle_excerpt(fine).dt == pytest.approx(4.0 * fine.dt)


def test_a_motion_that_begins_and_dies_away_loses_its_ends_where_another_shows_smaller_ones() -> None:
    test = sinusoidal_test("viscous_dahl", (800.0, 300.0, 2000.0, 20.0), (0.010, 1.0), noise=0.0, cycles=12)

    def with_sizes(*sizes: float) -> DamperTest:
        size = np.interp(test.time, np.arange(len(sizes)) * 12.0 / (len(sizes) - 1), sizes)
        return replace(test, displacement=size * test.displacement, velocity=size * test.velocity)

    dying = with_sizes(0.3, *[1.0] * 11, 0.3)
    smaller = replace(test, displacement=0.5 * test.displacement, velocity=0.5 * test.velocity)
    short, kept = middle_excerpts([dying, with_sizes(0.15, *[0.5] * 11, 0.15)])
    assert short.n_time * short.dt < 5.0
    # The smallest motion of a command shows its ends, which no other test has.
    assert kept.n_time * kept.dt > 10.0
    assert middle_excerpts([dying])[0].n_time * short.dt > 10.0
    # Motions that grow, or that have a part of another stroke, stay whole.
    for other in (
        with_sizes(0.2, 1.0),
        with_sizes(*[1.0] * 8, *[0.5] * 5),
        with_sizes(*[1.0] * 6, 0.5, *[1.0] * 6),
    ):
        assert middle_excerpts([other, smaller])[0].n_time * short.dt > 10.0


@pytest.fixture(scope="module")
def gapped(settings: FitSettings) -> Choice:
    """A choice from tests at 0, 0.5 and 1.5 A of a yield force of 110, 640 and 1430 N, quadratic in the command."""
    tests = [
        sinusoidal_test(
            "viscous_dahl",
            (800.0, 110.0 + 1150.0 * command - 180.0 * command**2, 2000.0, 20.0),
            motion,
            noise=0.02,
            rng=seed,
            command=command,
        )
        for seed, (motion, command) in enumerate(product(MOTIONS[:2], (0.0, 0.5, 1.5)))
    ]
    return choose_laws("viscous_dahl", tests, settings=settings, threads=1)


@pytest.mark.long
def test_of_two_forms_that_no_test_tells_apart_the_one_without_an_extremum_is_chosen(gapped: Choice) -> None:
    assert gapped.ranking.chosen_standing.laws["k_w"] == "quadratic"
    assert "extremum_untested" not in {each.code for each in gapped.best.remarks}
    values = dict(law_values(gapped.best.spec, np.array(gapped.best.theta), np.array([1.0])))
    (at_one,) = (value for parameter, value in values.items() if parameter.name == "k_w")
    # The truth; logarithms of the values give about 1500 N.
    assert at_one == pytest.approx(1080.0, rel=0.03)


def test_the_other_form_of_the_chosen_laws_is_a_set_that_differs_between_the_commands(gapped: Choice) -> None:
    fit, test = (
        gapped.best,
        sinusoidal_test(
            "viscous_dahl", (800.0, 1080.0, 2000.0, 20.0), MOTIONS[0], noise=0.02, rng=9, command=1.0
        ),
    )
    assert any("log_quadratic:0,0.5,1.5" in map(str, other.spec.laws) for other in gapped.best.others)
    prediction = mr.predict(fit, test)
    assert prediction.outside.names == ("command",)
    assert prediction.sets_apart.percent > 20.0
    at_tested = mr.predict(fit, fit.tests[-1])
    assert at_tested.sets_apart is None or at_tested.sets_apart.percent < 5.0


def test_a_law_that_is_given_is_warned_of_its_extremum_with_the_form_that_has_none(gapped: Choice) -> None:
    spec = mr.damper("viscous_dahl").with_current_laws({"k_w": "log_quadratic:0,0.5,1.5"}, unit="A")
    theta = [800.0, 110.0, 640.0, 1430.0, 2000.0, 20.0]
    (found,) = hidden_extrema(spec, theta, (0.0, 0.5, 1.5))
    assert "between the tested commands 0.5 and 1.5 A" in found.remark.message
    assert found.remark.measured is not None
    assert found.remark.measured.value > 1.05 * 1430.0
    assert str(found.instead) == "quadratic:0,0.5,1.5"
    # A test that shows the values there leaves nothing hidden, whatever they are.
    assert hidden_extrema(spec, theta, np.linspace(0.0, 1.5, 16).tolist()) == ()
    fit = mr.identify(spec, gapped.best.tests, threads=1)
    (told,) = [each for each in fit.remarks if each.code == "extremum_untested"]
    assert "give k_w=quadratic:0,0.5,1.5" in told.message


def test_monotone_cubics_take_the_place_of_two_forms_with_an_extremum() -> None:
    spec = mr.damper("viscous_dahl").with_current_laws({"rho": "log_quadratic:0,0.5,1.5"}, unit="A")
    theta = [800.0, 600.0, 5400.0, 930.0, 430.0, 20.0]
    (found,) = hidden_extrema(spec, theta, (0.0, 0.5, 1.5))
    assert str(found.instead) == "monotone:0,0.5,1.5"


@pytest.mark.parametrize(
    ("law", "values", "objects"),
    [
        ("quadratic", (110.0, 1150.0, -600.0), True),
        ("log_cubic:0,0.25,0.5,1.5", (10.0, 400.0, 640.0, 700.0), False),
    ],
)
def test_an_extremum_between_commands_is_an_objection_unless_the_law_has_a_value_at_each(
    law: str, values: tuple[float, ...], objects: bool
) -> None:
    levels = (0.0, 0.25, 0.5, 1.5)
    spec = mr.damper("viscous_dahl").with_current_laws({"k_w": law}, unit="A")
    theta = np.array([800.0, *values, 2000.0, 20.0])
    tests = [
        sinusoidal_test(
            "viscous_dahl", (800.0, 500.0, 2000.0, 20.0), MOTIONS[0], noise=0.0, rng=1, command=level
        )
        for level in levels
    ]
    assert [extremum.parameter for extremum in hidden_extrema(spec, theta, levels)] == ["k_w"]
    objections = objections_to(spec, theta, tests, BuildingCost.of(spec, theta, tests))
    assert any((each.code, each.words[0]) == ("extremum_untested", "k_w") for each in objections) is objects


def test_the_next_test_is_within_a_gap_of_the_commands(gapped: Choice) -> None:
    fit = gapped.best
    candidates = candidate_grid(fit.spec, fit.tests, amplitudes=[0.01], frequencies=[1.0])
    assert [each.command for each in candidates] == [0.0, 0.5, 1.0, 1.5]
    plan = mr.plan(fit, fit.tests, candidates, threads=1)
    assert plan.gains[0].candidate.command == 1.0
    assert "between 0.5 and 1.5 A" in plan.sentence
