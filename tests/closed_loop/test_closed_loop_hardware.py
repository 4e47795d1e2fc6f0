"""What stands between building and coil does what it says: delay, rate, sensors, faults, observer."""

from contextlib import nullcontext
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
import scipy.linalg
from loop_samples import (
    LAG,
    LARGEST,
    devices,
    five_storeys,
    law_with_gains,
    plant_with,
    pushed,
    rd1005,
    run_of,
    still,
    sweep,
)
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import Fault, Hardware, History, LoopSample, UserLaw, simulate_loop
from mrwork.closed_loop.hardware import refuse_unread
from mrwork.closed_loop.observer import loop_observer
from mrwork.control.linear.plant import accelerations, deformations, plant_of, stack_outputs
from mrwork.dampers.parameters import Lag
from mrwork.motions import GroundMotion
from tests.control.law_formulas import Recorded, commands

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

N_NOISE = 20_000


# Rate of a falling current where it has its own [1/s].
FALL = 0.3 * LAG


def onlookers(n: int = 2, *, lag: Lag = "one_rate") -> list[mr.Device]:
    """Dashpots that do not care for their command, so that nothing of it comes back to the building."""
    spec = mr.damper("bingham").with_current_laws({"c0": "linear"}, lag=lag)
    theta = [1e-3, 1e2, 2000.0, 0.0, 0.0, LAG, FALL][: 5 + spec.n_rates]
    rows = five_storeys().storeys
    return [
        mr.Device(name=f"onlooker {i}", spec=spec, theta=theta, row=rows[i], largest_command=LARGEST)
        for i in range(n)
    ]


def gauge(scale: float, n: int = 2, *, rate: float = 1e9) -> mr.ControlLaw:
    """A law whose command tells what it measured: half of the largest, and as much again at `scale` metres."""
    gains = {"deformation_scale": np.full(n, scale), "rate_scale": np.full(n, rate)}
    return mr.ControlLaw(name="fuzzy", gains=gains, tables={"shares": [0.0, 0.0, 1.0, 1.0]})


def read(command: Floats, scale: float) -> Floats:
    """The deformation of which a gauge's command tells."""
    return (2.0 * command / LARGEST - 1.0) * scale


def test_a_command_arrives_after_the_delay_and_not_before() -> None:
    loop, law = onlookers(lag="none"), gauge(0.02)
    prompt = run_of(loop, law, Hardware())
    np.testing.assert_array_equal(prompt.current, prompt.command)
    for delay, samples in ((1e-3, 1), (1.5e-3, 2), (3e-3, 3), (7e-3, 7)):
        late = run_of(loop, law, Hardware(delay=delay))
        np.testing.assert_array_equal(late.command, prompt.command)
        np.testing.assert_array_equal(late.current[samples:], prompt.command[:-samples])
        np.testing.assert_array_equal(late.current[:samples], np.tile(prompt.command[0], (samples, 1)))


@pytest.mark.parametrize("delay", [0.0, 5e-4, 1.5e-3, 2e-3])
@pytest.mark.parametrize("factor", [1, 4])
@pytest.mark.parametrize(("lag", "fall"), [("one_rate", LAG), ("two_rates", FALL)])
def test_the_coil_follows_the_command_by_its_lag_from_the_instant_it_arrives(
    delay: float, factor: int, lag: Lag, fall: float
) -> None:
    response = simulate_loop(
        five_storeys(),
        onlookers(lag=lag),
        gauge(0.02),
        [sweep(1.0)],
        Hardware(delay=delay),
        histories=True,
        step_factor=factor,
    )
    run = response.histories[0]
    current = run.command[0].copy()
    whole, rest = divmod(round(delay / 5e-4), 2)
    for k in range(len(run.time) - 1):
        np.testing.assert_allclose(run.current[k], current, rtol=1e-12)
        # In the first part of the sample the command before is still in force.
        for late, duration in ((whole + 1, rest * 5e-4), (whole, (2 - rest) * 5e-4)):
            held = run.command[max(k - late, 0)]
            rate = np.where(current < held, LAG, fall)
            current = held + (current - held) * np.exp(-rate * duration)


