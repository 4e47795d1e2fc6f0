"""Forces on floors move a building as independent integrators say, alone, with the ground and beside other runs."""

from dataclasses import replace

import numpy as np
import pytest
from loop_samples import devices, five_storeys, law_with_gains, linear_states, plant_with, rd1005, sweep
from scipy.integrate import solve_ivp

import mrwork as mr
from mrwork.motions import GroundMotion, force_motion
from mrwork.motions.ground_motion import correlation_of_motions

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

FINE = mr.Hardware(sample_time=0.01, step=0.001)
PUSHED = {"f_c": 20e3, "v_s": 0.005, "c0": 80e3, "f0": 0.0}


def frame(n: int = 3) -> mr.Building:
    return mr.buildings.shear_building(
        name="frame",
        masses=[2e4, 1.8e4, 1.5e4, 1.2e4, 1e4][:n],
        stiffnesses=[2e7, 1.8e7, 1.5e7, 1.2e7, 1e7][:n],
        storey_damping=[8e4, 7e4, 6e4, 5e4, 4e4][:n],
        heights=[4.0] + [3.2] * (n - 1),
    )


def wind(n: int = 3, *, dt: float = 0.02, duration: float = 6.0) -> GroundMotion:
    """Gusts that grow with the height, on each floor of its own."""
    rng, count = np.random.default_rng(2026), round(duration / dt) + 1
    gusts = np.array(
        [np.convolve(rng.standard_normal(count + 24), np.ones(25) / 25, "valid") for _ in range(n)]
    )
    return force_motion(5e3 * np.arange(1, n + 1)[:, None] * (1.0 + gusts), dt, name="wind")


def both(n: int = 3) -> GroundMotion:
    """The gusts over a sweep of the ground."""
    gusts = wind(n)
    return replace(gusts, acceleration=np.interp(gusts.time, sweep(6.0).time, sweep(6.0).acceleration))


def run(
    building: mr.Building, *motions: GroundMotion, hardware: mr.Hardware = FINE, damped: bool = False
) -> mr.Responses:
    """Runs of a building alone, or with a Bingham element across its lowest storey."""
    spec = mr.damper("bingham")
    device = mr.Device(
        name="damper",
        spec=spec,
        theta=[PUSHED[parameter.name] for parameter in spec.parameters],
        row=building.storeys[0],
        largest_command=1.0,
    )
    law = mr.ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * building.n_coordinates))})
    law = mr.ControlLaw(name="passive", gains={"command": [0.0]}) if damped else law
    return mr.simulate_loop(building, [device], law, motions, hardware, histories=True)


def test_gusts_over_a_moving_ground_move_a_linear_frame_as_its_matrix_exponential_says() -> None:
    building, motion = frame(), both()
    found = run(building, motion)
    history = found.histories[0]
    dense = np.arange(0.0, motion.duration + 1e-4, 1e-3)
    exact = linear_states(building, motion, dense)
    assert history.state == pytest.approx(exact[::10], abs=1e-5 * np.abs(exact).max(), rel=0)
    x, v = exact[:, :3], exact[:, 3:]
    forces = np.column_stack([np.interp(dense, motion.time, each) for each in motion.forces])
    ground = np.interp(dense, motion.time, motion.acceleration)
    absolute = np.linalg.solve(
        building.mass, (forces - v @ building.damping.T - x @ building.stiffness.T).T
    ).T
    assert found.peak_acceleration[0] == pytest.approx(np.abs(absolute).max(axis=0), rel=2e-4)
    # Inertia less the forces is what springs and dashpots of the storey carry.
    drift, rate = x @ building.storeys.T, v @ building.storeys.T
    shear = drift * [2e7, 1.8e7, 1.5e7] + rate * [8e4, 7e4, 6e4]
    assert found.peak_storey_shear[0] == pytest.approx(np.abs(shear).max(axis=0), rel=2e-4)
    assert found.peak_base_shear[0] == pytest.approx(found.peak_storey_shear[0, 0], rel=1e-12)
    moment = np.cumsum((shear * [4.0, 3.2, 3.2])[:, ::-1], axis=1)[:, ::-1]
    assert found.peak_overturning[0] == pytest.approx(np.abs(moment).max(axis=0), rel=2e-4)
    work = np.trapezoid((forces * v).sum(axis=1) - ground * (v @ np.diag(building.mass)), dense)
    assert found.input_energy[0] == pytest.approx(work, rel=1e-4)
    assert found.energy_error[0] < 1e-6


