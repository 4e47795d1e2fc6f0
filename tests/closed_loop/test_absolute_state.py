"""On a road gains read absolute velocities: against exact steps of one's own, in lanes, through observers, in C."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import scipy
from quarter_car import BODY, DASHPOT, SPRING, TYRE, TYRE_DASHPOT, WHEEL, quarter_car
from quarter_car import CAR as CAR_TABLES
from quarter_car import ROAD as ROAD_TABLE
from refusals import refusal

import mrwork as mr
from mrwork import _rust
from mrwork.base.values import Floats
from mrwork.closed_loop.printed_loop import printed_loop
from mrwork.control import accelerations, deformations, observer_of, plant_of
from mrwork.control.linear.plant import stack_outputs
from mrwork.jax import loop

CAR, TS = quarter_car(), 1e-3
ROAD = mr.motions.iso_8608_road("C", speed=20.0, rng=5, duration=6.0)
SHAKEN = replace(ROAD, name="shaken", is_road=False)
ACTUATOR = mr.buildings.ideal_actuator(name="suspension", row=CAR.storeys[1])
DAMPER = mr.Device(
    name="damper",
    spec=mr.damper("bingham").with_current_laws({"f_c": "linear"}, lag="none"),
    theta=[20.0, 600.0, 0.02, 100.0, 0.0],
    row=CAR.storeys[1],
    largest_command=1.0,
    sprung=[0.0, 1.0],
)
# Of a body that is held to the sky and a wheel that is held to the road: f_c = -K s.
GAIN = np.array([[-9000.0, 6000.0, 60.0, -1800.0]])
ACTIVE = mr.ControlLaw(name="active", gains={"gain": GAIN})
CLIPPED = mr.ControlLaw(name="clipped_optimal", gains={"gain": GAIN})
SKYHOOK = mr.control.design_law(
    "mixed_skyhook",
    mr.control.DesignProblem(building=CAR, devices=[DAMPER], sample_time=TS),
    {"crossover": float("inf")},
)
FILTERED = mr.Hardware(sample_time=TS, feedback="observer")


def exact_body_acceleration(share: float) -> Floats:
    """Absolute acceleration of the body at the samples, the force held between them, velocities with a share of v_g.

    An exponential of the matrix for a ground that is linear and a force that is constant between the samples.
    """
    M = np.diag([WHEEL, BODY])
    K = np.array([[TYRE + SPRING, -SPRING], [-SPRING, SPRING]])
    C = np.array([[TYRE_DASHPOT + DASHPOT, -DASHPOT], [-DASHPOT, DASHPOT]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    pull = np.concatenate([np.zeros(2), -np.linalg.solve(M, CAR.storeys[1])])
    push = np.array([0.0, 0.0, -1.0, -1.0])
    ground = np.asarray(ROAD.acceleration)
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * TS * (ground[1:] + ground[:-1]))])
    whole = np.zeros((7, 7))
    whole[:4] = np.column_stack([A, push, pull, np.zeros(4)])
    whole[4, 6] = 1.0 / TS
    step = scipy.linalg.expm(whole * TS)
    state, found = np.zeros(4), np.zeros(len(ground))
    for index in range(len(ground)):
        read = state + share * velocity[index] * np.array([0.0, 0.0, 1.0, 1.0])
        force = float(-GAIN[0] @ read)
        found[index] = A[3] @ state + pull[3] * force
        if index + 1 < len(ground):
            rise = ground[index + 1] - ground[index]
            state = (step @ np.concatenate([state, [ground[index], force, rise]]))[:4]
    return found


def body_acceleration(law: mr.ControlLaw, motion: mr.motions.GroundMotion = ROAD) -> Floats:
    hardware = mr.Hardware(sample_time=TS)
    run = mr.simulate_loop(CAR, [ACTUATOR], law, [motion], hardware, histories=True)
    return np.asarray(run.histories[0].acceleration)[: ROAD.acceleration.size, 1]


@pytest.mark.parametrize(
    ("law", "motion", "share"),
    [
        (ACTIVE, ROAD, 1.0),
        (replace(ACTIVE, state="relative"), ROAD, 0.0),
        (ACTIVE, SHAKEN, 0.0),
        (replace(ACTIVE, state="absolute"), SHAKEN, 1.0),
    ],
)
def test_a_gain_multiplies_absolute_velocities_on_a_road(
    law: mr.ControlLaw, motion: mr.motions.GroundMotion, share: float
) -> None:
    # At the end the last command is held.
    expected, found = exact_body_acceleration(share)[:-1], body_acceleration(law, motion)[:-1]
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_an_earthquake_has_its_bits_beside_a_road() -> None:
    both = mr.simulate_loop(CAR, [DAMPER], CLIPPED, [ROAD, SHAKEN], mr.Hardware(sample_time=TS))
    for index, motion in enumerate([ROAD, SHAKEN]):
        alone = mr.simulate_loop(CAR, [DAMPER], CLIPPED, [motion], mr.Hardware(sample_time=TS))
        np.testing.assert_array_equal(both.peak_drift[index], alone.peak_drift[0])
    assert both.peak_drift[0, 1] != both.peak_drift[1, 1]


def rms_body(law: mr.ControlLaw, hardware: mr.Hardware) -> float:
    run = mr.simulate_loop(CAR, [DAMPER], law, [ROAD], hardware)
    return float(run.rms_acceleration[0, 1])


@pytest.mark.parametrize("law", [SKYHOOK, CLIPPED])
def test_an_observer_of_accelerometers_and_stroke_knows_what_laws_read_on_a_road(law: mr.ControlLaw) -> None:
    true = rms_body(law, mr.Hardware(sample_time=TS))
    assert rms_body(law, FILTERED) == pytest.approx(true, rel=0.05)
    noisy = replace(FILTERED, acceleration_noise=0.05, deformation_noise=5e-4)
    assert rms_body(law, noisy) == pytest.approx(true, rel=0.05)
    # One that takes the road for an earthquake does not.
    assert rms_body(SKYHOOK, replace(FILTERED, kinematic=True, measured_storeys=(0, 1))) > 1.1 * rms_body(
        SKYHOOK, FILTERED
    )


def test_the_observer_of_a_white_velocity_is_the_steady_filter_of_its_own_equations() -> None:
    plant = plant_of(CAR, [DAMPER.row])
    sensors = stack_outputs(accelerations(plant), deformations(plant))
    found = observer_of(plant, sensors, TS, noise_intensity=0.02, unmodelled=0.0, white="velocity")
    # In [q; z] with z = q' + r v_g: q' = z - r v_g, and M z' = -K q - C z + C r v_g + e f.
    M, r = np.diag([WHEEL, BODY]), np.ones(2)
    entered = np.concatenate([-r, np.linalg.solve(M, CAR.damping @ r)])
    held = scipy.linalg.expm(TS * np.block([[plant.A, entered[:, None]], [np.zeros((1, 5))]]))
    F, E = held[:4, :4], held[:4, 4]
    H = np.vstack([plant.A[2:], [-1.0, 1.0, 0.0, 0.0]])
    G = np.concatenate([entered[2:], [0.0]])
    Q, N = np.outer(E, E) / TS, np.outer(E, G) / TS
    R = (np.outer(G, G) + 0.02 * np.eye(3)) / TS
    P = scipy.linalg.solve_discrete_are(F.T, H.T, Q, R, s=N)
    gain = (F @ P @ H.T + N) @ np.linalg.inv(H @ P @ H.T + R)
    np.testing.assert_allclose(found.gain, gain, rtol=1e-6, atol=1e-9 * np.abs(gain).max())
    relative = replace(sensors, G=np.ones(len(sensors.names)))
    refusal(partial(observer_of, white="velocity"), plant, relative, TS, match="absolute")


def test_the_loop_in_jax_reads_the_same_state() -> None:
    hardware = mr.Hardware(sample_time=TS)
    short = mr.motions.iso_8608_road("C", speed=20.0, rng=5, duration=1.0)
    core = mr.simulate_loop(CAR, [DAMPER], CLIPPED, [short], hardware)
    twin = loop(CAR, [DAMPER], CLIPPED, short, hardware)(histories=False)
    np.testing.assert_allclose(twin.numbers["peak_drift"], core.peak_drift[0], rtol=1e-9)


def test_a_law_without_a_gain_of_the_state_has_none_to_choose() -> None:
    refusal(partial(mr.ControlLaw, state="absolute"), name="passive", gains={"command": [1.0]}, match="state")


LAWS = """
[[controller]]
law = "mixed_skyhook"
label = "skyhook"
settings = { crossover = inf }