def test_the_command_changes_no_faster_than_its_rate() -> None:
    loop = devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    rate = 200.0
    run = run_of(loop, law, Hardware(command_rate=rate))
    raw = commands(Recorded.of(law, five_storeys(), loop, sweep(1.0), run, 1e-3))
    expected = [raw[0]]
    for wanted in raw[1:]:
        expected.append(np.clip(wanted, expected[-1] - rate * 1e-3, expected[-1] + rate * 1e-3))
    np.testing.assert_allclose(run.command, expected, atol=1e-12)
    assert np.any(np.abs(np.array(expected) - raw) > 0.1)


def noisy(hardware: Hardware, law: mr.ControlLaw | None = None, scale: float = 0.01) -> Floats:
    """Deformations that a building at rest seems to have, shape (n_time, n_devices)."""
    law = law or gauge(scale)
    return read(run_of(onlookers(), law, hardware, still(N_NOISE * 1e-3 + 5e-4)).command, scale)


def assert_of_unit_deviation(seen: Floats) -> float:
    """Within four standard errors, nothing is random but for the seed; the root of the number of samples."""
    root = float(np.sqrt(len(seen)))
    assert np.all(np.abs(seen.mean(axis=0)) < 4.0 / root)
    assert np.all(np.abs(seen.var(axis=0) - 1.0) < 4.0 * np.sqrt(2.0) / root)
    return root


def test_noise_is_normal_and_white_and_of_the_stated_deviation() -> None:
    seen = noisy(Hardware(deformation_noise=1e-3)) / 1e-3
    assert len(seen) == N_NOISE
    root = assert_of_unit_deviation(seen)
    assert np.all(np.abs(np.mean(seen**4, axis=0) - 3.0) < 4.0 * np.sqrt(96.0) / root)
    for lag in (1, 2, 7):
        assert np.all(np.abs(np.mean(seen[lag:] * seen[:-lag], axis=0)) < 4.0 / root)
    assert abs(np.mean(seen[:, 0] * seen[:, 1])) < 4.0 / root


def test_seeds_and_motions_have_noise_of_their_own_and_candidates_the_same() -> None:
    def of(seed: int) -> Hardware:
        return Hardware(deformation_noise=1e-3, seed=seed)

    first, second = noisy(of(1)), noisy(of(2))
    np.testing.assert_array_equal(first, noisy(of(1)))
    assert abs(np.mean(first * second)) < 4e-6 / np.sqrt(first.size)
    law = gauge(0.01)
    three = replace(law, gains={name: np.tile(gain, (3, 1)) for name, gain in law.gains.items()})
    batch = simulate_loop(five_storeys(), onlookers(), three, [still(0.5), still(0.5)], of(1), histories=True)
    seen = [read(run.command[:-1], 0.01) for run in batch.histories]
    for candidate in (0, 1, 2):
        np.testing.assert_array_equal(seen[2 * candidate], first[:500])
        np.testing.assert_array_equal(seen[2 * candidate + 1], seen[1])
    # A motion has its noise also where it is simulated alone.
    alone = simulate_loop(
        five_storeys(), onlookers(), law, [still(0.5)], of(1), motion_numbers=[1], histories=True
    )
    np.testing.assert_array_equal(read(alone.histories[0].command[:-1], 0.01), seen[1])
    assert abs(np.mean(seen[0] * seen[1])) < 4e-6 / np.sqrt(seen[0].size)


def test_noise_of_the_force_has_the_stated_deviation() -> None:
    # A building that is pushed aside and has come to rest: the dashpots give no force, and a force is wanted. The
    # command then falls in proportion to what is measured of it, wherever that is positive.
    loop = onlookers(1)
    loop[0] = replace(loop[0], count=20.0)
    settled = 8000
    K = np.zeros((1, 10))
    K[0, :5] = -5000.0 / np.linalg.solve(five_storeys().stiffness, five_storeys().mass.sum(axis=1)) / 5.0
    law = mr.ControlLaw(name="proportional_clipped_optimal", gains={"gain": -K, "full_force": [100_000.0]})
    hardware = Hardware(force_noise=300.0)
    run = run_of(loop, law, hardware, pushed(1.0, settled * 1e-3 + N_NOISE * 1e-3))
    command, force, wanted = run.command[settled:, 0], run.force[settled:, 0], (run.state @ K.T)[settled:, 0]
    assert np.abs(force).max() < 1.0
    np.testing.assert_allclose(wanted, 5000.0, rtol=1e-3)
    on = command > 0.0
    seen = (wanted - command / LARGEST * 10_000.0 - force)[on]
    assert abs(on.mean() - 0.5) < 4.0 * 0.5 / np.sqrt(N_NOISE)
    # The square of half a normal has the variance of the whole, and a fourth moment of three.
    assert abs(np.mean(seen**2) / 300.0**2 - 1.0) < 4.0 * np.sqrt(2.0 / on.sum())


