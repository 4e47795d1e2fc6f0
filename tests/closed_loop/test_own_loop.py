"""Loops with dampers of the user: JAX has all results of the core with a registered model of the same equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import own_dampers
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Hardware, LoopVariation, Responses, UserLaw, simulate_loop
from mrwork.closed_loop.own_runs import OWN_LAWS
from mrwork.control import ControlLaw
from mrwork.dampers import DamperSpec
from mrwork.twins.own_loop import LAWS

# Tolerance for some thousand steps with another order of summation.
AGREEMENT = 1e-9
LAG = 190.0
FRAME = mr.buildings.shear_building(
    name="frame", masses=[22.7, 22.7], stiffnesses=[29.7e3, 29.7e3], heights=[3.0, 2.5]
)
MOTIONS = [mr.synthetic_motion(rng=rng, duration=2.0, peak=2.0) for rng in (0, 1)]
LATE = Hardware(sample_time=2e-3, step=1e-3, delay=3e-3)
STATIC_LAWS = {"c": "linear", "alpha": "quadratic"}
STATIC_THETA = [20.0, 10.0, 100.0, 4.0, 9.0, -1.0, 50.0, 0.5, 1e-3, 3.0]
LOOP_LAWS = {"c": "linear", "k_w": "linear"}
LOOP_THETA = [10.0, 10.0, 100.0, 1e-3, 4.0, 8.0, 500.0, 0.8, 1.5, LAG]
GAIN = [[10.0, -40.0, -120.0, 15.0]]
WEIGHT = [[0.3, -0.1, -1.0, 0.2]]
LEVELS = ControlLaw(name="passive", gains={"command": [[0.0], [0.7], [2.0]]})
NETWORK = ControlLaw(
    name="signal_network",
    gains={"gain": GAIN, "network": np.random.default_rng(3).normal(size=(1, 25))},
    dead_zone=1e-2,
    command_slope=20.0,
)
# A belief of a law about its damper: a tenth too strong.
CURVE = mr.damper("static_hysteretic").with_current_laws(STATIC_LAWS), [1.1 * each for each in STATIC_THETA]
DIRECT = ControlLaw(name="proportional_direct", gains={"weight": WEIGHT, "slope": [0.5]}, curve=CURVE)
STATIC = (own_dampers.static, mr.damper("static_hysteretic"))
LOOP = (own_dampers.loop, mr.damper("normalised_bouc_wen"))


def device(spec: DamperSpec, theta: object, **changes: object) -> mr.Device:
    """A damper in the first storey."""
    return mr.Device(
        name="damper", spec=spec, theta=theta, row=FRAME.storeys[0], largest_command=2.0, **changes
    )


def agree(found: Responses, expected: Responses) -> None:
    """Outcomes and steps are equal, quantities and histories to rounding."""
    assert found.steps.tolist() == expected.steps.tolist()
    assert found.outcome.tolist() == expected.outcome.tolist()
    for name, values in expected.numbers.items():
        # Rounding of energies, which the error is made of.
        least = 1e-12 if name == "energy_error" else 0.0
        np.testing.assert_allclose(found.numbers[name], values, rtol=AGREEMENT, atol=least, err_msg=name)
    for own, other in zip(found.histories or (), expected.histories or (), strict=True):
        for name, rows in other.numbers.items():
            least = AGREEMENT * np.abs(rows).max(initial=0.0)
            np.testing.assert_allclose(own.numbers[name], rows, rtol=0.0, atol=least, err_msg=name)


def test_constant_commands_behind_lag_and_delay_with_histories() -> None:
    runs = [
        simulate_loop(
            FRAME,
            [device(plain.with_current_laws(LOOP_LAWS, lagged=True), LOOP_THETA, count=1.5)],
            LEVELS,
            MOTIONS,
            LATE,
            histories=True,
        )
        for plain in LOOP
    ]
    agree(*runs)


def test_steps_are_added_until_the_states_are_resolved() -> None:
    theta = [*LOOP_THETA[:6], 1e5, *LOOP_THETA[7:]]
    runs = [
        simulate_loop(
            FRAME, [device(plain.with_current_laws(LOOP_LAWS, lagged=True), theta)], LEVELS, MOTIONS[:1], LATE
        )
        for plain in LOOP
    ]
    # The bound of the core holds for any motion of that peak, the radius along the run for this one.
    assert (runs[0].steps > LATE.steps).any()
    assert (runs[0].steps <= runs[1].steps).all()
    np.testing.assert_allclose(runs[0].peak_drift, runs[1].peak_drift, rtol=1e-4)


def test_realisations_and_a_shaped_law() -> None:
    stiffer = replace(FRAME, stiffness=1.1 * FRAME.stiffness)
    variation = LoopVariation(
        buildings=(FRAME, stiffer), delay=np.array([0.0, 2.5e-3]), seed=np.zeros(2, dtype=np.int64)
    )
    draws = np.array([LOOP_THETA[:-1]]) * np.array([[1.0], [0.9]])
    runs = [
        simulate_loop(
            FRAME,
            [device(plain.with_current_laws(LOOP_LAWS), draws)],
            NETWORK,
            MOTIONS[:1],
            variation=variation,
        )
        for plain in LOOP
    ]
    agree(*runs)
    assert np.ptp(runs[0].peak_drift[:, 0]) > 0.0


def test_two_differential_pairs_with_states_under_a_law_that_switches() -> None:
    """In other storeys, of other numbers, and each with its own command."""
    law = ControlLaw(name="lyapunov", gains={"weight": [*WEIGHT, [0.1, 0.2, 0.4, -0.8]]})
    runs = []
    for plain in LOOP:
        first = device(plain.with_current_laws(LOOP_LAWS, lagged=True), LOOP_THETA, differential=True)
        second = replace(first, name="second", row=FRAME.storeys[1], count=2.0)
        runs.append(simulate_loop(FRAME, [first, second], law, MOTIONS[:1], LATE))
    agree(*runs)
    assert np.all((runs[0].mean_current > 0.0) & (runs[0].mean_current < 2.0))


STATIC_CASES = {
    "belief in a curve": (DIRECT, True),
    "clipped optimal": (ControlLaw(name="clipped_optimal", gains={"gain": GAIN}), False),
    "modified clipped optimal": (
        ControlLaw(name="modified_clipped_optimal", gains={"gain": GAIN, "full_force": [30.0]}),
        False,
    ),
}


@pytest.mark.parametrize(("law", "differential"), STATIC_CASES.values(), ids=STATIC_CASES)
def test_dampers_without_states(law: ControlLaw, differential: bool) -> None:
    runs = [
        simulate_loop(
            FRAME,
            [device(plain.with_current_laws(STATIC_LAWS), STATIC_THETA, differential=differential)],
            law,
            MOTIONS[:1],
        )
        for plain in STATIC
    ]
    agree(*runs)
    assert 0.0 < runs[0].mean_current[0, 0] < 2.0


def test_the_laws_that_are_not_refused_are_those_of_the_twin() -> None:
    assert set(OWN_LAWS) == set(LAWS)


def test_a_damper_that_is_too_stiff_is_unresolved() -> None:
    stiff = device(own_dampers.static.with_current_laws(STATIC_LAWS), [1e9, *STATIC_THETA[1:]])
    run = simulate_loop(FRAME, [stiff], DIRECT, MOTIONS[:1])
    assert run.outcome.tolist() == [mr.dampers.Outcome.UNRESOLVED]
    assert run.steps.tolist() == [0]
    assert np.isinf(run.peak_drift).all()


def test_what_the_twin_lacks_is_refused() -> None:
    own = [device(own_dampers.static.with_current_laws(STATIC_LAWS), STATIC_THETA)]
    inverse = ControlLaw(name="inverse_direct", gains={"gain": [[1.0, 0.0, 0.0, 0.0]]}, curve=CURVE)
    noisy = Hardware(force_noise=1.0)
    refusal(simulate_loop, FRAME, own, inverse, MOTIONS, noisy, match=r"inverse_direct, or sensors.*like =")
    mine = UserLaw(name="mine", command=lambda sample, memory: 0.0)
    refusal(simulate_loop, FRAME, own, mine, MOTIONS, match="mine in Python")


@pytest.mark.parametrize("spec", STATIC, ids=["own", "registered"])
def test_ideal_actuators_replace_any_damper(spec: DamperSpec) -> None:
    active = ControlLaw(name="active", gains={"gain": [[1e3, 0.0, 10.0, 0.0]]})
    run = simulate_loop(
        FRAME, [device(spec.with_current_laws(STATIC_LAWS), STATIC_THETA)], active, MOTIONS[:1]
    )
    assert run.outcome.tolist() == [0]
