"""Groups of dampers of one model, each with parameters, laws and a driver of its own, are simulated in one loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from loop_samples import devices, five_storeys, friction, law_with_gains, plant_with, rd1005, sweep
from refusals import refusal

import mrwork as mr
from mrwork import Device
from mrwork.buildings.groups import with_common_laws
from mrwork.closed_loop import simulate_loop
from mrwork.closed_loop.responses import Responses
from mrwork.control import ControlLaw
from mrwork.dampers.spec import plain_parameters

PLAIN = mr.damper("bingham")
# Coefficients of each law of the yield force, and laws and numbers that are those of all groups.
LAWS: Mapping[str, tuple[float, ...]] = {
    "constant": (400.0,),
    "linear": (20.0, 300.0),
    "quadratic": (20.0, 350.0, -40.0),
    "cubic": (20.0, 350.0, -40.0, 5.0),
    "exponential": (600.0, -500.0, -1.0),
    "values:0,1,2": (20.0, 300.0, 500.0),
    "values:0,0.4,2.5": (30.0, 150.0, 600.0),
    "linear:0,2": (20.0, 640.0),
    "quadratic:0,1,2": (20.0, 300.0, 500.0),
    "quadratic:0.5,1,1.5": (170.0, 300.0, 400.0),
}


def group(
    law: str, *, storey: int = 0, largest: float = 1.5, unit: str = "A", lagged: bool = False
) -> Device:
    """A damper whose yield force follows the command by a law, and its dashpot by a straight line."""
    spec = PLAIN.with_current_laws({"f_c": law, "c0": "linear"}, unit=unit, lagged=lagged)
    theta = [*LAWS[law], 0.02, 200.0, 500.0, 0.0, *([190.0] if lagged else [])]
    row = five_storeys().storeys[storey]
    return Device(name=law, spec=spec, theta=theta, row=row, largest_command=largest)


def run(loop: Sequence[Device]) -> Responses:
    law = law_with_gains("clipped_optimal", plant_with(list(loop)))
    return simulate_loop(five_storeys(), loop, law, [sweep()], histories=True)


def assert_same_runs(one: Responses, other: Responses, rtol: float = 0.0) -> None:
    for name, numbers in one.numbers.items():
        np.testing.assert_allclose(other.numbers[name], numbers, rtol=rtol, atol=1e-9 * rtol, err_msg=name)


@pytest.mark.parametrize("lagged", [False, True])
def test_laws_of_lower_degree_are_those_of_the_higher_one_to_the_bit(lagged: bool) -> None:
    low, high = group("linear", lagged=lagged), group("cubic", storey=1, lagged=lagged, largest=1.0)
    fixed = group("constant", storey=2, lagged=lagged)
    rest = np.asarray(low.theta)[2:]
    written = [
        replace(low, spec=high.spec, theta=[20.0, 300.0, 0.0, 0.0, *rest]),
        high,
        replace(fixed, spec=high.spec, theta=[400.0, 0.0, 0.0, 0.0, *rest]),
    ]
    assert_same_runs(run([low, high, fixed]), run(written))
    # The order of the groups changes nothing.
    turned = run([high, fixed, low])
    np.testing.assert_array_equal(turned.peak_drift, run([written[1], written[2], written[0]]).peak_drift)


def test_laws_by_values_are_brought_to_the_same_commands() -> None:
    for one, other in (
        ("values:0,1,2", "values:0,0.4,2.5"),
        ("quadratic", "quadratic:0,1,2"),
        ("linear:0,2", "quadratic:0,1,2"),
        ("constant", "values:0,1,2"),
        ("constant", "exponential"),
        ("linear", "quadratic:0.5,1,1.5"),
    ):
        first, second = group(one), group(other, storey=1, largest=2.0)
        alike = with_common_laws([first, second])
        assert alike[0].spec == alike[1].spec
        for given, written in zip((first, second), alike, strict=True):
            for command in np.linspace(0.0, given.largest_command, 31).tolist():
                np.testing.assert_allclose(
                    plain_parameters(written.spec, written.draws[0], command),
                    plain_parameters(given.spec, given.draws[0], command),
                    rtol=1e-9,
                )
        assert run([first, second]).peak_drift.min() > 0.0


def test_equal_laws_stay_as_they_are() -> None:
    loop = devices(rd1005())
    assert all(one is other for one, other in zip(with_common_laws(loop), loop, strict=True))


def test_groups_without_a_common_form_are_refused() -> None:
    building, law = five_storeys(), ControlLaw(name="passive", gains={"command": [1.0, 1.0]})
    passive = replace(group("linear"), name="plain", spec=PLAIN, theta=[400.0, 0.02, 200.0, 0.0])
    beyond = replace(group("constant"), theta=[1e12, 0.02, 200.0, 500.0, 0.0])
    for one, other, word in (
        (group("quadratic"), group("exponential"), "no form in common"),
        (group("quadratic"), group("values:0,1,2"), "no form in common"),
        (group("quadratic:0.5,1,1.5"), group("cubic"), "no form in common"),
        (beyond, group("linear"), "no form in common within its range"),
        (group("linear"), group("quadratic", unit="V"), "in V"),
        (group("linear"), group("quadratic", lagged=True), "with a lag"),
        (group("linear"), passive, "follows no command"),
    ):
        loop = [one, replace(other, row=building.storeys[1])]
        refusal(simulate_loop, building, loop, law, [sweep()], match=word)


def test_a_device_gets_no_more_than_its_own_largest_command() -> None:
    small, large = devices(friction())
    loop = [replace(small, largest_command=0.5), replace(large, largest_command=1.5)]
    law = ControlLaw(name="decentralised_bang_bang", gains={})
    many = simulate_loop(five_storeys(), loop, law, [sweep()], largest_commands=[0.25, 1.0, 1.5])
    for candidate, largest in enumerate((0.25, 1.0, 1.5)):
        limited = [replace(each, largest_command=min(each.largest_command, largest)) for each in loop]
        alone = simulate_loop(five_storeys(), limited, law, [sweep()])
        np.testing.assert_allclose(many.peak_drift[candidate], alone.peak_drift[0], rtol=1e-9)
        np.testing.assert_allclose(many.peak_current[candidate], alone.peak_current[0], rtol=1e-9)
