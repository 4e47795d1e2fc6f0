"""Loops with dampers of the user: all results of a registered model of the same equations."""

from dataclasses import replace

import numpy as np
import own_dampers
import pytest

import mrwork as mr

# Tolerance for some thousand steps with other roundings of exp, tanh and powers.
AGREEMENT = 1e-12
LAG = 190.0
FRAME = mr.buildings.shear_building(
    name="frame", masses=[22.7, 22.7], stiffnesses=[29.7e3, 29.7e3], heights=[3.0, 2.5]
)
# The second is finer than the step.
MOTIONS = [
    mr.synthetic_motion(rng=0, duration=2.0, peak=2.0),
    mr.GroundMotion(
        name="fine", dt=3.3e-4, acceleration=20.0 * np.random.default_rng(3).standard_normal(3000)
    ),
]
LATE = mr.Hardware(sample_time=2e-3, step=1e-3, delay=3e-3)
STATIC_LAWS = {"c": "linear", "alpha": "quadratic"}
STATIC_THETA = [20.0, 10.0, 100.0, 4.0, 9.0, -1.0, 50.0, 0.5, 1e-3, 3.0]
LOOP_LAWS = {"c": "linear", "k_w": "linear"}
LOOP_THETA = [10.0, 10.0, 100.0, 1e-3, 4.0, 8.0, 500.0, 0.8, 1.5, LAG]
GAIN = [[10.0, -40.0, -120.0, 15.0]]
WEIGHT = [[0.3, -0.1, -1.0, 0.2]]
LEVELS = mr.ControlLaw(name="passive", gains={"command": [[0.0], [0.7], [2.0]]})
# A belief of a law about its damper: a tenth too strong.
CURVE = mr.damper("static_hysteretic").with_current_laws(STATIC_LAWS), [1.1 * each for each in STATIC_THETA]
DIRECT = mr.ControlLaw(name="proportional_direct", gains={"weight": WEIGHT, "slope": [0.5]}, curve=CURVE)
STATIC = (own_dampers.static, mr.damper("static_hysteretic"))
LOOP = (own_dampers.loop, mr.damper("normalised_bouc_wen"))


def device(spec: mr.DamperSpec, theta: object, **changes: object) -> mr.Device:
    """A damper in the first storey."""
    return mr.Device(
        name="damper", spec=spec, theta=theta, row=FRAME.storeys[0], largest_command=2.0, **changes
    )


def agree(found: mr.Responses, expected: mr.Responses) -> None:
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
        mr.simulate_loop(
            FRAME,
            [device(plain.with_current_laws(LOOP_LAWS, lag="one_rate"), LOOP_THETA, count=1.5)],
            LEVELS,
            MOTIONS,
            LATE,
            histories=True,
        )
        for plain in LOOP
    ]
    agree(*runs)


def test_two_differential_pairs_with_states_under_a_law_that_switches() -> None:
    """In other storeys, of other numbers, and each with its own command."""
    law = mr.ControlLaw(name="lyapunov", gains={"weight": [*WEIGHT, [0.1, 0.2, 0.4, -0.8]]})
    runs = []
    for plain in LOOP:
        first = device(plain.with_current_laws(LOOP_LAWS, lag="one_rate"), LOOP_THETA, differential=True)
        second = replace(first, name="second", row=FRAME.storeys[1], count=2.0)
        runs.append(mr.simulate_loop(FRAME, [first, second], law, MOTIONS[:1], LATE))
    agree(*runs)
    assert np.all((runs[0].mean_current > 0.0) & (runs[0].mean_current < 2.0))