[[controller]]
law = "clipped_optimal"
gain = [[-9000.0, 6000.0, 60.0, -1800.0]]
"""


def study_on_a_road(tmp_path: Path, hardware: str) -> mr.study.Study:
    car = CAR_TABLES.replace('storey = "suspension"', 'storey = "suspension"\nsprung = "body"')
    path = tmp_path / "car.toml"
    path.write_text(car + ROAD_TABLE + LAWS + f"\n[hardware]\nsample_time = 1e-3\n{hardware}\n")
    return mr.read_study(path)


@pytest.mark.parametrize("hardware", ["kinematic = true\nmeasured_storeys = [1, 2]", "known_ground = true"])
def test_a_study_says_which_observers_take_a_road_for_an_earthquake(tmp_path: Path, hardware: str) -> None:
    observed = 'feedback = "observer"\n'
    told = [remark.code for remark in study_on_a_road(tmp_path, observed + hardware).remarks]
    assert "road_observed" in told
    told = [remark.code for remark in study_on_a_road(tmp_path, observed).remarks]
    assert "road_observed" not in told


def test_a_printed_controller_of_a_road_estimates_absolute_velocities(tmp_path: Path) -> None:
    study = study_on_a_road(tmp_path, 'feedback = "observer"')
    for label in ("skyhook", "Clipped-optimal"):
        law = next(each.law for each in study.arrangements if each.row.label == label)
        printed = printed_loop(study.building, study.devices, law, study.hardware, study.grounds)
        assert printed.is_absolute
        assert not {"ground_velocity", "velocity"} & dict(_rust.law_text(printed)["reads"]).keys()


def test_weights_of_a_road_predict_its_rms_within_five_per_cent() -> None:
    roads = [mr.motions.iso_8608_road("C", speed=20.0, rng=number, duration=30.0) for number in range(4)]
    problem = mr.control.DesignProblem(building=CAR, devices=[ACTUATOR], motions=roads, sample_time=TS)
    limits = {"rms_acceleration": [30.0, 1.0], "rms_drift": 0.015, "budget": 1000.0}
    law = mr.control.design_law("active", problem, {"control_weight": 1.0, "designed": limits})
    assert law.weights is not None
    assert law.weights.reachable_ratio < 1.0
    run = mr.simulate_loop(CAR, [ACTUATOR], law, roads, mr.Hardware(sample_time=TS))
    found = [*run.rms_drift.mean(axis=0), *run.rms_acceleration.mean(axis=0)]
    names = [
        *(f"drift {name}" for name in CAR.storey_names),
        *(f"acceleration {name}" for name in CAR.floor_names),
    ]
    told = dict(
        zip(law.weights.outputs.names, law.weights.rms_under_ground(controlled=True).tolist(), strict=True)
    )
    assert found == pytest.approx([told[name] for name in names], rel=0.05)
    # A fifth of the budget is enough: its multiplier is zero, and R still has a size that is scanned.
    assert np.isfinite(law.gains["gain"]).all()


def test_the_ground_of_roads_has_the_density_of_iso_8608() -> None:
    roads = [mr.motions.iso_8608_road("C", speed=20.0, rng=number, duration=30.0) for number in range(4)]
    ground = mr.motions.stationary_ground(roads)
    # Heights have 256e-6 m^3 at 0.1 cycles/m and fall with its square: velocities have (2 pi 0.1)^2 256e-6 v per Hz.
    level = (2.0 * np.pi * 0.1) ** 2 * 256e-6 * 20.0 / (4.0 * np.pi)
    assert ground.spectrum.intensity == pytest.approx(level, rel=0.1)
    assert mr.motions.stationary_ground([*roads, mr.synthetic_motion()]) == mr.motions.stationary_ground(
        [mr.synthetic_motion()]
    )
    refusal(partial(mr.motions.stationary_ground, frequency=15.0), roads, match="soil")
    level_road = replace(ROAD, acceleration=np.zeros_like(ROAD.acceleration))
    refusal(mr.motions.stationary_ground, [level_road], match="level")