def test_a_half_car_by_forces_on_its_wheels_moves_as_dop853_says_over_the_bump_itself() -> None:
    # Body of 600 kg (heave and pitch) on suspensions 1.1 m before and 1.4 m behind its centre, two wheels on tyres.
    mass, springs, dashpots = np.diag([600.0, 900.0, 40.0, 40.0]), [18e3, 20e3], [900.0, 1000.0]
    tyre, pressed, speed, base, span = 190e3, 150.0, 10.0, 2.5, 4.0
    suspensions = np.array([[1.0, -1.1, -1.0, 0.0], [1.0, 1.4, 0.0, -1.0]])
    wheels = np.eye(4)[2:]
    stiffness = suspensions.T @ np.diag(springs) @ suspensions + tyre * wheels.T @ wheels
    damping = suspensions.T @ np.diag(dashpots) @ suspensions + pressed * wheels.T @ wheels
    car = mr.Building(
        name="half car",
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        influence=np.array([1.0, 0.0, 1.0, 1.0]),
        floors=np.array([[1.0, 0.0, 0.0, 0.0], *wheels]),
        storeys=np.vstack([wheels, suspensions]),
        floor_names=("body", "front wheel", "rear wheel"),
        storey_names=("front tyre", "rear tyre", "front suspension", "rear suspension"),
    )

    def road(time: Floats | float) -> tuple[Floats, Floats]:
        """Height and its rate under both wheels: a bump of 40 mm, cos^4, that the rear wheel meets later."""
        place = speed * (np.asarray(time)[..., None] - 0.1) - np.array([0.0, base])
        angle = np.pi * np.clip(place / span - 0.5, -0.5, 0.5)
        rate = -0.16 * np.cos(angle) ** 3 * np.sin(angle) * np.pi * speed / span
        return 0.04 * np.cos(angle) ** 4, rate

    dt = 5e-4
    time = dt * np.arange(3001)
    height, rate = road(time)
    pushed = np.vstack([np.zeros(time.size), (tyre * height + pressed * rate).T])
    spec, numbers = mr.damper("bingham"), {"f_c": 200.0, "v_s": 0.1, "c0": 300.0, "f0": 0.0}
    devices = [
        mr.Device(
            name=name,
            spec=spec,
            theta=[numbers[parameter.name] for parameter in spec.parameters],
            row=row,
            largest_command=1.0,
        )
        for name, row in zip(("front damper", "rear damper"), suspensions, strict=True)
    ]
    law = mr.ControlLaw(name="passive", gains={"command": [0.0, 0.0]})
    hardware = mr.Hardware(sample_time=0.001, step=dt)
    found = mr.simulate_loop(car, devices, law, [force_motion(pushed, dt)], hardware, histories=True)

    def slope(now: float, state: Floats) -> Floats:
        stretch, rates = suspensions @ state[:4], suspensions @ state[4:]
        carried = springs * stretch + dashpots * rates + 200.0 * np.tanh(rates / 0.1) + 300.0 * rates
        under, moved = road(now)
        tyres = tyre * (state[2:4] - under) + pressed * (state[6:] - moved)
        return np.concatenate([state[4:], -np.linalg.solve(mass, suspensions.T @ carried + wheels.T @ tyres)])

    solved = solve_ivp(
        slope, (0.0, 1.5), np.zeros(8), method="DOP853", t_eval=time, rtol=1e-10, atol=1e-13, max_step=0.005
    )
    exact = solved.y.T
    history = found.histories[0].state
    assert history == pytest.approx(exact[::2], abs=1e-4 * np.abs(exact).max())
    strokes = np.abs(exact[:, :4] @ car.storeys.T).max(axis=0)
    assert found.peak_drift[0] == pytest.approx(strokes, rel=1e-4)
    accelerations = np.array([slope(now, state)[[4, 6, 7]] for now, state in zip(time, exact, strict=True)])
    assert found.peak_acceleration[0] == pytest.approx(np.abs(accelerations).max(axis=0), rel=1e-4)
    rms = np.sqrt(np.trapezoid(accelerations**2, time, axis=0) / time[-1])
    assert found.rms_acceleration[0] == pytest.approx(rms, rel=1e-4)


