"""Groups of dampers, each of a model with parameters, laws and a driver of its own, are simulated in one loop."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from loop_samples import devices, five_storeys, friction, law_with_gains, plant_with, rd1005, sweep
from refusals import refusal
from scipy.integrate import solve_ivp

import mrwork as mr
from mrwork import Device
from mrwork.buildings.groups import device_groups
from mrwork.dampers.parameters import DRIVER_RATES, Lag

PLAIN = mr.damper("bingham")
STOREYS = five_storeys().storeys
# Coefficients of each law of the yield force, and laws and numbers that are those of all groups.
LAWS: Mapping[str, tuple[float, ...]] = {
    "constant": (400.0,),
    "linear": (20.0, 300.0),
    "quadratic": (20.0, 350.0, -40.0),
    "cubic": (20.0, 350.0, -40.0, 5.0),
    "exponential": (600.0, -500.0, -1.0),
    "log_quadratic:0,1,2": (20.0, 300.0, 500.0),
    "log_quadratic:0,0.4,2.5": (30.0, 150.0, 600.0),
    "linear:0,2": (20.0, 640.0),
    "quadratic:0,1,2": (20.0, 300.0, 500.0),
    "quadratic:0.5,1,1.5": (170.0, 300.0, 400.0),
    "straight:0,0.4,2.5": (30.0, 150.0, 600.0),
    "straight_log:0,0.4,2.5": (30.0, 150.0, 600.0),
    "monotone:0,0.4,2.5": (30.0, 150.0, 600.0),
    "exponential:0,2": (20.0, 500.0, 0.8),
    "tanh:0.4,2": (150.0, 500.0, 0.8),
}


def group(law: str, *, storey: int = 0, largest: float = 1.5, unit: str = "A", lag: Lag = "none") -> Device:
    """A damper whose yield force follows the command by a law, and its dashpot by a straight line."""
    spec = PLAIN.with_current_laws({"f_c": law, "c0": "linear"}, unit=unit, lag=lag)
    theta = [*LAWS[law], 0.02, 200.0, 500.0, 0.0, *[190.0, 60.0][: spec.n_rates]]
    row = five_storeys().storeys[storey]
    return Device(name=law, spec=spec, theta=theta, row=row, largest_command=largest)


def run(loop: Sequence[Device]) -> mr.Responses:
    law = law_with_gains("clipped_optimal", plant_with(list(loop)))
    return mr.simulate_loop(five_storeys(), loop, law, [sweep()], histories=True)


def assert_same_runs(one: mr.Responses, other: mr.Responses, rtol: float) -> None:
    # The error of the balance of energies is rounding.
    for name in one.numbers.keys() - {"energy_error"}:
        numbers = one.numbers[name]
        np.testing.assert_allclose(other.numbers[name], numbers, rtol=rtol, atol=1e-9 * rtol, err_msg=name)


@pytest.mark.parametrize("lag", DRIVER_RATES)
def test_a_group_by_another_law_has_the_forces_of_its_curve(lag: Lag) -> None:
    # 20 + 300 u of the yield force, by its coefficients, by values, and as a cubic.
    straight = group("linear", lag=lag), replace(group("linear", lag=lag), row=STOREYS[1])
    others = {
        "log_linear:0,1": (20.0, 320.0),
        "linear:0,2": (20.0, 620.0),
        "straight:0,0.5,2": (20.0, 170.0, 620.0),
        "monotone:0,0.5,2": (20.0, 170.0, 620.0),
        "cubic": (20.0, 300.0, 0.0, 0.0),
    }
    for law, coefficients in others.items():
        spec = PLAIN.with_current_laws({"f_c": law, "c0": "linear"}, unit="A", lag=lag)
        theta = [*coefficients, *np.asarray(straight[1].theta)[2:]]
        if law == "log_linear:0,1":
            theta[:2] = [20.0, 20.0]
            same = replace(straight[1], theta=[20.0, 0.0, *np.asarray(straight[1].theta)[2:]])
        else:
            same = straight[1]
        mixed = run([straight[0], replace(same, spec=spec, theta=theta)])
        assert_same_runs(run([straight[0], same]), mixed, rtol=1e-9)


def test_the_order_of_groups_changes_nothing() -> None:
    one, other, third = bingham_and_dahl()[0], bingham_and_dahl()[1], group("exponential", storey=2)
    found = run([one, other, third])
    for order in ([2, 0, 1], [1, 2, 0]):
        turned = run([[one, other, third][place] for place in order])
        np.testing.assert_allclose(turned.peak_drift, found.peak_drift, rtol=1e-12)
        np.testing.assert_allclose(turned.peak_force, found.peak_force[..., order], rtol=1e-12)


def test_neighbours_of_one_model_are_a_group() -> None:
    first, second = devices(rd1005())
    third = bingham_and_dahl()[0]
    assert device_groups([first, second, third, first]) == [[0, 1], [2], [3]]


def bingham_and_dahl() -> tuple[Device, Device]:
    """Two models across the first two storeys, each with a lag of its own."""
    spec = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A", lag="one_rate")
    theta = [50.0, 700.0, 2000.0, 0.0, 60.0]
    dahl = Device(name="dahl", spec=spec, theta=theta, row=STOREYS[1], largest_command=1.0)
    return group("quadratic", lag="one_rate"), dahl


def test_two_models_in_one_frame_are_those_of_scipy() -> None:
    bingham, dahl = bingham_and_dahl()
    frame, time = five_storeys(), np.arange(0.0, 2.0, 0.01)
    motion = mr.GroundMotion(name="sweep", dt=0.01, acceleration=3.0 * np.sin(12.0 * time + 3.0 * time**2))
    law = mr.ControlLaw(name="passive", gains={"command": [0.8, 0.6]})
    found = mr.simulate_loop(frame, [bingham, dahl], law, [motion], histories=True, step_factor=8)
    n, rows = frame.n_coordinates, np.array([bingham.row, dahl.row])
    inverse = np.linalg.inv(frame.mass)
    # Of a passive law, the current follows the command from zero.
    first, second = (np.asarray(each.theta, dtype=float) for each in (bingham, dahl))

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        q, v, z, (one, two) = y[:n], y[n : 2 * n], y[2 * n], y[2 * n + 1 :]
        rate = rows @ v
        f_c = first[0] + first[1] * one + first[2] * one**2
        c0 = first[4] + first[5] * one
        force = [
            f_c * np.tanh(rate[0] / first[3]) + c0 * rate[0] + first[6],
            (second[0] + second[1] * two) * z + second[3],
        ]
        loop = second[2] * (rate[1] - np.abs(rate[1]) * z)
        ground = np.interp(t, time, motion.acceleration)
        push = -frame.damping @ v - frame.stiffness @ q - rows.T @ np.array(force)
        accelerations = inverse @ push - frame.influence * ground
        lags = [-first[-1] * (one - 0.8), -second[-1] * (two - 0.6)]
        return np.array([*v, *accelerations, loop, *lags])

    start = np.zeros(2 * n + 3)
    start[-2:] = 0.8, 0.6
    solved = solve_ivp(rates, (0.0, time[-1]), start, max_step=5e-4, rtol=1e-9, atol=1e-12, dense_output=True)
    history = found.histories[0]
    expected = solved.sol(history.time)[:n].T @ frame.floors.T
    largest = np.abs(history.displacement).max()
    np.testing.assert_allclose(history.displacement, expected, rtol=0.0, atol=2e-6 * largest)


def test_bouc_wen_and_maxwell_in_one_frame_are_those_of_opensees() -> None:
    try:
        ops: Any = import_module("openseespy.opensees")
    except (ImportError, RuntimeError):
        pytest.skip("openseespy is not installed, the extra `opensees`, or lacks a library")
    masses, stiffnesses, theta = (
        [50e3] * 3,
        [60e6, 50e6, 40e6],
        np.array([1e6, 0, 0, 2.5e8, 1.25e5, 1.25e5, 1, 2]),
    )
    frame = mr.buildings.shear_building(name="frame", masses=masses, stiffnesses=stiffnesses)
    frame = mr.buildings.with_rayleigh_damping(frame, ratios=(0.02, 0.02))
    # A spring of 30 MN/m in series with a dashpot of 1.5 MN s/m.
    spring, tau = 3e7, 0.05
    loop = [
        Device(name="lower", spec=mr.damper("bouc_wen"), theta=theta, row=frame.storeys[0]),
        Device(name="upper", spec=mr.damper("maxwell"), theta=[spring, tau, 0.0, 0.0], row=frame.storeys[2]),
    ]
    time = np.arange(0.0, 3.0, 0.005)
    motion = mr.GroundMotion(name="sweep", dt=0.005, acceleration=4.0 * np.sin(8.0 * time + 3.0 * time**2))
    law = mr.ControlLaw(name="passive", gains={"command": [0.0, 0.0]})
    found = mr.simulate_loop(frame, loop, law, [motion], histories=True)
    assert found.energy_error[0] < 1e-7
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    ops.node(0, 0.0)
    ops.fix(0, 1)
    for floor, (mass, stiffness) in enumerate(zip(masses, stiffnesses, strict=True), start=1):
        ops.node(floor, 0.0, "-mass", mass)
        ops.uniaxialMaterial("Elastic", floor, stiffness)
        ops.element("zeroLength", floor, floor - 1, floor, "-mat", floor, "-dir", 1, "-doRayleigh", 1)
    material, dashpot = mr.dampers.opensees_from_bouc_wen(theta)
    m = material
    ops.uniaxialMaterial("BoucWen", 10, m.alpha, m.ko, m.n, m.gamma, m.beta, m.Ao, 0.0, 0.0, 0.0, 1e-14, 100)
    ops.uniaxialMaterial("Elastic", 11, 0.0, dashpot)
    ops.element("zeroLength", 10, 0, 1, "-mat", 10, 11, "-dir", 1, 1)
    # Between spring and dashpot stands a node.
    ops.node(4, 0.0)
    ops.uniaxialMaterial("Elastic", 12, spring)
    ops.uniaxialMaterial("Elastic", 13, 0.0, spring * tau)
    ops.element("zeroLength", 12, 2, 4, "-mat", 12, "-dir", 1)
    ops.element("zeroLength", 13, 4, 3, "-mat", 13, "-dir", 1)
    a1 = frame.damping[0, 1] / frame.stiffness[0, 1]
    ops.rayleigh((frame.damping[0, 0] - a1 * frame.stiffness[0, 0]) / masses[0], 0.0, a1, 0.0)
    ops.timeSeries("Path", 1, "-dt", motion.dt, "-values", *motion.acceleration.tolist())
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormDispIncr", 1e-12, 50)
    ops.algorithm("Newton")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    theirs = np.zeros((int(motion.duration / 0.01) + 1, 3))
    for sample in range(1, len(theirs)):
        assert ops.analyze(500, 2e-5) == 0
        theirs[sample] = [ops.nodeDisp(floor, 1) for floor in (1, 2, 3)]
    every = round(0.01 / (found.histories[0].time[1] - found.histories[0].time[0]))
    ours = found.histories[0].displacement[::every]
    for floor in range(3):
        away = np.abs(ours[: len(theirs), floor] - theirs[: len(ours), floor]).max()
        assert away <= 2e-4 * np.abs(theirs[:, floor]).max()


def held_and_constant(command: float = 0.6) -> tuple[Device, Device]:
    """A damper that holds a command, and a passive one of the same force."""
    _, dahl = bingham_and_dahl()
    k_w, slope, *others = np.asarray(dahl.theta)[:-1].tolist()
    passive = replace(
        dahl, spec=mr.damper("dahl"), theta=[k_w + slope * command, *others], largest_command=1.0
    )
    return replace(dahl, command=command), passive


@pytest.mark.parametrize("name", ["clipped_optimal", "lyapunov", "passive", "predictive_rollout"])
def test_what_holds_a_command_is_the_passive_damper_of_its_force(name: str) -> None:
    (mr_damper,) = devices(rd1005())[:1]
    held, passive = held_and_constant()
    problem = mr.control.DesignProblem(
        building=five_storeys(), devices=[mr_damper], beside=[held], sample_time=1e-3, motions=[sweep()]
    )
    settings = {
        "passive": {"command": 0.7},
        "predictive_rollout": {"base": 0.5, "drift": 0.01, "acceleration": 5.0},
    }
    if name in ("clipped_optimal", "lyapunov"):
        law = law_with_gains(name, plant_with([mr_damper]))
    else:
        law = mr.control.design_law(name, problem, mr.control.settings_of(name, settings[name]))
    found = mr.simulate_loop(five_storeys(), [mr_damper, held], law, [sweep()], histories=True)
    if law.model is not None:
        law = replace(law, model=replace(law.model, devices=(mr_damper, passive)))
    other = mr.simulate_loop(five_storeys(), [mr_damper, passive], law, [sweep()], histories=True)
    for quantity in ("peak_drift", "peak_acceleration", "rms_drift", "peak_force", "device_energy"):
        np.testing.assert_allclose(found.numbers[quantity], other.numbers[quantity], rtol=1e-9)
    command = found.histories[0].command
    assert (command[:, 1] == 0.6).all()
    assert np.isnan(found.numbers["mean_current"][..., 1]).all()
    assert np.ptp(command[:, 0]) > 0.0 or name == "passive"


def test_an_observer_takes_the_forces_of_all_dampers() -> None:
    (mr_damper,) = devices(rd1005())[:1]
    law = law_with_gains("clipped_optimal", plant_with([mr_damper]))
    hardware = mr.Hardware(feedback="observer")
    runs = [
        mr.simulate_loop(five_storeys(), [mr_damper, other], law, [sweep()], hardware)
        for other in held_and_constant()
    ]
    np.testing.assert_allclose(runs[0].peak_drift, runs[1].peak_drift, rtol=1e-9)


def test_what_cannot_stand_side_by_side_is_refused() -> None:
    building, law = five_storeys(), mr.ControlLaw(name="passive", gains={"command": [1.0]})
    passive = replace(group("linear"), name="plain", spec=PLAIN, theta=[400.0, 0.02, 200.0, 0.0])
    held, _ = held_and_constant()
    for beside in (passive, held):
        loop = [beside, replace(group("linear"), row=building.storeys[1])]
        refusal(mr.simulate_loop, building, loop, law, [sweep()], match="first")
    refusal(replace, held, command=1.5, match="1 at most")
    refusal(replace, passive, command=0.5, match="takes no command")


BANG_BANG = mr.ControlLaw(name="decentralised_bang_bang", gains={})


def assert_limited(loop: Sequence[Device], of_devices: Mapping[float, Sequence[float]]) -> None:
    """Candidates of these largest commands, each with those of its devices, are such devices alone."""
    many = mr.simulate_loop(five_storeys(), loop, BANG_BANG, [sweep()], largest_commands=[*of_devices])
    for candidate, largest in enumerate(of_devices.values()):
        limited = [replace(each, largest_command=most) for each, most in zip(loop, largest, strict=True)]
        alone = mr.simulate_loop(five_storeys(), limited, BANG_BANG, [sweep()])
        np.testing.assert_allclose(many.peak_drift[candidate], alone.peak_drift[0], rtol=1e-9)
        np.testing.assert_allclose(many.peak_current[candidate], alone.peak_current[0], rtol=1e-9)


def test_largest_commands_are_shares_where_dampers_follow_currents_and_voltages() -> None:
    loop = [group("linear"), group("quadratic", storey=1, largest=0.8, unit="V")]
    assert_limited(loop, {0.5: (0.75, 0.4), 1.0: (1.5, 0.8)})
    inputs = five_storeys(), loop, BANG_BANG, [sweep()]
    for largest in (1.5, 0.0):
        refusal(mr.simulate_loop, *inputs, largest_commands=[largest], match="largest_commands")
    refusal(mr.simulate_loop, *inputs, mr.Hardware(command_rate=10.0), match="command_rate")


def test_a_device_gets_no_more_than_its_own_largest_command() -> None:
    small, large = devices(friction())
    loop = [replace(small, largest_command=0.5), replace(large, largest_command=1.5)]
    assert_limited(loop, {0.25: (0.25, 0.25), 1.0: (0.5, 1.0), 1.5: (0.5, 1.5)})