@pytest.mark.parametrize("storeys", [(), (2, 0)])
def test_noise_of_accelerations_and_drifts_goes_through_the_observer(storeys: tuple[int, ...]) -> None:
    loop, scale = onlookers(1), 0.05
    hardware = Hardware(
        acceleration_noise=0.2,
        measured_storeys=storeys,
        drift_noise=2e-3 if storeys else 0.0,
        feedback="observer",
    )
    law = mr.ControlLaw(
        name="fuzzy",
        gains={"deformation_scale": [1e9], "rate_scale": [scale]},
        tables={"shares": [0.0, 1.0, 0.0, 1.0]},
    )
    seen = read(run_of(loop, law, hardware, still(N_NOISE * 1e-3)).command[:, 0], scale)
    observer = loop_observer(five_storeys(), loop, hardware)
    noise = np.diag([0.2**2] * 5 + [0.0] + [2e-3**2] * len(storeys))
    covariance = scipy.linalg.solve_discrete_lyapunov(
        observer.Ad - observer.gain @ observer.C, observer.gain @ noise @ observer.gain.T
    )
    row = np.concatenate([np.zeros(5), five_storeys().storeys[0]])
    # The estimate is not white: a few hundred independent numbers.
    np.testing.assert_allclose(np.std(seen), np.sqrt(row @ covariance @ row), rtol=0.1)


def test_sensors_of_a_known_ground_err_alike_in_the_first_mode() -> None:
    loop, building = onlookers(1), five_storeys()
    plant = plant_of(building, [building.storeys[0]], ["0"])
    seen = stack_outputs(accelerations(plant), deformations(plant))
    stiffness, mass = building.stiffness, building.mass
    squared = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)[0]
    for ratio in (10.0, 50.0):
        intensity = np.append(np.full(5, 1.0 / ratio), 1.0 / ratio / squared**2)
        expected = mr.control.observer_of(plant, seen, 1e-3, noise_intensity=intensity)
        found = loop_observer(
            building, loop, Hardware(feedback="observer", known_ground=True, noise_ratio=ratio)
        )
        np.testing.assert_allclose(found.gain, expected.gain, rtol=1e-6)


def test_a_sensor_of_steps_reads_the_nearest_of_them() -> None:
    resolution = 1e-4
    run = run_of(onlookers(), gauge(0.02), Hardware(deformation_resolution=resolution))
    seen = read(run.command, 0.02)
    np.testing.assert_allclose(seen, np.round(run.deformation / resolution) * resolution, atol=1e-12)
    assert len(np.unique(seen.round(9))) > 10
    loop = devices(rd1005())
    law = law_with_gains("proportional_clipped_optimal", plant_with(loop))
    run = run_of(loop, law, Hardware(force_resolution=50.0))
    exact = Recorded.of(law, five_storeys(), loop, sweep(1.0), run, 1e-3)
    stepped = replace(exact, force=50.0 * np.round(run.force / 50.0))
    np.testing.assert_allclose(run.command, commands(stepped), atol=1e-9)
    assert np.abs(commands(exact) - run.command).max() > 1e-3


def readings(
    signal: str, hardware: Hardware, motion: GroundMotion | None = None, building: mr.Building | None = None
) -> tuple[Floats, History]:
    """What a law in Python has read of a signal, shape (n_samples, ...), and the run."""
    seen: list[Floats] = []

    def command(sample: LoopSample, memory: Floats) -> Floats:
        seen.append(getattr(sample, signal)[0])
        return np.zeros_like(sample.rate)

    run = run_of(onlookers(), UserLaw(name="reader", command=command), hardware, motion, building)
    return np.array(seen), run


def ground_readings(hardware: Hardware, motion: GroundMotion) -> Floats:
    return readings("ground_acceleration", hardware, motion)[0]


@pytest.mark.parametrize("feedback", ["state", "observer"])
def test_a_law_reads_the_acceleration_of_the_ground_at_its_sample(
    feedback: Literal["state", "observer"],
) -> None:
    motion = sweep(1.0)
    seen = ground_readings(Hardware(feedback=feedback), motion)
    times = 1e-3 * np.arange(len(seen))
    given = np.interp(times, motion.dt * np.arange(len(motion.acceleration)), motion.acceleration)
    np.testing.assert_allclose(seen, given, atol=1e-12 * np.abs(given).max())
    assert np.ptp(seen) > 0.1


