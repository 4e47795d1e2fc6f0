"""Chatter is counted as it is defined, and a dead zone and a slope of the command do what they say, for any law."""

from dataclasses import replace

import numpy as np
import pytest
from loop_samples import (
    LARGEST,
    at_samples,
    devices,
    five_storeys,
    friction,
    law_with_gains,
    plant_with,
    rd1005,
    sweep,
)

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, LoopSample, Responses, UserLaw, simulate_loop

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
NAMES = [spec.name for spec in mr.control.control_laws()]
COMMANDS = [spec.name for spec in mr.control.control_laws() if not spec.commands_force]


def run_of(
    law: mr.ControlLaw | UserLaw, hardware: Hardware | None = None, *, duration: float = 0.6
) -> Responses:
    found = simulate_loop(five_storeys(), devices(rd1005()), law, [sweep(duration)], hardware, histories=True)
    assert found.outcome[0] == mr.dampers.Outcome.FINISHED
    return found


def law_of(name: str) -> mr.ControlLaw:
    return law_with_gains(name, plant_with(devices(rd1005())))


def signal(values: Floats) -> UserLaw:
    """A law that sends this signal, a value for each sample, to both devices."""

    def command(sample: LoopSample, memory: Floats) -> Floats:
        return np.full_like(sample.rate, values[round(sample.time / 1e-3)])

    return UserLaw(name="signal", command=command)


def switchings(command: Floats, largest: float) -> int:
    """Legs of the zigzag through the turning points that are more than a tenth of the largest command apart."""
    count, direction, extreme, start = 0, 0, command[0], command[0]
    for value in command[1:]:
        if direction == 0:
            start, extreme = min(start, value), max(extreme, value)
            if max(value - start, extreme - value) > 0.1 * largest:
                direction = 1 if value - start > 0.1 * largest else -1
                count, extreme = 1, value
        elif (value - extreme) * direction > 0.0:
            extreme = value
        elif (extreme - value) * direction > 0.1 * largest:
            count, direction, extreme = count + 1, -direction, value
    return count


@pytest.mark.parametrize("name", COMMANDS)
def test_travel_and_switchings_are_those_of_the_commands_that_were_sent(name: str) -> None:
    found = run_of(law_of(name))
    sent = at_samples(found).command
    seconds = len(sent) * 1e-3
    travel = np.abs(np.diff(sent, axis=0)).sum(axis=0) / seconds
    np.testing.assert_allclose(found.command_travel[0], travel, rtol=1e-12, atol=1e-12)
    counts = [switchings(column, LARGEST) for column in sent.T]
    np.testing.assert_allclose(found.switching_rate[0] * seconds, counts, rtol=1e-12)


def test_a_command_of_two_values_switches_as_often_as_it_changes() -> None:
    on = np.random.default_rng(3).random(600) < 0.3
    found = run_of(signal(np.where(on, LARGEST, 0.0)))
    changes = np.count_nonzero(np.diff(on))
    np.testing.assert_allclose(found.switching_rate[0], changes / 0.6, rtol=1e-12)
    np.testing.assert_allclose(found.command_travel[0], changes * LARGEST / 0.6, rtol=1e-12)


def test_a_ripple_below_a_tenth_of_the_largest_command_travels_and_does_not_switch() -> None:
    ripple = 1.0 + 0.04 * LARGEST * (-1.0) ** np.arange(600)
    found = run_of(signal(ripple))
    np.testing.assert_array_equal(found.switching_rate[0], 0.0)
    np.testing.assert_allclose(found.command_travel[0], 599 * 0.08 * LARGEST / 0.6, rtol=1e-9)
    # A slow swing with that ripple counts as often as the swing turns.
    swing = 0.9 + 0.8 * np.sin(2.0 * np.pi * 5.0 * 1e-3 * np.arange(600)) + ripple - 1.0
    np.testing.assert_allclose(run_of(signal(swing)).switching_rate[0] * 0.6, 7.0, rtol=1e-9)


def test_candidates_of_smaller_largest_commands_travel_in_their_share() -> None:
    law = law_of("clipped_optimal")
    loop = [replace(each, largest_command=LARGEST / 2.0) for each in devices(rd1005())]
    half = simulate_loop(five_storeys(), loop, law, [sweep(0.6)])
    many = simulate_loop(
        five_storeys(), devices(rd1005()), law, [sweep(0.6)], largest_commands=[LARGEST / 2.0, LARGEST]
    )
    # Rounding differs, and an on-off law may switch a sample earlier or later.
    np.testing.assert_allclose(many.command_travel[0], half.command_travel[0], rtol=0.02)
    np.testing.assert_allclose(many.switching_rate[0], half.switching_rate[0], rtol=0.02)


@pytest.mark.parametrize("name", NAMES)
def test_no_dead_zone_and_no_slope_leave_the_bits(name: str) -> None:
    law = law_of(name)
    plain = run_of(law, duration=0.2)
    # A slope that no change reaches: the shaping is on, and changes nothing.
    shaped = run_of(replace(law, command_slope=1e300), duration=0.2)
    for quantity, numbers in plain.numbers.items():
        np.testing.assert_array_equal(shaped.numbers[quantity], numbers, err_msg=quantity)


@pytest.mark.parametrize("feedback", ["state", "observer"])
@pytest.mark.parametrize("name", COMMANDS)
def test_a_dead_zone_sends_nothing_below_its_velocity(name: str, feedback: str) -> None:
    zone = 5e-3
    found = run_of(replace(law_of(name), dead_zone=zone), Hardware(feedback=feedback))
    history = at_samples(found)
    if feedback == "state":
        slow = np.abs(history.rate) < zone
        np.testing.assert_array_equal(history.command[slow], 0.0)
    # It begins at rest.
    np.testing.assert_array_equal(history.command[0], 0.0)
    assert np.ptp(history.command) > 0.0


