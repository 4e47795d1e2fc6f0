"""Ground records finer than the integration step act by their integrals; a history ends with its record."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from loop_samples import devices, five_storeys, law_with_gains, plant_with, rd1005
from scipy.linalg import expm

import mrwork as mr
from mrwork.twins.loop_ground import half_steps, stage_values

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

FINE = 1e-4
# 1 t on a spring of 1 Hz with 5 % of critical damping.
FRAME = mr.buildings.shear_building(
    name="frame", masses=[1e3], stiffnesses=[4e3 * np.pi**2], storey_damping=[200.0 * np.pi]
)
STILL = mr.ControlLaw(name="active", gains={"gain": np.zeros((1, 2))})
NONE = mr.Device(
    name="none",
    spec=mr.damper("bingham"),
    theta=mr.damper("bingham").nominal,
    row=FRAME.storeys[0],
    largest_command=1.0,
)


def swing(duration: float, dt: float = FINE) -> Floats:
    """A pulse of 1 m/s2 at 1 Hz."""
    time = dt * np.arange(round(duration / dt) + 1)
    return np.exp(-(((time - 3.0) / 1.5) ** 2)) * np.sin(2.0 * np.pi * time)


def spiky() -> mr.GroundMotion:
    """The swing with pulses of 0.1 ms and 100 m/s2, between the steps of 0.5 ms and their middles."""
    acceleration = swing(8.0)
    acceleration[20_001 : 20_001 + 80 * 50 : 50] += 100.0
    return mr.GroundMotion(name="spiky", dt=FINE, acceleration=acceleration)


def humming(duration: float = 8.0, *, swinging: bool = True, phase: float = 0.25 * np.pi) -> mr.GroundMotion:
    """A hum of 2 kHz and 2 m/s2, beside the swing or alone: four periods of it are a sample of 2 ms."""
    acceleration = swing(duration) if swinging else np.zeros(round(duration / FINE) + 1)
    hum = 2.0 * np.cos(2.0 * np.pi * 2000.0 * FINE * np.arange(acceleration.size) + phase)
    return mr.GroundMotion(name="humming", dt=FINE, acceleration=acceleration + hum)


def noisy(duration: float = 1.0, dt: float = FINE) -> mr.GroundMotion:
    """White noise up to the last frequency of its samples."""
    count = round(duration / dt) + 1
    return mr.GroundMotion(
        name="noisy", dt=dt, acceleration=20.0 * np.random.default_rng(3).standard_normal(count)
    )


def held(motion: mr.GroundMotion) -> Floats:
    """Displacement and velocity of the frame at every sample: the first-order hold, by a matrix exponential.

    In `z' = Z z`, z = (x, v, a, a'), the acceleration of the ground runs straight over the interval.
    """
    Z = np.zeros((4, 4))
    Z[0, 1] = Z[2, 3] = 1.0
    Z[1] = [-FRAME.stiffness[0, 0] / 1e3, -FRAME.damping[0, 0] / 1e3, -1.0, 0.0]
    over = expm(Z * motion.dt)[:2]
    slopes = np.diff(motion.acceleration) / motion.dt
    states = np.zeros((motion.n_time, 2))
    for k, (a, slope) in enumerate(zip(motion.acceleration[:-1], slopes, strict=True)):
        states[k + 1] = over @ [*states[k], a, slope]
    return states


def bare(motion: mr.GroundMotion, step: float, sample_time: float | None = None) -> mr.Responses:
    hardware = mr.Hardware(sample_time=sample_time or step, step=step)
    return mr.simulate_loop(FRAME, [NONE], STILL, [motion], hardware, histories=True)


def test_pulses_between_the_steps_move_the_frame() -> None:
    motion = spiky()
    found = bare(motion, 5e-4, 1e-3)
    exact = held(motion)
    assert 0.1729 < np.abs(exact[:, 0]).max() < 0.1731
    # Third order within a step with a pulse, (w h)^2 = 1e-5 of the response, in which steps are missed at the peak.
    np.testing.assert_allclose(found.peak_drift[0, 0], np.abs(exact[:, 0]).max(), rtol=2e-4)
    state = found.histories[0].state
    np.testing.assert_allclose(state, exact[::10], atol=2e-4 * np.abs(exact).max(axis=0).min())
    # The energies of the loop are those of the line in each step.
    assert found.energy_error[0] < 1e-6


@pytest.mark.parametrize("phase", [0.0, 0.3, 1.9])
def test_a_hum_far_above_the_frame_does_not_move_it(phase: float) -> None:
    """Micrometres, which its first instants leave, where points of it stand still at 2 m/s2: 50 mm at rest."""
    motion = humming(swinging=False, phase=phase)
    exact = np.abs(held(motion)[:, 0]).max()
    assert exact < 1e-4
    for step in (5e-4, 1e-3, 4e-3):
        np.testing.assert_allclose(bare(motion, step).peak_drift[0, 0], exact, atol=2e-6)


def error_at_the_end(motion: mr.GroundMotion, step: float, exact: Floats) -> float:
    state = bare(motion, step).histories[0].state
    return float(np.abs(state - exact[:: round(step / motion.dt)]).max())


def test_the_error_of_a_smooth_record_falls_with_the_fourth_power_of_the_step() -> None:
    motion = mr.GroundMotion(name="swing", dt=FINE, acceleration=swing(6.4))
    exact = held(motion)
    errors = [error_at_the_end(motion, step, exact) for step in (0.064, 0.032, 0.016)]
    assert all(14.0 < coarse / fine < 18.0 for coarse, fine in pairwise(errors))


def test_the_error_of_a_rough_record_falls_with_the_step() -> None:
    """Third order in a step, whatever the record does in it: second order over all, and better where errors cancel."""
    motion = replace(noisy(6.4), acceleration=noisy(6.4).acceleration + swing(6.4))
    exact = held(motion)
    steps = np.array([0.032, 0.016, 0.008, 0.004])
    errors = np.array([error_at_the_end(motion, step, exact) for step in steps])
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order > 2.0


def test_records_about_as_long_as_the_step_are_read_at_points() -> None:
    """Also those of 20 ms as networks write them, and ones equal to the step but for rounding."""
    for dt, step in ((0.0199994, 0.02), (0.0200067, 0.02), (5e-4, 5e-4), (0.3 / 3.0, 0.1), (0.01, 5e-4)):
        acceleration = np.random.default_rng(1).standard_normal(40)
        count = int(30 * dt / step)
        halves = half_steps(acceleration, dt, step, count)
        at_points = np.stack([halves[:-1:2], halves[1::2], halves[2::2]], axis=1)
        np.testing.assert_array_equal(stage_values(acceleration, dt, step, count), at_points)


def test_neighbours_threads_and_instructions_do_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    gain = law.gains["gain"] * np.linspace(0.2, 2.0, 5)[:, None, None]
    law = replace(law, gains={"gain": gain})
    motions = [noisy(0.3), noisy(0.3, 2e-4), noisy(0.3, 0.01), noisy(0.3, 3e-4)]
    together = mr.simulate_loop(five_storeys(), loop, law, motions, threads=2)
    built, machine = mr._rust.instruction_sets()
    others = []
    for name in [each for each in built if each in machine]:
        monkeypatch.setenv("MRWORK_INSTRUCTION_SET", name)
        others.append(mr.simulate_loop(five_storeys(), loop, law, motions, threads=1))
    alone = [
        mr.simulate_loop(five_storeys(), loop, replace(law, gains={"gain": one}), [motions[0]], threads=1)
        for one in gain
    ]
    for name, numbers in together.numbers.items():
        for each in others:
            np.testing.assert_array_equal(each.numbers[name], numbers, err_msg=name)
        for number, each in enumerate(alone):
            np.testing.assert_array_equal(each.numbers[name][0], together.over_axes(name)[number, 0, 0])


def test_derivatives_of_gains_are_those_of_the_loop() -> None:
    frame, loop = five_storeys(), devices(rd1005(), second=False)
    law = law_with_gains("proportional_direct", plant_with(loop))
    direction, reach = law.gain_rows(1, 10)[0], 1e-6
    along = mr.closed_loop.LoopVariation(
        buildings=(frame,), delay=np.zeros(1), seed=np.zeros(1, int), changes=direction[None]
    )
    runs = mr.simulate_loop(frame, loop, law, [noisy(0.5)], mr.Hardware(), variation=along)
    for sign in (1.0, -1.0):
        other = replace(law, gains={name: each * (1.0 + sign * reach) for name, each in law.gains.items()})
        again = mr.simulate_loop(frame, loop, other, [noisy(0.5)])
        # Second order in the reach.
        moved = runs.rms_drift + sign * reach * runs.slopes[0]["rms_drift"]
        np.testing.assert_allclose(moved, again.rms_drift, rtol=1e-10)


def test_sensors_of_the_ground_read_the_mean_over_the_step_before_and_histories_the_record() -> None:
    read: list[float] = []

    def command(sample: mr.closed_loop.LoopSample, memory: Floats) -> Floats:
        read.append(float(sample.ground_acceleration[0]))
        return np.zeros((1, 1))

    motion = noisy(0.1)
    law = mr.closed_loop.UserLaw(name="reads", command=command)
    spec, theta = rd1005()
    frame = five_storeys()
    device = mr.Device(name="damper", spec=spec, theta=theta, row=frame.storeys[0], largest_command=1.0)
    run = mr.simulate_loop(frame, [device], law, [motion], mr.Hardware(), histories=True)
    a = motion.acceleration
    five = np.array([a[k - 5 : k + 1] for k in range(10, motion.n_time - 1, 10)])
    means = five @ np.array([0.1, 0.2, 0.2, 0.2, 0.2, 0.1])
    # Before the record the ground is still.
    np.testing.assert_allclose(read, [0.0, *means], atol=1e-11)
    np.testing.assert_allclose(run.histories[0].ground_acceleration, a[::10], rtol=1e-12, atol=1e-12)


def test_a_hum_leaves_the_forecast_of_a_rollout_alone() -> None:
    loop = devices(rd1005())
    law = law_with_gains("predictive_rollout", plant_with(loop))
    hardware = mr.Hardware(sample_time=4e-3, step=1e-3, ground_preview=0.04)
    plain = mr.GroundMotion(name="swing", dt=FINE, acceleration=swing(4.0))
    with_hum, without = (
        mr.simulate_loop(five_storeys(), loop, law, [each], hardware) for each in (humming(4.0), plain)
    )
    # Where the ground hardly moves, what the hum leaves of its first instants decides between equal commands.
    for name in ("rms_drift", "peak_drift"):
        np.testing.assert_allclose(with_hum.numbers[name], without.numbers[name], rtol=2e-2)


def test_a_history_ends_at_the_end_of_its_motion() -> None:
    """With the state of the last step, the command that is held there, and what a longer motion has at that instant."""
    frame, loop = five_storeys(), devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    motion = mr.synthetic_motion(rng=0, duration=2.0, peak=3.0)
    short = mr.motions.trimmed(motion, end=1.5)
    runs = [mr.simulate_loop(frame, loop, law, [each], histories=True) for each in (short, motion)]
    ended, longer = (run.histories[0] for run in runs)
    assert len(ended.time) == 1501
    assert ended.time[-1] == 1.5
    # There the longer run measures once more; everything else is of the same motion.
    for name in ended.numbers.keys() - {"command", "current"}:
        np.testing.assert_array_equal(ended.numbers[name], longer.numbers[name][:1501], err_msg=name)
    np.testing.assert_array_equal(ended.command[-1], ended.command[-2])
    np.testing.assert_array_equal(ended.drift[-1], runs[0].residual_drift[0])
    np.testing.assert_array_equal(ended.input_energy[-1], runs[0].input_energy[0])
