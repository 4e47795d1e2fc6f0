"""Groups of dampers, each of a model with parameters, laws and a driver of its own, are simulated in one loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from loop_samples import devices, five_storeys, friction, law_with_gains, plant_with, rd1005, sweep
from refusals import refusal
from scipy.integrate import solve_ivp

import mrwork as mr
from mrwork import Device
from mrwork.buildings.groups import groups_of
from mrwork.closed_loop import simulate_loop
from mrwork.closed_loop.responses import Responses
from mrwork.control import ControlLaw

PLAIN = mr.damper("bingham")
STOREYS = five_storeys().storeys
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


def assert_same_runs(one: Responses, other: Responses, rtol: float) -> None:
    # The error of the balance of energies is rounding.
    for name in one.numbers.keys() - {"energy_error"}:
        numbers = one.numbers[name]
        np.testing.assert_allclose(other.numbers[name], numbers, rtol=rtol, atol=1e-9 * rtol, err_msg=name)


@pytest.mark.parametrize("lagged", [False, True])
def test_a_group_by_another_law_has_the_forces_of_its_curve(lagged: bool) -> None:
    # 20 + 300 u of the yield force, by its coefficients, by values, and as a cubic.
    straight = group("linear", lagged=lagged), replace(group("linear", lagged=lagged), row=STOREYS[1])
    others = {"values:0,1": (20.0, 320.0), "linear:0,2": (20.0, 620.0), "cubic": (20.0, 300.0, 0.0, 0.0)}
    for law, coefficients in others.items():
        spec = PLAIN.with_current_laws({"f_c": law, "c0": "linear"}, unit="A", lagged=lagged)
        theta = [*coefficients, *np.asarray(straight[1].theta)[2:]]
        if law == "values:0,1":
            theta[:2] = [20.0, 20.0]
            same = replace(straight[1], theta=[20.0, 0.0, *np.asarray(straight[1].theta)[2:]])
        else:
            same = straight[1]
        mixed = run([straight[0], replace(same, spec=spec, theta=theta)])
        assert_same_runs(run([straight[0], same]), mixed, rtol=1e-9)


def test_the_order_of_groups_changes_nothing() -> None:
    one, other, third = bingham_and_dahl()[0], bingham_and_dahl()[1], group("exponential", storey=2)
    found = run([one, other, third])
    for order in ([2, 0, 1], [1, 2, 0]):
        turned = run([[one, other, third][place] for place in order])
        np.testing.assert_allclose(turned.peak_drift, found.peak_drift, rtol=1e-12)
        np.testing.assert_allclose(turned.peak_force, found.peak_force[..., order], rtol=1e-12)


def test_neighbours_of_one_model_are_a_group() -> None:
    first, second = devices(rd1005())
    third = bingham_and_dahl()[0]
    assert groups_of([first, second, third, first]) == [[0, 1], [2], [3]]


def bingham_and_dahl() -> tuple[Device, Device]:
    """Two models across the first two storeys, each with a lag of its own."""
    spec = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A", lagged=True)
    theta = [50.0, 700.0, 2000.0, 0.0, 60.0]
    dahl = Device(name="dahl", spec=spec, theta=theta, row=STOREYS[1], largest_command=1.0)
    return group("quadratic", lagged=True), dahl


def test_two_models_in_one_frame_are_those_of_scipy() -> None:
    bingham, dahl = bingham_and_dahl()
    frame, time = five_storeys(), np.arange(0.0, 2.0, 0.01)
    motion = mr.GroundMotion(name="sweep", dt=0.01, acceleration=3.0 * np.sin(12.0 * time + 3.0 * time**2))
    law = ControlLaw(name="passive", gains={"command": [0.8, 0.6]})
    found = simulate_loop(frame, [bingham, dahl], law, [motion], histories=True, step_factor=8)
    n, rows = frame.n_coordinates, np.array([bingham.row, dahl.row])
    inverse = np.linalg.inv(frame.mass)
    # Of a passive law, the current follows the command from zero.
    first, second = (np.asarray(each.theta, dtype=float) for each in (bingham, dahl))

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        q, v, z, (one, two) = y[:n], y[n : 2 * n], y[2 * n], y[2 * n + 1 :]
        rate = rows @ v
        f_c = first[0] + first[1] * one + first[2] * one**2
        c0 = first[4] + first[5] * one
        force = [
            f_c * np.tanh(rate[0] / first[3]) + c0 * rate[0] + first[6],
            (second[0] + second[1] * two) * z + second[3],
        ]
        loop = second[2] * (rate[1] - np.abs(rate[1]) * z)
        ground = np.interp(t, time, motion.acceleration)
        push = -frame.damping @ v - frame.stiffness @ q - rows.T @ np.array(force)
        accelerations = inverse @ push - frame.influence * ground
        lags = [-first[-1] * (one - 0.8), -second[-1] * (two - 0.6)]
        return np.array([*v, *accelerations, loop, *lags])

    start = np.zeros(2 * n + 3)
    start[-2:] = 0.8, 0.6
    solved = solve_ivp(rates, (0.0, time[-1]), start, max_step=5e-4, rtol=1e-9, atol=1e-12, dense_output=True)
    history = found.histories[0]
    expected = solved.sol(history.time)[:n].T @ frame.floors.T
    largest = np.abs(history.displacement).max()
    np.testing.assert_allclose(history.displacement, expected, rtol=0.0, atol=2e-6 * largest)


def test_drivers_of_other_kinds_are_refused() -> None:
    building, law = five_storeys(), ControlLaw(name="passive", gains={"command": [1.0, 1.0]})
    passive = replace(group("linear"), name="plain", spec=PLAIN, theta=[400.0, 0.02, 200.0, 0.0])
    for one, other, word in (
        (group("linear"), group("quadratic", unit="V"), "in V"),
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