@pytest.mark.parametrize("name", ["clipped_optimal", "acceleration_driven", "passive"])
def test_a_slope_limits_the_change_of_the_command_from_sample_to_sample(name: str) -> None:
    law, slope = law_of(name), 200.0
    found = run_of(replace(law, command_slope=slope))
    same = run_of(law, Hardware(command_rate=slope))
    for quantity, numbers in same.numbers.items():
        np.testing.assert_array_equal(found.numbers[quantity], numbers, err_msg=quantity)
    # The smaller of the limits of the law and of the driver holds.
    both = run_of(replace(law, command_slope=100.0), Hardware(command_rate=slope))
    assert np.abs(np.diff(both.histories[0].command, axis=0)).max() <= 0.1 * (1.0 + 1e-12)


def test_a_stuck_command_is_not_shaped() -> None:
    stuck = Fault(channel="command", index=0, start=0.2, end=0.4, value=1.2)
    law = replace(law_of("clipped_optimal"), dead_zone=0.02, command_slope=50.0)
    found = run_of(law, Hardware(faults=(stuck,)))
    np.testing.assert_array_equal(found.histories[0].command[200:400, 0], 1.2)


def test_a_shaped_law_has_the_same_bits_alone_and_in_a_batch(instruction_set: str) -> None:
    law = replace(law_of("mixed_skyhook"), dead_zone=5e-3, command_slope=100.0)
    alone = run_of(law)
    crossovers = np.outer(np.linspace(0.5, 2.0, 11), np.asarray(law.gains["crossover"]))
    crossovers[7] = np.asarray(law.gains["crossover"])
    batch = replace(law, gains={"crossover": crossovers})
    many = simulate_loop(five_storeys(), devices(rd1005()), batch, [sweep(0.6)], threads=2)
    for quantity, numbers in alone.numbers.items():
        np.testing.assert_array_equal(many.numbers[quantity][7], numbers[0], err_msg=quantity)


def test_a_law_of_accelerations_reads_them_with_noise_and_faults() -> None:
    law = law_of("acceleration_driven")
    plain = run_of(law)
    noisy = run_of(law, Hardware(acceleration_noise=0.1))
    assert noisy.switching_rate.max() > plain.switching_rate.max()
    dead = Fault(channel="acceleration", index=0, start=0.1, value=np.nan)
    found = simulate_loop(
        five_storeys(), devices(rd1005()), law, [sweep(0.6)], Hardware(faults=(dead,)), histories=True
    )
    assert found.outcome[0] == mr.dampers.Outcome.FAILED_SAFE
    np.testing.assert_array_equal(found.histories[0].command[100:], 0.0)


def test_a_mixed_law_is_skyhook_of_fast_motion_and_acceleration_driven_of_slow() -> None:
    # Force and velocity of this damper have one sign, so that skyhook is decentralised bang-bang control.
    loop = devices(friction())

    def of(law: mr.ControlLaw) -> Responses:
        return simulate_loop(five_storeys(), loop, law, [sweep(0.6)])

    def mixed(crossover: float) -> Responses:
        return of(mr.ControlLaw(name="mixed_skyhook", gains={"crossover": [crossover] * 2}))

    driven, skyhook = of(law_of("acceleration_driven")), of(law_of("decentralised_bang_bang"))
    np.testing.assert_array_equal(mixed(1e-9).rms_drift, driven.rms_drift)
    np.testing.assert_array_equal(mixed(1e9).rms_drift, skyhook.rms_drift)
    between = mixed(30.0).rms_drift
    assert np.any(between != driven.rms_drift)
    assert np.any(between != skyhook.rms_drift)


def test_laws_of_accelerations_isolate_above_resonance_better_than_any_of_their_dampings_alone() -> None:
    """One storey at 3 Hz, damping ratio 0.05 to 0.8: rms absolute acceleration under a harmonic ground."""
    mass, frequency = 300.0, 2.0 * np.pi * 3.0
    storey = mr.buildings.shear_building(name="storey", masses=[mass], stiffnesses=[mass * frequency**2])
    dashpot = mr.damper("bingham").with_current_laws({"c0": "linear"}, lag="none")
    c = 2.0 * mass * frequency
    theta = [1e-6, 1e-2, 0.05 * c, 0.75 * c, 0.0]
    device = mr.Device(name="dashpot", spec=dashpot, theta=theta, row=storey.storeys[0], largest_command=1.0)

    def acceleration(law: mr.ControlLaw, hertz: float) -> float:
        time = 1e-3 * np.arange(round(40.0 / hertz / 1e-3))
        # A cosine has a velocity without a mean.
        motion = mr.GroundMotion(name="cosine", dt=1e-3, acceleration=np.cos(2.0 * np.pi * hertz * time))
        return float(simulate_loop(storey, [device], law, [motion]).rms_acceleration[0, 0])

    driven = mr.ControlLaw(name="acceleration_driven")
    mixed = mr.ControlLaw(name="mixed_skyhook", gains={"crossover": [np.sqrt(2.0) * frequency]})
    constant = [mr.ControlLaw(name="passive", gains={"command": [share]}) for share in (0.0, 0.5, 1.0)]
    above = [min(acceleration(law, hertz) for law in constant) for hertz in (4.0, 4.5)]
    for law in (driven, mixed):
        assert all(acceleration(law, hertz) < least for hertz, least in zip((4.0, 4.5), above, strict=True))
    # Below the crossover the mixed law is skyhook, which damps resonance; acceleration-driven damping alone does less.
    at_resonance = acceleration(constant[-1], 3.0)
    assert acceleration(mixed, 3.0) < 1.1 * at_resonance < acceleration(driven, 3.0)
