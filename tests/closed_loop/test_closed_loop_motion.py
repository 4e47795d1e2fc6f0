"""The loop moves as independent integrators say it does, and what it keeps is what its histories hold."""

from dataclasses import replace

import numpy as np
import pytest
from control_samples import shear_frame
from loop_samples import (
    LAG,
    at_samples,
    devices,
    five_storeys,
    friction,
    law_with_gains,
    linear_states,
    nothing,
    plant_with,
    rd1005,
    sweep,
)
from scipy.integrate import solve_ivp

import mrwork as mr
from mrwork.buildings import Building, buildings
from mrwork.closed_loop import Hardware, History, Responses, simulate_loop

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

CLOCK = Hardware(sample_time=0.01, step=0.01)


def passive(n_devices: int = 1, command: float = 0.0) -> mr.ControlLaw:
    return mr.ControlLaw(name="passive", gains={"command": np.full(n_devices, command)})


def dashpots(building: Building, coefficient: float) -> list[mr.Device]:
    """Dashpots across the two lowest storeys: a Bingham element whose yield force is a millinewton."""
    theta = [1e-3, 1e2, coefficient, 0.0]
    rows = building.storeys[:2]
    return [
        mr.Device(name=f"dashpot {i}", spec=mr.damper("bingham"), theta=theta, row=row, largest_command=1.0)
        for i, row in enumerate(rows)
    ]


def run_of(
    building: Building,
    loop: list[mr.Device],
    law: mr.ControlLaw,
    motion: mr.GroundMotion,
    hardware: Hardware,
    *,
    step_factor: int = 1,
) -> tuple[History, Responses]:
    response = simulate_loop(building, loop, law, [motion], hardware, histories=True, step_factor=step_factor)
    assert response.outcome[0] == mr.dampers.Outcome.FINISHED
    return response.histories[0], response


def relative(found: Floats, expected: Floats) -> float:
    """Largest difference of any column, as a share of its largest value."""
    return float(np.max(np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)))


@pytest.mark.parametrize("building", [*buildings(), shear_frame(40)], ids=lambda building: building.name)
def test_a_bare_building_moves_as_its_exponential(building: Building) -> None:
    loop, law = nothing(building)
    motion = sweep()
    run, _ = run_of(building, loop, law, motion, Hardware(sample_time=1e-3, step=2.5e-4))
    expected = linear_states(building, motion, run.time)
    # (omega h)^4/120 over a few dozen radians of the slow modes, which are all that the sweep moves.
    assert relative(run.state, expected) < 1e-8
    n = building.n_coordinates
    np.testing.assert_allclose(run.displacement, run.state[:, :n] @ building.floors.T, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(run.drift, run.state[:, :n] @ building.storeys.T, rtol=1e-9, atol=1e-15)


def test_the_error_of_a_smooth_run_falls_with_the_fourth_power_of_the_step() -> None:
    building, motion = five_storeys(), sweep()
    loop = dashpots(building, 3000.0)
    errors = []
    for factor in (1, 2, 4, 8):
        run, _ = run_of(building, loop, passive(2), motion, CLOCK, step_factor=factor)
        errors.append(relative(run.state, linear_states(building, motion, run.time, 3000.0 + 1e-5)))
    ratios = np.array(errors[1:-1]) / np.array(errors[2:])
    np.testing.assert_allclose(ratios, 16.0, rtol=0.25)


def test_the_energy_error_falls_with_the_step() -> None:
    building, motion = five_storeys(), sweep()
    loop = dashpots(building, 3000.0)
    errors = [
        run_of(building, loop, passive(2), motion, Hardware(step=1e-3 / factor))[1].energy_error[0]
        for factor in (1, 2, 4)
    ]
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2]
    assert errors[2] < 1e-10


def forces(device: mr.Device, state: Floats, elongation: float, rate: float) -> tuple[float, Floats]:
    """Force of one damper and the rate of its state, by the core's scalar functions."""
    theta = np.asarray(device.theta, dtype=np.float64)
    force = mr._rust.force(device.spec.name, theta, state, elongation, rate)
    return force, mr._rust.rate(device.spec.name, theta, state, elongation, rate)


