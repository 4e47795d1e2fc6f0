"""However a run ends, the end has a name, spares its neighbours and can be had at once by Ctrl-C."""

import os
import signal
import threading
from dataclasses import replace

import numpy as np
import pytest
from loop_samples import devices, five_storeys, friction, law_with_gains, plant_with, rd1005, still, sweep
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, simulate_loop
from mrwork.dampers.simulation import Outcome

PASSIVE = mr.ControlLaw(name="passive", gains={"command": [1.0, 1.0]})
ONE = mr.ControlLaw(name="passive", gains={"command": [0.0]})


def test_a_record_shorter_than_a_sample_is_one_sample_and_its_end() -> None:
    response = simulate_loop(five_storeys(), devices(friction()), PASSIVE, [still(1e-5)], histories=True)
    assert response.outcome[0] == Outcome.FINISHED
    assert len(response.histories[0].time) == 2


def test_an_unstable_gain_diverges_and_spares_its_neighbours() -> None:
    loop = devices(rd1005())
    law = law_with_gains("active", plant_with(loop))
    gain = np.asarray(law.gains["gain"])
    clean = simulate_loop(five_storeys(), loop, law, [sweep(0.5)])
    mixed = simulate_loop(
        five_storeys(), loop, replace(law, gains={"gain": np.stack([gain, -3e3 * gain, gain])}), [sweep(0.5)]
    )
    np.testing.assert_array_equal(mixed.outcome, [Outcome.FINISHED, Outcome.DIVERGED, Outcome.FINISHED])
    assert np.isposinf(mixed.peak_drift[1]).all()
    assert np.isposinf(mixed.energy_error[1])
    for row in (0, 2):
        np.testing.assert_array_equal(mixed.peak_drift[row], clean.peak_drift[0])


def test_an_absurdly_stiff_damper_is_unresolved_and_not_simulated() -> None:
    building = five_storeys()
    spec = mr.damper("static_hysteretic")
    theta = np.tile(spec.nominal, (3, 1))
    theta[1, spec.names.index("c")] = 1e9
    device = mr.Device(name="stiff", spec=spec, theta=theta, row=building.storeys[0], largest_command=1.0)
    response = simulate_loop(building, [device], ONE, [sweep(0.2)], histories=True)
    np.testing.assert_array_equal(response.outcome, [Outcome.FINISHED, Outcome.UNRESOLVED, Outcome.FINISHED])
    np.testing.assert_array_equal(response.steps > 0, [True, False, True])
    assert np.isposinf(response.peak_drift[1]).all()
    # A history of a run that was not made is none, not one of rest.
    assert np.isposinf(response.histories[1].displacement).all()
    assert np.isfinite(response.histories[2].displacement).all()


def test_parameters_that_are_no_numbers_have_a_named_end() -> None:
    spec, theta = rd1005()
    for column in range(len(theta)):
        for bad in (np.nan, np.inf, -np.inf, 1e300):
            draws = np.tile(theta, (3, 1))
            draws[1, column] = bad
            loop = devices((spec, np.tile(theta, (3, 1))))
            for device in loop:
                # A device refuses them; a search may come to them.
                object.__setattr__(device, "theta", draws)
            response = simulate_loop(five_storeys(), loop, PASSIVE, [sweep(0.1)])
            assert response.outcome[[0, 2]].tolist() == [Outcome.FINISHED] * 2
            finished = response.outcome[1] == Outcome.FINISHED
            assert not (finished and np.isnan(bad))
            assert np.isfinite(response.peak_drift[1]).all() == finished
            assert not np.isnan(response.rms_acceleration).any()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_coil_that_is_sent_no_number_diverges(value: float) -> None:
    loop = devices(rd1005())
    fault = Fault(channel="command", index=0, start=0.1, end=0.2, value=value)
    response = simulate_loop(five_storeys(), loop, PASSIVE, [sweep(0.3)], Hardware(faults=(fault,)))
    assert response.outcome[0] == Outcome.DIVERGED
    assert np.isposinf(response.peak_drift).all()


def test_progress_counts_runs_up_to_all_of_them() -> None:
    said: list[tuple[int, int]] = []
    law = mr.ControlLaw(name="passive", gains={"command": np.ones((5000, 2))})
    simulate_loop(
        five_storeys(),
        devices(friction()),
        law,
        [still(2e-3)],
        on_progress=lambda done, wanted: said.append((done, wanted)),
    )
    assert said[-1] == (5000, 5000)
    assert len(said) > 1


