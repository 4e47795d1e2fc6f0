"""Laws are named where they turn negative, vanish or leave the range that the model admits, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.dampers import LawName
from mrwork.dampers.parameters import current_laws
from mrwork.dampers.spec import law_limits, worst_laws
from mrwork.simulation import Loading, simulate_force

DAHL = {"rho": 2000.0, "f0": 0.0}


def dahl(law: LawName, *coefficients: float) -> tuple[mr.DamperSpec, list[float]]:
    return mr.damper("dahl").with_current_laws({"k_w": law}, unit="A"), [*coefficients, *DAHL.values()]


def test_a_law_that_turns_negative_is_named_with_its_commands() -> None:
    (found,) = law_limits(*dahl("linear", -100.0, 1000.0), (0.0, 1.0))
    assert (found.parameter, found.value, found.used, found.command) == ("k_w", -100.0, 1e-3, 0.0)
    assert (found.first, found.last) == (0.0, 0.1)
    assert found.in_words == "the law of k_w turns negative: -100 N at 0 A, taken as 0.001 N from 0 to 0.1 A"


def test_the_value_that_is_used_is_that_of_the_simulation() -> None:
    spec, theta = dahl("linear", -100.0, 1000.0)
    (found,) = law_limits(spec, theta, (0.0, 1.0))
    time = np.linspace(0.0, 1.0, 400)
    motion = {"dt": time[1], "displacement": 0.01 * np.sin(6.0 * time), "velocity": 0.06 * np.cos(6.0 * time)}
    lawful = simulate_force(spec, theta, Loading(**motion, command=found.command, command_unit="A"))
    plain = simulate_force(mr.damper("dahl"), [found.used, *DAHL.values()], Loading(**motion))
    np.testing.assert_array_equal(lawful, plain)


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


def test_an_offset_may_be_negative_and_a_constant_has_no_law() -> None:
    spec = mr.damper("dahl").with_current_laws({"f0": "linear"}, unit="A")
    assert law_limits(spec, [500.0, 2000.0, 10.0, -50.0], (0.0, 1.0)) == ()
    assert law_limits(mr.damper("dahl"), [500.0, 2000.0, 0.0], (0.0, 1.0)) == ()


def test_of_several_runs_the_worst_command_of_a_parameter_is_kept() -> None:
    spec, theta = dahl("linear", -100.0, 1000.0)
    runs = [limit for lowest in (0.05, 0.0, 0.08) for limit in law_limits(spec, theta, (lowest, 1.0))]
    assert [each.command for each in worst_laws(runs)] == [0.0]


@pytest.mark.parametrize("name", list(current_laws()))
def test_the_values_of_a_law_are_those_of_its_equation(name: LawName) -> None:
    law = current_laws()[name]
    coefficients = np.array([3.0, -2.0, 0.7, 0.2])[: law.n_coefficients]
    command = np.array([0.0, 0.4, 1.3])
    expected = sum(value * command**power for power, value in enumerate(coefficients))
    if law.is_exponential:
        expected = 3.0 - 2.0 * np.exp(0.7 * command)
    np.testing.assert_allclose(law.values(coefficients, command), expected, rtol=1e-12)


def test_a_command_that_no_driver_gives_its_unit_and_a_misspelt_law_are_refused(refused: Refused) -> None:
    refused(mr.damper("dahl").with_current_laws, {"k_w": "linear"}, unit="kg")
    refused(mr.damper("dahl").with_current_laws, {"k_w": "linaer"})
    for command in (-5.0, 1e9, np.linspace(-1, 1, 20)):
        refused(Loading(dt=0.01, displacement=np.zeros(20), command=command, command_unit="A").history)
    refused(Loading, dt=0.01, displacement=np.zeros(20), command=1.0, command_unit="kg")