@pytest.mark.parametrize("model", ["static_hysteretic", "normalised_bouc_wen", "elasto_visco_plastic"])
def test_a_building_with_a_damper_moves_as_an_adaptive_integrator_says(model: str) -> None:
    building, motion = five_storeys(), sweep(0.6)
    spec = mr.damper(model)
    theta = spec.nominal.copy()
    if model == "static_hysteretic":
        theta[spec.names.index("x_s")] = 1e-3
    device = mr.Device(name="one", spec=spec, theta=theta, row=building.storeys[0], largest_command=1.0)
    run, _ = run_of(building, [device], passive(), motion, Hardware(sample_time=0.01, step=5e-5))
    A, B, E = building.state_matrices(building.storeys[:1])
    n, row = building.n_coordinates, building.storeys[0]

    def rate(time: float, y: Floats) -> Floats:
        s, z = y[: 2 * n], y[2 * n :]
        force, of_z = forces(device, z, row @ s[:n], row @ s[n:])
        ground = np.interp(time, motion.time, motion.acceleration)
        return np.concatenate([A @ s + B[:, 0] * force + E * ground, of_z])

    y = np.zeros(2 * n + spec.n_states)
    for k, time in enumerate(run.time):
        assert relative_to(run, k, y[: 2 * n]) < 2e-7
        y = solve_ivp(rate, (time, time + 0.01), y, method="LSODA", rtol=1e-9, atol=1e-12).y[:, -1]


def relative_to(run: History, k: int, state: Floats) -> float:
    """Difference of the state at a sample, as a share of the largest of each kind in the run."""
    n = len(state) // 2
    size = np.repeat([np.abs(run.state[:, :n]).max(), np.abs(run.state[:, n:]).max()], n)
    return float(np.max(np.abs(run.state[k] - state) / size))


def test_building_lag_and_energies_follow_the_commands_as_an_adaptive_integrator_says() -> None:
    building, motion = five_storeys(), sweep(0.6, peak=4.0)
    spec, theta = rd1005()
    theta = theta.copy()
    theta[spec.names.index("x_s")] = 1e-3
    loop = devices((spec, theta))
    law = law_with_gains("clipped_optimal", plant_with(loop))
    run, _ = run_of(building, loop, law, motion, Hardware(sample_time=0.01, step=5e-5))
    assert len(np.unique(run.command)) > 1
    p = dict(zip(spec.names, theta, strict=True))
    rows = np.array([device.row for device in loop])
    A, B, E = building.state_matrices(rows)
    n = building.n_coordinates

    def one(i: Floats, x: Floats, v: Floats) -> Floats:
        alpha = p["alpha.0"] + p["alpha.1"] * i + p["alpha.2"] * i**2
        loop = np.tanh(p["beta"] * v + (p["delta.0"] + p["delta.1"] * i) * np.tanh(x / p["x_s"]))
        linear = (p["c.0"] + p["c.1"] * i) * v + (p["k.0"] + p["k.1"] * i) * x
        return np.asarray(linear + alpha * loop + p["f0.0"] + p["f0.1"] * i)

    def rate(time: float, y: Floats, command: Floats) -> Floats:
        s, i = y[: 2 * n], y[2 * n : 2 * n + 2]
        x, v = rows @ s[:n], rows @ s[n:]
        # A differential pair, and two side by side.
        pair, two = one(i, x, v) - one(i, -x, -v), 2.0 * one(i, x, v)
        force = np.array([pair[0], two[1]])
        ground = np.interp(time, motion.time, motion.acceleration)
        powers = [
            force * v,
            [s[n:] @ building.damping @ s[n:], -(s[n:] @ building.mass @ building.influence) * ground],
        ]
        return np.concatenate([A @ s + B @ force + E * ground, -LAG * (i - command), *powers])

    y = np.zeros(2 * n + 6)
    # The first command has been there since long before.
    y[2 * n : 2 * n + 2] = run.command[0]
    for k, time in enumerate(run.time):
        assert relative_to(run, k, y[: 2 * n]) < 2e-7
        np.testing.assert_allclose(run.current[k], y[2 * n : 2 * n + 2], atol=1e-7)
        works = np.array([*run.device_energy[k], run.damping_energy[k], run.input_energy[k]])
        np.testing.assert_allclose(works, y[2 * n + 2 :], atol=1e-6 * run.input_energy.max())
        y = solve_ivp(
            rate, (time, time + 0.01), y, args=(run.command[k],), method="LSODA", rtol=1e-9, atol=1e-12
        ).y[:, -1]


@pytest.mark.parametrize("spec", mr.damper_models(), ids=lambda spec: spec.name)
def test_a_pair_in_opposition_is_two_devices_the_other_way_round(spec: mr.DamperSpec) -> None:
    building, motion = five_storeys(), sweep(0.5)
    one = mr.Device(name="one", spec=spec, theta=spec.nominal, row=building.storeys[0], largest_command=1.0)
    other = replace(one, name="other", row=-building.storeys[0])
    hardware = Hardware(step=2.5e-4)
    pair, _ = run_of(building, [replace(one, differential=True)], passive(), motion, hardware)
    both, _ = run_of(building, [one, other], passive(2), motion, hardware)
    # An offset that is not counted and one that cancels differ by rounding.
    assert relative(pair.state, both.state) < 1e-11
    whole = both.force[:, 0] - both.force[:, 1]
    np.testing.assert_allclose(pair.force[:, 0], whole, atol=1e-10 * np.abs(whole).max())
    np.testing.assert_allclose(pair.device_energy[:, 0], both.device_energy.sum(axis=1), atol=1e-10)