def test_a_damper_under_gusts_moves_as_dop853_says() -> None:
    building, motion = frame(2), wind(2, duration=3.0)
    found = run(building, motion, damped=True)

    def slope(time: float, state: Floats) -> Floats:
        x, v = state[:2], state[2:4]
        force = np.array([np.interp(time, motion.time, each) for each in motion.forces])
        damper = PUSHED["f_c"] * np.tanh(v[0] / PUSHED["v_s"]) + PUSHED["c0"] * v[0]
        resisting = building.damping @ v + building.stiffness @ x + [damper, 0.0] - force
        power = [force @ v, damper * v[0], v @ building.damping @ v]
        return np.concatenate([v, -np.linalg.solve(building.mass, resisting), power])

    # Steps end at the corners of the forces.
    solved = solve_ivp(
        slope, (0.0, 3.0), np.zeros(7), "DOP853", motion.time, rtol=1e-8, atol=1e-10, max_step=0.02
    )
    history = found.histories[0]
    assert history.displacement[::2] == pytest.approx(solved.y[:2].T, abs=1e-5 * np.abs(solved.y[:2]).max())
    energies = found.input_energy[0], found.device_energy[0, 0], found.damping_energy[0]
    assert energies == pytest.approx(solved.y[4:, -1], rel=1e-4)
    assert found.energy_error[0] < 1e-6


def test_forces_and_ground_together_are_the_sum_of_both() -> None:
    together = both()
    found = run(frame(), together, replace(together, forces=np.empty((0, 0))), wind()).histories
    for signal in ("state", "displacement", "acceleration", "drift"):
        each, ground, forces = (getattr(history, signal) for history in found)
        assert each == pytest.approx(ground + forces, abs=1e-10 * np.abs(each).max(), rel=0)


def test_a_constant_force_ends_at_the_static_displacement() -> None:
    building, forces = frame(), np.array([1e4, -5e3, 2e4])
    held = force_motion(np.tile(forces[:, None], 3001), 0.02)
    end = run(building, held).histories[0].displacement[-1]
    assert end == pytest.approx(np.linalg.solve(building.stiffness, forces), rel=1e-6)


def test_a_shape_times_a_history_is_an_influence_of_minus_the_inverse_mass_times_the_shape() -> None:
    building, shape = frame(), np.array([0.5, 1.0, 2.0])
    motion = sweep(4.0)
    falsified = replace(building, influence=-np.linalg.solve(building.mass, shape) * 1e4)
    one = run(building, force_motion(1e4 * shape[:, None] * motion.acceleration, motion.dt))
    other = run(falsified, motion)
    assert one.peak_drift == pytest.approx(other.peak_drift, rel=1e-12)
    # Inertia by the falsified influence is that of the motion less the forces.
    assert one.peak_storey_shear == pytest.approx(other.peak_storey_shear, rel=1e-12)
    assert not np.allclose(one.peak_acceleration, other.peak_acceleration, rtol=0.05)


@pytest.mark.parametrize("dt", [0.01, 2e-4], ids=["coarse", "finer than the step"])
def test_forced_unforced_and_shaken_runs_of_one_call_equal_their_single_runs(dt: float) -> None:
    building, loop = five_storeys(), devices(rd1005())
    shaken = mr.motions.resampled(sweep(1.0, dt=0.01), dt)
    forces = 200.0 * np.random.default_rng(5).standard_normal((5, shaken.n_time))
    still = force_motion(forces[::-1], dt, name="still")
    motions = [
        shaken,
        replace(shaken, forces=forces, name="both"),
        still,
        replace(shaken, name="again"),
        replace(still, forces=2.0 * forces),
    ]
    plant = plant_with(loop, building)
    law = law_with_gains("clipped_optimal", plant)
    hardware = mr.Hardware(sample_time=0.002, step=0.001, feedback="observer")
    law = replace(
        law, gains={**law.gains, "gain": np.stack([law.gains["gain"] * s for s in (0.5, 1.0, 2.0)])}
    )
    together = mr.simulate_loop(building, loop, law, motions, hardware, histories=True)
    for number, motion in enumerate(motions):
        alone = mr.simulate_loop(
            building, loop, law, [motion], hardware, histories=True, motion_numbers=[number]
        )
        at = [number + len(motions) * candidate for candidate in range(3)]
        for name, values in alone.numbers.items():
            assert together.numbers[name][at].tobytes() == values.tobytes(), name
        for place, history in zip(at, alone.histories, strict=True):
            for name, values in history.numbers.items():
                assert together.histories[place].numbers[name].tobytes() == values.tobytes(), name


