"""Each defect added to a clean record is detected with its size; the clean record has no remark."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import codes
from sinusoidal_tests import harmonic

import mrwork as mr
from mrwork.dampers import damper
from mrwork.dampers.simulation import simulate_force
from mrwork.records import DamperTest
from mrwork.records.checks import breakaway_remark, clipped_samples, detect_smoothing, static_force
from mrwork.records.cycles import delay_remark, drift_remark, mass_remark
from mrwork.records.motion import SmoothMotion, smooth_motion, whole_cycles
from mrwork.records.read import examine
from mrwork.records.reading import SYNTHETIC_TESTS, synthetic_test
from mrwork.records.remarks import find_mislabelled, repeats_that_differ
from mrwork.records.window import cut

# Models with displacement hysteresis have a corner at motion reversals; the other has none.
CORNERED = ("bouc_wen", "normalised_bouc_wen")
SMOOTH = "static_hysteretic"


def simulated(
    model: str,
    *,
    frequency: float = 2.0,
    amplitude: float = 0.01,
    cycles: int = 8,
    scale: NDArray[np.float64] | float = 1.0,
    rng: int = 0,
) -> DamperTest:
    """A sinusoidal test of a model at its nominal parameters, with 0.3 % noise."""
    spec = damper(model)
    dt = 1.0 / (500.0 * frequency)
    time = dt * np.arange(round(cycles / frequency / dt))
    loading, noise = harmonic(time, (amplitude, frequency)), np.random.default_rng(rng)
    exact = simulate_force(spec, spec.nominal, loading)
    speed = 2.0 * np.pi * frequency * amplitude
    return mr.test_from_arrays(
        name=model,
        time=time,
        displacement=loading.displacement + 3e-4 * amplitude * noise.standard_normal(time.size),
        velocity=loading.velocity + 3e-3 * speed * noise.standard_normal(time.size),
        force=scale * exact + 3e-3 * np.std(exact) * noise.standard_normal(time.size),
    )


def with_motion(test: DamperTest) -> tuple[DamperTest, SmoothMotion]:
    return test, smooth_motion(test.displacement, test.dt)


def late(test: DamperTest, delay: float) -> DamperTest:
    return replace(test, force=np.interp(test.time - delay, test.time, test.force))


def alarms(test: DamperTest) -> list[str]:
    """Codes of the remarks, without the offset that a model has."""
    return [each.code for each in examine(*with_motion(test)) if each.code != "force_offset"]


@pytest.mark.parametrize("name", SYNTHETIC_TESTS)
def test_records_as_the_sensors_gave_them_raise_no_alarm(name: str) -> None:
    assert alarms(synthetic_test(name)) == []


@pytest.mark.parametrize("model", [*CORNERED, SMOOTH])
@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0])
def test_simulated_records_raise_no_alarm(model: str, frequency: float) -> None:
    assert alarms(simulated(model, frequency=frequency)) == []


@pytest.mark.parametrize("model", CORNERED)
@pytest.mark.parametrize("frequency", [1.0, 4.0])
@pytest.mark.parametrize("share", [0.006, 0.015, 0.03])
def test_a_delay_of_the_force_is_found(model: str, frequency: float, share: float) -> None:
    delay = share / frequency
    test = late(simulated(model, frequency=frequency), delay)
    (remark,) = delay_remark(*with_motion(test))
    found = remark.measured
    assert found is not None
    assert found.standard_error is not None
    # 0.1 % of a period is the step of the search and hence the least standard error; the bound is three times that.
    assert abs(found.value - delay) < 3.0 * found.standard_error
    assert found.standard_error < 4e-3 / frequency
    assert "lags" in remark.message


def test_a_force_that_comes_early_is_told_as_a_lead() -> None:
    (remark,) = delay_remark(*with_motion(late(simulated("normalised_bouc_wen"), -0.015)))
    assert "leads" in remark.message
    assert remark.measured is not None
    assert remark.measured.value == pytest.approx(-0.015, abs=1.5e-3)


@pytest.mark.parametrize("delay", [-0.01, 0.0, 0.005])
def test_a_force_without_corners_tells_no_delay(delay: float) -> None:
    assert not [*delay_remark(*with_motion(late(simulated(SMOOTH, frequency=1.0), delay)))]


def test_a_smoothed_record_tells_no_delay() -> None:
    test = late(simulated("bouc_wen"), 0.01)
    channels = {name: getattr(test, name) for name in ("displacement", "velocity", "force")}
    averaged = {name: np.convolve(each, np.full(25, 0.04), mode="valid") for name, each in channels.items()}
    smoothed = replace(test, **averaged)
    assert not [*delay_remark(*with_motion(replace(smoothed, smoothing=detect_smoothing(smoothed))))]


def test_a_clipped_force_tells_no_delay() -> None:
    test = simulated("bouc_wen")
    top = 0.7 * test.force.max()
    assert not [*delay_remark(*with_motion(replace(test, force=test.force.clip(-top, top))))]


@pytest.mark.parametrize("cycles", [3.25, 3.5, 3.75])
def test_the_offset_of_a_record_that_ends_within_a_cycle_is_that_of_whole_cycles(cycles: float) -> None:
    whole = simulated("bouc_wen", cycles=4)
    part = cut(whole, end=cycles / 2.0)
    offsets = [static_force(test.displacement, test.force, test.velocity) for test in (whole, part)]
    assert offsets[1] == pytest.approx(offsets[0], abs=0.01 * np.ptp(whole.force))


@pytest.mark.parametrize("model", [*CORNERED, SMOOTH])
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_mass_is_bounded_from_below(model: str, share: float) -> None:
    # Springs and hysteresis of a damper act in opposite phase to the mass; the estimate may be low by no more than
    # that.
    frequency, amplitude = 4.0, 0.01
    test = simulated(model, frequency=frequency, amplitude=amplitude)
    acceleration = -((2.0 * np.pi * frequency) ** 2) * test.displacement
    inertia = acceleration / np.abs(acceleration).max()
    mass = share * 0.5 * np.ptp(test.force) / (amplitude * (2.0 * np.pi * frequency) ** 2)
    elastic = -float(test.force @ acceleration / (acceleration @ acceleration))
    loaded = replace(test, force=test.force + share * 0.5 * np.ptp(test.force) * inertia)
    (remark,) = mass_remark(*with_motion(loaded))
    assert remark.measured is not None
    # The 1 % allows for cycles that are not a whole number of samples, and for the first cycle, from rest.
    assert remark.measured.value == pytest.approx(mass - elastic, rel=0.02)
    assert 0.0 < remark.measured.value < mass


def test_a_force_that_sticks_at_rest_is_measured() -> None:
    time = 0.005 * np.arange(1200)
    moving = np.maximum(time - 1.0, 0.0)
    displacement = 0.01 * np.sin(2.0 * np.pi * moving)
    velocity = np.where(moving > 0.0, 0.02 * np.pi * np.cos(2.0 * np.pi * moving), 0.0)
    force = 300.0 * np.tanh(velocity / 0.002) + 400.0 * velocity
    peak = 150.0 * np.exp(-(((moving - 0.005) / 0.004) ** 2)) * (moving > 0.0)
    noise = 2.0 * np.random.default_rng(5).standard_normal(time.size)

    def built(extra: NDArray[np.float64]) -> DamperTest:
        return mr.test_from_arrays(
            name="rest", time=time, displacement=displacement, force=force + extra + noise
        )

    (remark,) = breakaway_remark(*with_motion(built(peak)))
    assert remark.measured is not None
    # Noise of 2 N: 7 N at most among 1200 samples, twice that at the peak, and 1 N in the mean over the travel.
    assert remark.measured.value == pytest.approx(150.0, abs=12.0)
    assert "breakaway" not in codes(built(np.zeros_like(time)))


@pytest.mark.parametrize("limit", [0.6, 0.9, 0.97])
def test_a_channel_that_ran_out_of_range_is_told(limit: float) -> None:
    sine = np.sin(2.0 * np.pi * np.arange(2000) / 400.0) + 1e-4 * np.random.default_rng(2).standard_normal(
        2000
    )
    cut = np.clip(sine, -1.0, limit)
    # Fraction of a cycle above the limit.
    assert clipped_samples(cut).mean() == pytest.approx(np.arccos(limit) / np.pi, abs=0.01)


@pytest.mark.parametrize("limit", [900.0, 980.0])
def test_samples_of_a_clipped_force_are_told_under_noise_and_not_compared(limit: float) -> None:
    # Noise parts the samples at the edges of each peak, and the record begins and ends within one.
    time = 0.002 * np.arange(2000)
    motion = 0.02 * np.sin(np.pi * time)
    velocity = 0.02 * np.pi * np.cos(np.pi * time)
    noise = 6.0 * np.random.default_rng(3).standard_normal(time.size)
    force = 915.0 * np.tanh(velocity / 0.02) + 2000.0 * velocity + 1500.0 * motion + noise
    read = force.clip(-limit, limit)
    test = mr.test_from_arrays(name="clipped", time=time, displacement=motion, force=read)
    assert "clipped" in codes(test)
    compared = test.force[test.counted]
    assert np.abs(compared).max() < limit
    assert compared.size > 0.9 * np.count_nonzero(np.abs(read[test.window]) < limit)


def test_friction_with_noise_is_not_clipping() -> None:
    sine = np.sin(2.0 * np.pi * np.arange(2000) / 400.0)
    force = 300.0 * np.tanh(20.0 * sine) + np.random.default_rng(4).standard_normal(2000)
    assert not clipped_samples(3.0 * np.round(force / 3.0)).any()


@pytest.mark.parametrize("change", [-0.2, -0.05, 0.08])
def test_a_drift_of_the_loop_is_measured(change: float) -> None:
    scale = (1.0 + change) ** (np.arange(12 * 500) / (12 * 500))
    test = simulated("normalised_bouc_wen", cycles=12, scale=scale)
    (remark,) = drift_remark(*with_motion(test))
    assert remark.measured is not None
    n_cycles = len(whole_cycles(test.displacement))
    expected = (1.0 + change) ** ((n_cycles - 1) / 12.0) - 1.0
    # Noise of 0.3 % averages to 1e-4 in a cycle of 500 samples; for a drifting force, the mean over the travel differs
    # slightly from its offset.
    assert remark.measured.value == pytest.approx(expected, abs=0.003)


SLOW = 0.002 * np.arange(6000)


@pytest.mark.parametrize(
    "displacement",
    [
        0.01 * np.sin(2.0 * np.pi * (0.5 * SLOW + 0.1 * SLOW**2)),
        0.01 * np.exp(-0.04 * SLOW) * np.sin(4.0 * np.pi * SLOW),
    ],
    ids=["chirp", "decay"],
)
def test_a_motion_that_changes_is_no_drift(displacement: NDArray[np.float64]) -> None:
    velocity = np.gradient(displacement, SLOW)
    noise = np.random.default_rng(8).standard_normal(SLOW.size)
    force = 300.0 * np.tanh(velocity / 0.01) + 2000.0 * velocity + noise
    test = mr.test_from_arrays(name="rig", time=SLOW, displacement=displacement, force=force)
    assert not [*drift_remark(*with_motion(test))]


@pytest.mark.parametrize(
    ("course", "word"),
    [
        (lambda t: t, "ramps"),
        (lambda t: 1.0 - t, "ramps"),
        (lambda t: np.where(t > 0.4, 1.0, 0.0), "switches"),
        (lambda t: 0.5 + 0.5 * np.sin(20.0 * t), "varies"),
    ],
)
def test_a_command_that_is_not_constant_is_told_by_its_course(
    course: Callable[[NDArray[np.float64]], NDArray[np.float64]], word: str
) -> None:
    test = synthetic_test("rd1005_1a")
    current = course(np.linspace(0.0, 1.0, test.n_time))
    built = mr.test_from_arrays(
        name="rig", time=test.time, displacement=test.displacement, force=test.force, current=current
    )
    (remark,) = [remark for remark in built.remarks if remark.code == "command_varies"]
    assert remark.message.startswith(f"the current {word} between")
    assert remark.measured is not None
    assert remark.measured.value == pytest.approx(1.0, abs=0.03)


@cache
def _set_of_tests() -> tuple[DamperTest, ...]:
    """Three currents, five motions each: the force grows with the current and a little with the velocity."""
    tests = []
    for current, level in ((0.0, 0.3), (0.5, 1.0), (1.0, 1.8)):
        for frequency, amplitude in ((0.5, 0.02), (1.0, 0.01), (2.0, 0.01), (3.0, 0.005), (5.0, 0.002)):
            test = simulated(SMOOTH, frequency=frequency, amplitude=amplitude, cycles=4, scale=level)
            tests.append(replace(test, name=f"{current:g}A{frequency:g}Hz", current=current))
    return tuple(tests)


def test_a_set_with_right_labels_or_of_too_few_tests_raises_no_alarm() -> None:
    assert [*find_mislabelled(_set_of_tests())] == []
    assert [*find_mislabelled(_set_of_tests()[4:6])] == []


def test_friction_that_falls_with_the_speed_is_no_wrong_label() -> None:
    tests = []
    for current in (0.0, 0.5, 1.0):
        for frequency, amplitude in ((0.5, 0.005), (1.0, 0.01), (2.0, 0.008), (4.0, 0.003)):
            time = 0.002 * np.arange(round(4.0 / frequency / 0.002))
            phase = 2.0 * np.pi * frequency * time
            velocity = 2.0 * np.pi * frequency * amplitude * np.cos(phase)
            friction = (100.0 + 400.0 * current) * (1.0 + 0.5 * np.exp(-((velocity / 0.01) ** 2)))
            force = friction * np.tanh(velocity / 0.001) + 1200.0 * velocity
            name = f"{current:g}A{frequency:g}Hz"
            tests.append(
                mr.test_from_arrays(time, amplitude * np.sin(phase), force, name=name, current=current)
            )
    assert [*find_mislabelled(tests)] == []
    (remark,) = find_mislabelled([*tests[:9], replace(tests[9], current=0.5), *tests[10:]])
    assert remark.message.startswith("1A1Hz: ")


def test_a_repeat_of_another_force_is_told_with_its_ratio() -> None:
    first = simulated(SMOOTH, cycles=4, rng=1)
    first, second = (replace(first, name=name, current=1.0) for name in ("first", "second"))
    assert [*repeats_that_differ([first, replace(second, force=1.05 * second.force)])] == []
    (remark,) = repeats_that_differ([first, replace(second, force=1.3 * second.force)])
    assert "second has the motion and command of first" in remark.message
    assert "times 1.30" in remark.message


@pytest.mark.parametrize(("wrong", "label"), [(7, 1.0), (12, 0.5), (3, 0.5)])
def test_a_wrong_label_in_a_set_is_named(wrong: int, label: float) -> None:
    tests = [*_set_of_tests()]
    right = tests[wrong].current
    tests[wrong] = replace(tests[wrong], current=label)
    (remark,) = find_mislabelled(tests)
    assert remark.message.startswith(f"{tests[wrong].name}: ")
    assert f"the other tests at {label:.3g} A" in remark.message
    assert remark.measured is not None
    assert right is not None
    assert np.sign(remark.measured.value) == np.sign(right - label)


def test_a_force_in_another_unit_than_those_of_its_set_is_told_with_the_unit() -> None:
    tests = [*_set_of_tests()]
    mislabelled = [*tests[:7], replace(tests[7], current=1.0), *tests[8:]]
    assert "lbf" not in next(find_mislabelled(mislabelled)).message
    tests[8] = replace(tests[8], force=tests[8].force / 4.448)
    (remark,) = find_mislabelled(tests)
    assert remark.message.startswith(f"{tests[8].name}: ")
    assert "in lbf instead of newtons" in remark.message


@pytest.mark.parametrize(("held", "told"), [(60, True), (10, False)])
def test_a_force_that_a_logger_holds_within_one_way_is_told(held: int, told: bool) -> None:
    time = 0.002 * np.arange(2000)
    noise = 6.0 * np.random.default_rng(7).standard_normal(time.size)
    motion, velocity = 0.008 * np.sin(4.0 * np.pi * time), 0.032 * np.pi * np.cos(4.0 * np.pi * time)
    force = 800.0 * np.tanh(velocity / 0.02) + 1000.0 * velocity + noise
    force[1000 : 1000 + held] = force[1000]
    test = mr.test_from_arrays(name="held", time=time, displacement=motion, force=force)
    assert ("stuck" in codes(test)) is told


@pytest.mark.parametrize("digits", [4, 5])
@pytest.mark.parametrize("rate", [100, 200, 500, 1000])
def test_a_sine_of_significant_digits_is_not_clipped_and_a_clipped_one_is(rate: int, digits: int) -> None:
    """Steps of such numbers are finest near zero, and ten to a thousand times as large at the extreme."""
    time = np.arange(0.0, 6.0, 1.0 / rate)
    for frequency in (0.5, 1.0, 1.3, 2.0):
        for amplitude in (0.025, 1.0, 9.5, 12.3456, 310.0):
            whole = amplitude * np.sin(2.0 * np.pi * frequency * time + 0.3)
            read = np.array([float(f"{value:.{digits}g}") for value in whole])
            assert not clipped_samples(read).any()
            assert clipped_samples(np.clip(read, -0.8 * amplitude, 0.8 * amplitude)).any()