@pytest.mark.parametrize("feedback", ["state", "observer"])
def test_a_law_in_python_reads_the_absolute_accelerations_of_all_floors(
    feedback: Literal["state", "observer"],
) -> None:
    floors = (0,) if feedback == "observer" else None
    seen, run = readings("acceleration", Hardware(feedback=feedback, measured_floors=floors))
    np.testing.assert_array_equal(seen, run.acceleration)
    stuck = Fault(channel="acceleration", index=4, start=0.2, end=0.4, value=1.0)
    broken, _ = readings("acceleration", Hardware(feedback=feedback, measured_floors=floors, faults=(stuck,)))
    np.testing.assert_array_equal(broken[BROKEN, 4], 1.0)
    np.testing.assert_array_equal(broken[:, :4], seen[:, :4])


def test_a_law_in_python_reads_the_drifts_of_the_measured_storeys() -> None:
    seen, run = readings("drift", Hardware(measured_storeys=(3, 0)))
    np.testing.assert_array_equal(seen, run.drift[:, [3, 0]])
    none, _ = readings("drift", Hardware())
    assert none.shape == (len(seen), 0)
    stuck = Fault(channel="drift", index=0, start=0.2, end=0.4, value=1e-3)
    stepped, _ = readings("drift", Hardware(measured_storeys=(3, 0), drift_resolution=1e-4, faults=(stuck,)))
    expected = 1e-4 * np.round(seen / 1e-4)
    expected[BROKEN, 1] = 1e-3
    np.testing.assert_allclose(stepped, expected, atol=1e-12)


def test_noise_of_the_drifts_is_of_the_stated_deviation_and_its_own() -> None:
    seen, _ = readings("drift", Hardware(measured_storeys=(0, 1), drift_noise=1e-3), still(N_NOISE * 1e-3))
    seen = seen / 1e-3
    root = assert_of_unit_deviation(seen)
    assert abs(np.mean(seen[:, 0] * seen[:, 1])) < 4.0 / root
    other = noisy(Hardware(deformation_noise=1e-3))[: len(seen), 0] / 1e-3
    assert abs(np.mean(seen[: len(other), 0] * other)) < 4.0 / root


def test_the_sensor_of_the_ground_has_noise_resolution_and_faults() -> None:
    quiet = still(N_NOISE * 1e-3)
    seen = ground_readings(Hardware(ground_acceleration_noise=0.02), quiet) / 0.02
    root = assert_of_unit_deviation(seen)
    # It is noise of its own: not that of the deformations.
    other = noisy(Hardware(deformation_noise=1e-3))[: len(seen), 0] / 1e-3
    assert abs(np.mean(seen[: len(other)] * other)) < 4.0 / root
    motion = sweep(1.0)
    exact = ground_readings(Hardware(), motion)
    stepped = ground_readings(Hardware(ground_acceleration_resolution=0.05), motion)
    np.testing.assert_allclose(stepped, 0.05 * np.round(exact / 0.05), atol=1e-12)
    held = Fault(channel="ground_acceleration", start=0.2, end=0.4)
    expected = exact.copy()
    expected[BROKEN] = exact[199]
    np.testing.assert_array_equal(ground_readings(Hardware(faults=(held,)), motion), expected)


BROKEN = slice(200, 400)


@pytest.mark.parametrize("value", ["hold", 0.0, 3e-3])
def test_a_broken_sensor_of_deformation_reads_what_its_fault_says(value: float | Literal["hold"]) -> None:
    fault = Fault(channel="deformation", index=1, start=0.2, end=0.4, value=value)
    run = run_of(onlookers(), gauge(0.02), Hardware(faults=(fault,)))
    expected = run.deformation.copy()
    expected[BROKEN, 1] = expected[199, 1] if value == "hold" else value
    np.testing.assert_allclose(read(run.command, 0.02), expected, atol=1e-12)


def test_a_broken_sensor_of_force_reads_what_its_fault_says() -> None:
    loop = devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    for value in ("hold", 0.0, -500.0):
        fault = Fault(channel="force", index=0, start=0.2, end=0.4, value=value)
        run = run_of(loop, law, Hardware(faults=(fault,)))
        seen = Recorded.of(law, five_storeys(), loop, sweep(1.0), run, 1e-3)
        read_force = run.force.copy()
        read_force[BROKEN, 0] = run.force[199, 0] if value == "hold" else value
        np.testing.assert_array_equal(run.command, commands(replace(seen, force=read_force)))