def test_several_side_by_side_are_as_many_devices() -> None:
    building, motion = five_storeys(), sweep(0.5)
    spec, theta = rd1005()
    one = mr.Device(name="one", spec=spec, theta=theta, row=building.storeys[1], largest_command=1.88)
    two, _ = run_of(building, [replace(one, count=2.0)], passive(1, 1.2), motion, Hardware())
    each, _ = run_of(building, [one, replace(one, name="other")], passive(2, 1.2), motion, Hardware())
    assert relative(two.state, each.state) < 1e-9
    np.testing.assert_allclose(two.force[:, 0], each.force.sum(axis=1), rtol=1e-9, atol=1e-6)


def test_draws_are_the_dampers_one_by_one() -> None:
    building, motion = five_storeys(), sweep(0.5)
    spec, theta = rd1005()
    draws = np.tile(theta, (5, 1))
    draws[:, spec.names.index("c.0")] *= [1.0, 60.0, 0.2, 1.3, 200.0]
    together = simulate_loop(building, devices((spec, draws)), passive(2, 1.0), [motion])
    assert together.shape == (1, 1, 5)
    assert len(set(together.steps)) > 1
    for k, draw in enumerate(draws):
        alone = simulate_loop(building, devices((spec, draw)), passive(2, 1.0), [motion])
        np.testing.assert_array_equal(together.peak_drift[k], alone.peak_drift[0])
        np.testing.assert_array_equal(together.device_energy[k], alone.device_energy[0])


def test_coordinates_do_not_matter() -> None:
    building = five_storeys()
    # q = T y with any T that can be inverted: no row of any matrix is sparse, and the ground moves each coordinate.
    T = np.eye(5) + 0.3 * np.random.default_rng(9).uniform(-1.0, 1.0, (5, 5))
    moved = replace(
        building,
        name="moved",
        mass=T.T @ building.mass @ T,
        damping=T.T @ building.damping @ T,
        stiffness=T.T @ building.stiffness @ T,
        influence=np.linalg.solve(T, building.influence),
        floors=building.floors @ T,
        storeys=building.storeys @ T,
    )
    loop = devices(rd1005())
    other = [replace(device, row=device.row @ T) for device in loop]
    law = law_with_gains("active", plant_with(loop))
    gain = np.asarray(law.gains["gain"]) @ np.kron(np.eye(2), T)
    for one, same in ((passive(2, 1.0), passive(2, 1.0)), (law, replace(law, gains={"gain": gain}))):
        plain, _ = run_of(building, loop, one, sweep(), Hardware())
        run, _ = run_of(moved, other, same, sweep(), Hardware())
        for name in ("displacement", "acceleration", "drift", "force"):
            assert relative(getattr(run, name), getattr(plain, name)) < 1e-9
        for name in ("device_energy", "input_energy", "damping_energy"):
            np.testing.assert_allclose(getattr(run, name)[-1], getattr(plain, name)[-1], rtol=1e-9)


@pytest.fixture(scope="module")
def every_step() -> tuple[History, Responses]:
    """A run whose every step is a control sample, so that the history before its end holds all that is reduced."""
    loop = devices(rd1005())
    law = law_with_gains("clipped_optimal", plant_with(loop))
    _, kept = run_of(five_storeys(), loop, law, sweep(), Hardware(sample_time=5e-4, step=5e-4))
    assert kept.steps[0] == 1
    return at_samples(kept), kept


@pytest.mark.parametrize("name", ["displacement", "acceleration", "drift", "force", "current"])
def test_peaks_and_root_mean_squares_are_those_of_the_history(
    every_step: tuple[History, Responses], name: str
) -> None:
    run, kept = every_step
    values = getattr(run, name)
    np.testing.assert_array_equal(getattr(kept, f"peak_{name}")[0], np.abs(values).max(axis=0))
    rms = np.sqrt(np.mean(values**2, axis=0))
    np.testing.assert_allclose(getattr(kept, f"rms_{name}")[0], rms, rtol=1e-12)