def test_forces_finer_than_the_step_act_by_their_impulse() -> None:
    building, dt = frame(), 1e-4
    forces = np.zeros((3, 5001))
    # Two samples: a triangle of 20 N s between the steps.
    forces[2, 1003] = 20.0 / dt
    kicked = run(building, force_motion(forces, dt), hardware=mr.Hardware(sample_time=0.002, step=0.002))
    velocity = kicked.histories[0].state[51, 3:]
    assert velocity[2] == pytest.approx(20.0 / 1.5e4, rel=1e-2)


def test_the_slopes_of_a_linear_law_hold_under_forces() -> None:
    building, motion = frame(), wind(duration=2.0)
    device = mr.buildings.ideal_actuator(name="actuator", row=building.storeys[0])
    gain = np.full((1, 6), 1e3)

    def peaks(gain: Floats, **more: object) -> mr.Responses:
        law = mr.ControlLaw(name="active", gains={"gain": gain})
        return mr.simulate_loop(building, [device], law, [motion], FINE, **more)

    direction = np.linspace(-1.0, 1.0, 6)[None]
    vary = mr.closed_loop.LoopVariation(
        buildings=(building,), delay=np.zeros(1), seed=np.zeros(1, dtype=np.int64), changes=direction
    )
    (slopes,) = peaks(gain, variation=vary).slopes
    ends = [peaks(gain + reach * direction).input_energy[0] for reach in (10.0, -10.0)]
    assert slopes["input_energy"][0] == pytest.approx((ends[0] - ends[1]) / 20.0, rel=1e-4)


def test_processing_keeps_forces_with_their_samples() -> None:
    motion = both()
    doubled = mr.motions.scaled(motion, 2.0)
    assert np.array_equal(doubled.forces, 2.0 * motion.forces)
    assert doubled.changes == ("acceleration and forces x 2",)
    assert mr.motions.scaled(wind(), 2.0).changes == ("forces x 2",)
    part = mr.motions.trimmed(motion, start=1.0, end=2.0)
    assert np.array_equal(part.forces, motion.forces[:, 50:101])
    finer = mr.motions.resampled(motion, 0.01)
    assert np.array_equal(finer.forces[:, ::2], motion.forces)
    assert mr.motions.time_scaled(motion, 0.5).forces is motion.forces
    assert wind().remarks == ()
    gusts = wind()
    turned = replace(gusts, forces=gusts.forces[::-1])
    assert correlation_of_motions(gusts, mr.motions.scaled(gusts, -2.0)) == pytest.approx(1.0)
    assert correlation_of_motions(gusts, turned) < 0.9
    assert "5 floors" not in str(motion)
    assert "peak of the forces" in str(motion)


@pytest.mark.parametrize(
    ("forces", "says"),
    [
        (np.zeros((3, 5)), "as many samples"),
        (np.zeros(11), "a row for each floor"),
        (np.full((3, 11), np.nan), "sample 0 of the force on floor 1"),
    ],
)
def test_forces_that_are_none_are_refused(forces: Floats, says: str) -> None:
    with pytest.raises(mr.errors.RecordError, match=says):
        GroundMotion(name="a", dt=0.01, acceleration=np.zeros(11), forces=forces)


def test_forces_of_another_building_and_intensities_of_the_ground_are_refused() -> None:
    with pytest.raises(mr.errors.SettingError, match="3 floors, and the building 2 floors"):
        run(frame(2), wind(3))
    for refused in (
        lambda: mr.motions.scaled_to_peak(both(), 1.0),
        lambda: mr.motions.baseline_corrected(both(), order=0),
        lambda: mr.motions.ShakeTable().demand(both()),
        lambda: mr.motions.scaled_to_target(both(), mr.motions.en_1998_spectrum(2.0, "B"), by="pga"),
    ):
        with pytest.raises(mr.errors.SettingError, match="forces on floors"):
            refused()
    with pytest.raises(mr.errors.RecordError, match="a row of samples for each floor"):
        force_motion([1.0, 2.0], 0.01)