def test_a_stuck_current_stays_where_it_is_told() -> None:
    loop = devices(rd1005())
    law = law_with_gains("proportional_direct", plant_with(loop))
    for value in ("hold", 0.0, 1.2):
        fault = Fault(channel="command", index=0, start=0.2, end=0.4, value=value)
        run = run_of(loop, law, Hardware(faults=(fault,)))
        expected = run.command[199, 0] if value == "hold" else value
        np.testing.assert_array_equal(run.command[BROKEN, 0], expected)
        assert np.ptp(run.command[BROKEN, 1]) > 0.1
        assert np.ptp(run.command[400:, 0]) > 0.1


def test_an_accelerometer_that_gives_no_number_is_left_out_by_the_observer() -> None:
    loop = devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    fault = Fault(channel="acceleration", index=4, start=0.2, end=0.4, value=np.nan)
    observing = Hardware(feedback="observer")
    response = simulate_loop(five_storeys(), loop, law, [sweep(1.0)], replace(observing, faults=(fault,)))
    whole = simulate_loop(five_storeys(), loop, law, [sweep(1.0)], observing)
    assert response.outcome[0] == mr.dampers.Outcome.FINISHED
    assert np.isfinite(response.peak_drift).all()
    assert np.any(response.peak_drift != whole.peak_drift)


def test_the_observer_comes_to_the_state() -> None:
    loop = devices(rd1005())
    still_after = sweep(1.0)
    rest = np.concatenate([still_after.acceleration, np.zeros(300)])
    motion = replace(still_after, acceleration=rest)
    plant = plant_with(loop)
    K = law_with_gains("clipped_optimal", plant).gains["gain"]
    # A weak ideal force, which tells what the law takes for the state and hardly moves the building.
    law = mr.ControlLaw(name="active", gains={"gain": 1e-3 * np.asarray(K)})
    run = run_of(loop, law, Hardware(feedback="observer"), motion)
    wanted = -run.state @ law.gains["gain"].T
    error = np.abs(run.command - wanted)
    size = np.abs(wanted[2000:]).max(axis=0)
    # An error of the shaking dies out in free vibration, down to that of forces held over a sample.
    assert np.all(error[:1000].max(axis=0) > 3.0 * error[2000:].max(axis=0))
    assert np.all(error[2000:].max(axis=0) < 0.02 * size)


KINEMATIC = Hardware(feedback="observer", kinematic=True, measured_storeys=(0, 1, 2, 3, 4))


def test_a_kinematic_observer_is_a_steady_filter_of_double_integrators() -> None:
    frame, Ts = five_storeys(), 1e-3
    seen, run = readings("state", KINEMATIC, building=frame)
    # The covariance by iteration, of one storey: drifts are integrated on their own.
    A, b, C = np.array([[1.0, Ts], [0.0, 1.0]]), np.array([0.5 * Ts**2, Ts]), np.array([[1.0, 0.0]])
    noise = 1.0 / 50.0 / (2.0 * np.pi * frame.frequencies[0]) ** 4 / Ts
    P = np.eye(2)
    for _ in range(20_000):
        gain = A @ P @ C.T / (C @ P @ C.T + noise)
        P = A @ P @ A.T - gain @ C @ P @ A.T + np.outer(b, b) / Ts
    # Of coordinates that all drifts correct the gains are others, but each is a sum of storeys where errors are alike.
    observer = loop_observer(frame, onlookers(), KINEMATIC)
    state, expected = np.zeros(10), []
    for number in range(len(run.time)):
        expected.append(state)
        relative = run.acceleration[number] - run.ground_acceleration[number]
        missed = run.drift[number] - frame.storeys @ state[:5]
        moved = np.concatenate(
            [state[:5] + Ts * state[5:] + 0.5 * Ts**2 * relative, state[5:] + Ts * relative]
        )
        state = moved + observer.gain[:, -5:] @ missed
    np.testing.assert_allclose(seen, expected, rtol=1e-9, atol=1e-9 * np.abs(seen).max())
    # Lowest and highest gains of modes of the drifts on either side of that of a single storey.
    spread = np.linalg.eigvals(observer.gain[:5, -5:] @ frame.storeys).real
    assert spread.min() < gain[0, 0] < spread.max()