def test_a_damper_of_the_user_beside_dampers_of_the_package_one_of_which_holds_a_command() -> None:
    law = mr.ControlLaw(name="clipped_optimal", gains={"gain": [*GAIN, [20.0, -10.0, -50.0, 80.0]]})
    core = mr.damper("static_hysteretic").with_current_laws(STATIC_LAWS)
    beside = replace(device(core, STATIC_THETA), name="of the package", row=FRAME.storeys[1], count=2.0)
    maxwell = mr.damper("maxwell")
    passive = mr.Device(name="passive", spec=maxwell, theta=maxwell.nominal, row=FRAME.storeys[1])
    runs = []
    for plain in LOOP:
        spec = plain.with_current_laws(LOOP_LAWS, lag="one_rate")
        first = device(spec, LOOP_THETA)
        held = replace(first, name="held", row=FRAME.storeys[1], command=0.7, differential=True)
        loop = [first, beside, held, passive]
        runs.append(mr.simulate_loop(FRAME, loop, law, MOTIONS[:1], LATE, histories=True))
    own, lanes = runs
    np.testing.assert_array_equal(own.steps, lanes.steps)
    assert (own.histories[0].command[:, 2:] == [0.7, 0.0]).all()  # type: ignore[index] # they are kept
    agree(own, lanes)


STATIC_CASES = {
    "belief in a curve": (DIRECT, True),
    "clipped optimal": (mr.ControlLaw(name="clipped_optimal", gains={"gain": GAIN}), False),
}


@pytest.mark.parametrize(("law", "differential"), STATIC_CASES.values(), ids=STATIC_CASES)
def test_dampers_without_states(law: mr.ControlLaw, differential: bool) -> None:
    runs = [
        mr.simulate_loop(
            FRAME,
            [device(plain.with_current_laws(STATIC_LAWS), STATIC_THETA, differential=differential)],
            law,
            MOTIONS[:1],
        )
        for plain in STATIC
    ]
    agree(*runs)
    assert 0.0 < runs[0].mean_current[0, 0] < 2.0


def test_slopes_of_a_score_are_those_of_the_model() -> None:
    along = mr.closed_loop.LoopVariation(
        buildings=(FRAME,), delay=np.zeros(1), seed=np.zeros(1, int), changes=np.ones((1, 5))
    )
    slopes = [
        mr.simulate_loop(
            FRAME,
            [device(plain.with_current_laws(STATIC_LAWS), STATIC_THETA)],
            DIRECT,
            MOTIONS[:1],
            variation=along,
        ).slopes
        for plain in STATIC
    ]
    for own, core in zip(*slopes, strict=True):
        for name, values in core.items():
            least = 1e-12 if name == "energy_error" else 0.0
            np.testing.assert_allclose(own[name], values, rtol=AGREEMENT, atol=least, err_msg=name)


NOISY = mr.Hardware(sample_time=1e-3, feedback="observer", acceleration_noise=0.02, force_noise=2.0)


MANY_LAWS = {
    "one that switches on its readings": mr.ControlLaw(name="maximum_energy_dissipation", gains={}),
    "one of the user": mr.closed_loop.UserLaw(
        name="brake", command=lambda sample, memory: np.clip(2.0 * np.abs(sample.rate), 0.0, 2.0)
    ),
}


@pytest.mark.parametrize("law", MANY_LAWS.values(), ids=MANY_LAWS)
def test_laws_with_an_observer_and_noise(law: mr.ControlLaw) -> None:
    runs = [
        mr.simulate_loop(
            FRAME, [device(plain.with_current_laws(STATIC_LAWS), STATIC_THETA)], law, MOTIONS[:1], NOISY
        )
        for plain in STATIC
    ]
    agree(*runs)
    assert 0.0 < runs[0].mean_current[0, 0] < 2.0


def test_a_loop_without_a_relaxation_is_resolved_by_its_own_motion() -> None:
    """Fewer or as many steps as under the bound of the crate, and the same response as with many more."""
    stiff = [10.0, 10.0, 100.0, 1e-3, 4.0, 8.0, 2e4, 0.8, 1.5, LAG]
    spec = LOOP[0].with_current_laws(LOOP_LAWS, lag="one_rate")
    coarse = mr.Hardware(sample_time=5e-3, step=5e-3)
    found = mr.simulate_loop(FRAME, [device(spec, stiff)], LEVELS, MOTIONS[:1], coarse)
    finer = mr.simulate_loop(FRAME, [device(spec, stiff)], LEVELS, MOTIONS[:1], coarse, step_factor=8)
    assert found.steps.min() > 1
    np.testing.assert_allclose(found.peak_drift, finer.peak_drift, rtol=1e-2)