def test_runs_that_last_equally_long_share_a_call_and_every_run_keeps_its_place() -> None:
    """More runs than are in the first call, under motions of which the first and the last are equally long."""
    law = mr.ControlLaw(name="passive", gains={"command": np.linspace(0.0, 1.0, 30)[:, None] * np.ones(2)})
    motions, loop = [sweep(0.3), sweep(0.1), still(0.3)], devices(rd1005())
    together = simulate_loop(
        five_storeys(), loop, law, motions, histories=True, on_progress=lambda done, wanted: None
    )
    for number, motion in enumerate(motions):
        alone = simulate_loop(five_storeys(), loop, law, [motion], histories=True)
        np.testing.assert_array_equal(together.peak_drift[number::3], alone.peak_drift)
        np.testing.assert_array_equal(together.steps[number::3], alone.steps)
        for one, other in zip((together.histories or ())[number::3], alone.histories or (), strict=True):
            np.testing.assert_array_equal(one.drift, other.drift)


def test_ctrl_c_ends_a_long_batch() -> None:
    # Work for many minutes: were the signal not looked for, the test would not come back.
    law = mr.ControlLaw(name="passive", gains={"command": np.ones((4000, 2))})
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            simulate_loop(five_storeys(), devices(rd1005()), law, [sweep(30.0)], step_factor=64)
    finally:
        timer.cancel()


def test_a_command_for_dampers_that_follow_none_is_refused() -> None:
    building = mr.building("uts")
    spec = mr.damper("bingham")
    device = mr.Device(
        name="passive", spec=spec, theta=spec.nominal, row=building.storeys[0], largest_command=1.0
    )
    motion = mr.GroundMotion(name="step", dt=0.01, acceleration=np.ones(20))
    command = mr.ControlLaw(name="passive", gains={"command": [1.0]})
    refusal(mr.simulate_loop, building, [device], command, [motion], match="it would have no effect")
    none = mr.ControlLaw(name="passive", gains={"command": [0.0]})
    assert mr.simulate_loop(building, [device], none, [motion]).peak_force[0, 0] > 0.0


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ([1.0, -0.1], "`command` of passive is -0.1 for two, whose driver gives 0 to 1.88"),
        ([[0.0, 0.0], [2.0, 1.0]], "`command` of passive is 2 for pair, whose driver gives 0 to 1.88"),
        ([np.inf, 1.0], "`command` of passive is inf for pair"),
    ],
)
def test_a_constant_command_that_the_driver_does_not_give_is_told(command: object, sentence: str) -> None:
    law = mr.ControlLaw(name="passive", gains={"command": command})
    with pytest.warns(mr.errors.MrworkWarning, match=sentence):
        simulate_loop(five_storeys(), devices(rd1005()), law, [still(0.1)])


def test_the_largest_command_may_be_rounded() -> None:
    largest = devices(rd1005())[0].largest_command
    law = mr.ControlLaw(name="passive", gains={"command": [np.nextafter(largest, 2.0 * largest)] * 2})
    found = simulate_loop(five_storeys(), devices(rd1005()), law, [still(0.1)])
    assert (found.peak_current == largest).all()


def test_what_is_no_loop_is_refused() -> None:
    building, loop = five_storeys(), devices(rd1005())
    drawn = [
        replace(each, theta=np.tile(each.draws, (number, 1)))
        for each, number in zip(loop, (2, 3), strict=True)
    ]
    for given, word in (
        ([], "at least one device"),
        (drawn, "2, 3 draws"),
        ([replace(each, row=np.zeros(5)) for each in loop], "not all zero"),
    ):
        refusal(simulate_loop, building, given, PASSIVE, [still()], match=word)
    refusal(simulate_loop, building, loop, PASSIVE, [], match="no ground motion")
    two = mr.ControlLaw(name="passive", gains={"command": [[0.0, 0.0], [1.0, 1.0]]})
    slopes = np.ones((3, 2))
    refusal(simulate_loop, building, loop, two, [still()], shaping=slopes, match="2 of gains, 3 of `shaping`")