def test_a_kinematic_observer_is_as_near_on_a_frame_that_yields() -> None:
    elastic = five_storeys()
    frame = mr.buildings.with_storeys_that_yield(elastic, yield_drift=4e-4)
    errors = {}
    for name, of, hardware in (
        ("elastic", elastic, KINEMATIC),
        ("yielding", frame, KINEMATIC),
        ("linear", frame, replace(KINEMATIC, kinematic=False, measured_storeys=(), known_ground=True)),
    ):
        told = pytest.warns(mr.errors.MrworkWarning, match="kinematic") if name == "linear" else nullcontext()
        with told:
            seen, run = readings("state", hardware, building=of)
        errors[name] = np.abs(seen - run.state)[:, :5].max() / np.abs(run.state[:, :5]).max()
        if of is frame:
            assert np.abs(run.drift).max() > 1.5 * 4e-4
    assert errors["yielding"] < 0.02
    assert errors["elastic"] < 0.02
    assert errors["linear"] > 5.0 * errors["yielding"]


def test_a_kinematic_observer_that_lacks_a_sensor_is_refused() -> None:
    refusal(Hardware, feedback="observer", kinematic=True, match="give `measured_storeys`")
    for hardware, words in (
        (replace(KINEMATIC, measured_storeys=(0, 2)), "give all storeys"),
        (replace(KINEMATIC, measured_floors=(0, 1)), "leave `measured_floors` out"),
    ):
        refusal(run_of, onlookers(), gauge(0.02), hardware, match=words)


def test_fewer_accelerometers_see_less() -> None:
    loop = devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    exact = run_of(loop, law, Hardware())

    def error(floors: tuple[int, ...] | None) -> float:
        run = run_of(loop, law, Hardware(feedback="observer", measured_floors=floors))
        return float(np.mean(run.command != exact.command))

    assert 0.0 < error(None) < error((4,))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"delay": 3e-4}, "whole number of integration steps"),
        ({"step": 1e-12}, "at most 10000 steps"),
        ({"measured_floors": (0, 1, 0)}, "give each once"),
        ({"measured_floors": (0,)}, "no effect with feedback of the state"),
        ({"measured_storeys": (1, 1)}, "give each once"),
        ({"drift_noise": 1e-3}, "give `measured_storeys`"),
        ({"measured_storeys": (1,), "faults": (Fault(channel="drift", index=0),)}, "no sensor measures"),
        ({"seed": 2**32}, "4294967295"),
    ],
)
def test_hardware_that_cannot_be_is_told(settings: dict[str, object], words: str) -> None:
    refusal(Hardware, **settings, match=words)


def test_sensors_and_forecasts_that_nothing_reads_are_refused() -> None:
    for settings in ({"acceleration_noise": 0.1}, {"faults": (Fault(channel="acceleration"),)}):
        hardware = Hardware(**settings)
        refusal(refuse_unread, hardware, accelerations=False, forecasts=True, match="has no effect")
        refuse_unread(replace(hardware, feedback="observer"), accelerations=False, forecasts=False)
    sensed = Hardware(measured_storeys=(0,))
    refusal(refuse_unread, sensed, accelerations=True, forecasts=True, match="read no drifts")
    refuse_unread(sensed, accelerations=False, forecasts=False, drifts=True)
    preview = Hardware(ground_preview=0.05)
    refusal(refuse_unread, preview, accelerations=True, forecasts=False, match="add a predictive_rollout")
    refuse_unread(preview, accelerations=False, forecasts=True)


def test_floors_and_channels_that_are_none_are_refused() -> None:
    floor = Hardware(feedback="observer", measured_floors=(5,))
    refusal(run_of, onlookers(), gauge(0.02), floor, match=r"5 floors, counted from 0; \[5\]")
    storey = Hardware(feedback="observer", measured_storeys=(5,))
    refusal(run_of, onlookers(), gauge(0.02), storey, match=r"5 storeys, counted from 0; \[5\]")
    for channel, count in (("force", 2), ("acceleration", 5)):
        fault = Fault(channel=channel, index=9)
        observing = Hardware(feedback="observer", faults=(fault,))
        refusal(run_of, onlookers(), gauge(0.02), observing, match=f"channel 9, there are {count}")
    refusal(Fault, channel="force", start=2.0, end=1.0, match="an end after its start")
    refusal(Fault, channel="ground_acceleration", index=1, match="one sensor")