def test_a_peak_at_the_end_of_the_record_is_one_of_the_run() -> None:
    """Of a record that is cut where it is largest, against the exponential; 5 ms before peaks are 3 % lower."""
    building, at = five_storeys(), np.arange(28) * 0.02
    motion = mr.GroundMotion(name="cut", dt=0.02, acceleration=3.0 * at * np.sin(2.0 * np.pi * at / 0.8))
    loop, law = nothing(building)
    _, kept = run_of(building, loop, law, motion, Hardware(sample_time=0.005, step=0.0025))
    time = np.arange(541) * 1e-3
    A, _, E = building.state_matrices()
    n, ground = building.n_coordinates, np.interp(time, motion.time, motion.acceleration)[:, None]
    relative = linear_states(building, motion, time) @ A[n:].T + ground * E[n:]
    shear = (relative + ground * building.influence) @ building.mass @ building.influence
    acceleration = relative @ building.floors.T + ground
    assert np.abs(shear).argmax() == np.abs(acceleration).max(axis=1).argmax() == len(time) - 1
    np.testing.assert_allclose(kept.peak_acceleration[0], np.abs(acceleration).max(axis=0), rtol=1e-4)
    np.testing.assert_allclose(kept.peak_base_shear[0], np.abs(shear).max(), rtol=1e-4)


def test_strokes_rates_and_means_are_those_of_the_history(every_step: tuple[History, Responses]) -> None:
    run, kept = every_step
    np.testing.assert_array_equal(kept.peak_stroke[0], np.abs(run.deformation).max(axis=0))
    np.testing.assert_array_equal(kept.peak_rate[0], np.abs(run.rate).max(axis=0))
    np.testing.assert_allclose(kept.mean_current[0], run.current.mean(axis=0), rtol=1e-12)


def test_base_shear_is_the_force_that_carries_all_masses(every_step: tuple[History, Responses]) -> None:
    run, kept = every_step
    shear = run.acceleration @ np.diag(five_storeys().mass)
    np.testing.assert_allclose(kept.peak_base_shear, np.abs(shear).max(), rtol=1e-12)
    np.testing.assert_allclose(kept.rms_base_shear, np.sqrt(np.mean(shear**2)), rtol=1e-12)


def test_storey_shears_carry_the_masses_above_and_turn_the_frame_over(
    every_step: tuple[History, Responses],
) -> None:
    run, kept = every_step
    building = five_storeys()
    inertia = run.acceleration * np.diag(building.mass)
    shears = np.cumsum(inertia[:, ::-1], axis=1)[:, ::-1]
    np.testing.assert_allclose(kept.peak_storey_shear[0], np.abs(shears).max(axis=0), rtol=1e-12)
    np.testing.assert_allclose(
        kept.peak_frame_shear[0], building.storey_stiffnesses * np.abs(run.drift).max(axis=0), rtol=1e-12
    )
    # Heights of the frame of this test are not known.
    assert np.isnan(kept.peak_overturning).all()
    _, tall = run_of(
        replace(building, heights=np.array([4.0, 3.0, 3.0, 3.0, 3.0])),
        devices(rd1005()),
        law_with_gains("clipped_optimal", plant_with(devices(rd1005()))),
        sweep(),
        Hardware(sample_time=5e-4, step=5e-4),
    )
    moments = np.cumsum((shears * [4.0, 3.0, 3.0, 3.0, 3.0])[:, ::-1], axis=1)[:, ::-1]
    np.testing.assert_allclose(tall.peak_overturning[0], np.abs(moments).max(axis=0), rtol=1e-12)


def test_what_enters_is_stored_or_lost(every_step: tuple[History, Responses]) -> None:
    run, kept = every_step
    building = five_storeys()
    stored = run.kinetic_energy(building) + run.strain_energy(building)
    lost = run.damping_energy + run.device_energy.sum(axis=1)
    error = np.abs(run.input_energy - stored - lost).max() / kept.input_energy[0]
    assert error < 1e-6
    np.testing.assert_allclose(
        kept.input_energy,
        kept.kinetic_energy + kept.strain_energy + kept.damping_energy + kept.device_energy.sum(axis=1),
        rtol=1e-6,
    )


def test_a_record_has_as_many_samples_as_fit_in_it_and_its_end() -> None:
    building = five_storeys()
    for sample_time, count in ((0.01, 50), (0.003, 166), (0.004, 125), (1.0, 1)):
        run, _ = run_of(
            building, devices(friction()), passive(2), sweep(0.5), Hardware(sample_time=sample_time)
        )
        assert len(run.time) == count + 1
    np.testing.assert_allclose(run.time, [0.0, 1.0])


def test_the_ground_runs_straight_between_samples() -> None:
    motion = sweep(0.5, dt=0.01)
    run, _ = run_of(five_storeys(), devices(friction()), passive(2), motion, Hardware(sample_time=0.003))
    expected = np.interp(run.time, motion.time, motion.acceleration)
    np.testing.assert_allclose(run.ground_acceleration, expected, atol=1e-12)
