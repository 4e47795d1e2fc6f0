"""Ideal actuators in a study: without a damper, saturated in newtons, commanded by `active` or a law in Python."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refusal
from scipy.linalg import solve_continuous_are

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.control.linear.plant import hold_input

FRAME = mr.buildings.shear_building(
    name="three storeys", masses=[1e5] * 3, stiffnesses=[1e8] * 3, storey_damping=[3e5] * 3
)
MOTION = mr.synthetic_motion(rng=1, duration=4.0, peak=3.0, dt=1e-3)
LQR: dict[str, Any] = {"law": "active", "settings": {"drifts": 1.0, "control_weight": 1e-14}}
ACTUATOR: dict[str, Any] = {"storey": 1, "actuator": True}


def study(laws: Any, *dampers: Any, **more: Any) -> mr.Study:
    more = {"motions": [MOTION], **more}
    return mr.study_of(building=FRAME, dampers=dampers or [ACTUATOR], laws=laws, **more)


def peaks(laws: Any, *dampers: Any, **more: Any) -> Floats:
    """Peak force of the actuators of each law [N], shape (n_laws, n_devices)."""
    results = mr.run_study(study(laws, *dampers, **more), threads=1)
    rows = [number for number, row in enumerate(results.rows) if row.kind == "actuator"]
    return results.quantities.peak_force[rows, 0, 0]


def by_hand(gain: Floats, pushed: Floats, most: float) -> tuple[float, float]:
    """Peak force and roof displacement with `u = -K x` that pushes, held for 1 ms, at most `most` [N]."""
    A, _, E = FRAME.state_matrices(FRAME.storeys[:1])
    B = np.vstack([np.zeros((3, 1)), np.linalg.solve(FRAME.mass, pushed)])
    # The ground is a line between samples.
    ramp = np.block(
        [[A, E[:, None], np.zeros((6, 1))], [np.zeros((1, 7)), np.ones((1, 1))], [np.zeros((1, 8))]]
    )
    transition, push = hold_input(ramp, np.vstack([B, np.zeros((2, 1))]), 1e-3)
    slopes = np.append(np.diff(MOTION.acceleration), 0.0) / 1e-3
    x, force, roof = np.zeros(6), 0.0, 0.0
    for ground, slope in zip(MOTION.acceleration, slopes, strict=True):
        u = np.clip(-gain @ x, -most, most)
        force, roof = max(force, abs(u[0])), max(roof, abs(x[2]))
        x = (transition @ np.concatenate([x, [ground, slope]]) + push @ u)[:6]
    return force, roof


@pytest.mark.parametrize("most", [np.inf, 30e3])
def test_the_regulator_of_a_frame_is_that_of_the_textbook_also_saturated(most: float) -> None:
    A, _, _ = FRAME.state_matrices(FRAME.storeys[:1])
    pushed = -FRAME.storeys[:1].T
    B = np.vstack([np.zeros((3, 1)), np.linalg.solve(FRAME.mass, pushed)])
    Q = np.zeros((6, 6))
    Q[:3, :3] = FRAME.storeys.T @ FRAME.storeys
    gain = 1e14 * B.T @ solve_continuous_are(A, B, Q, [[1e-14]])
    actuator = ACTUATOR if np.isinf(most) else {**ACTUATOR, "largest_force": f"{most / 1e3} kN"}
    results = mr.run_study(study([LQR], actuator), threads=1)
    assert [row.kind for row in results.rows] == ["uncontrolled", "actuator"]
    found = results.quantities.peak_force[1, 0, 0, 0], results.quantities.peak_displacement[1, 0, 0, 2]
    np.testing.assert_allclose(found, by_hand(gain, pushed, most), rtol=2e-3)
    assert not [remark for remark in results.remarks if "damper" in remark.code]


def test_scores_of_actuators_alone_are_over_the_building_without_them() -> None:
    results = mr.run_study(study([LQR]), threads=1)
    assert [row.kind for row in results.rows] == ["uncontrolled", "actuator"]
    ratios = results.ratios(1, 0, "uncontrolled")
    expected = np.mean(
        [ratios[name] for name in ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")]
    )
    assert results.score(1).mean == pytest.approx(expected, rel=1e-12)
    assert results.score(0).mean == 1.0 > results.score(1).mean


def test_the_command_of_an_actuator_is_counted_in_newtons() -> None:
    dashpot = 2e5
    made = study([lambda sample, memory: dashpot * sample.rate], hardware={"sample_time": 1e-3})
    results = mr.run_study(made, threads=1)
    (row,) = [number for number, row in enumerate(results.rows) if row.kind == "actuator"]
    of_run = results.quantities.at(row, 0)
    # The force is the command, held over each sample.
    assert of_run["peak_current"][0] == of_run["peak_force"][0] > 1e3
    rates = mr.simulate_loop(
        FRAME,
        [mr.buildings.ideal_actuator(name="jack", row=FRAME.storeys[0])],
        mr.closed_loop.UserLaw(name="dashpot", command=lambda sample, memory: dashpot * sample.rate),
        [MOTION],
        mr.Hardware(sample_time=1e-3),
        histories=True,
    )
    assert rates.histories is not None
    sent = rates.histories[0].force[:-1, 0]
    assert of_run["rms_current"][0] == pytest.approx(np.sqrt(np.mean(sent**2)), rel=1e-9)
    assert of_run["command_travel"][0] == pytest.approx(np.abs(np.diff(sent)).sum() / 4.0, rel=2e-2)
    text = str(rates)
    assert "peak command" in text
    assert "A or V" not in text


def test_limits_are_in_newtons_for_actuators_and_in_the_place_of_dampers() -> None:
    damper = {"storey": 1, "preset": "kwok2006"}
    laws = [
        {**LQR, "label": "free"},
        {**LQR, "label": "30 kN", "largest_command": "30 kN"},
        {**LQR, "label": "slow", "command_slope": "1e5 N/s"},
    ]
    own, replaced = peaks(laws), peaks(laws, damper, references="none")
    np.testing.assert_array_equal(own, replaced)
    assert own[0, 0] > 60e3
    assert own[1, 0] == 30e3
    assert own[2, 0] < 0.5 * own[0, 0]
    np.testing.assert_array_equal(peaks([LQR], {**ACTUATOR, "largest_force": "30 kN"}), peaks([laws[1]]))


def test_a_law_has_the_largest_force_of_actuators_in_a_loop_of_its_own() -> None:
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    row, gain = FRAME.storeys[0], 1e6 * np.array([[0.0, 0.0, 0.0, 2.0, 0.0, 0.0]])
    damper = mr.Device(name="d", spec=preset.spec, theta=preset.theta, row=row, largest_command=1.88)
    for device in (damper, mr.buildings.ideal_actuator(name="a", row=row)):
        law = mr.ControlLaw(name="active", gains={"gain": gain}, largest_force=2e4)
        assert mr.simulate_loop(FRAME, [device], law, [MOTION]).peak_force[0, 0] == 2e4
    refusal(mr.ControlLaw, name="maximum_energy_dissipation", largest_force=1e3, match="commands no forces")


def test_the_rate_of_drivers_is_that_of_dampers_and_of_own_actuators_in_newtons() -> None:
    rate = {"command_rate": 1e5}
    damper = {"storey": 1, "preset": "kwok2006"}
    free, limited = peaks([LQR]), peaks([LQR], hardware=rate)
    assert limited[0, 0] < 0.5 * free[0, 0]
    np.testing.assert_array_equal(peaks([LQR], damper, references="none", hardware=rate), free)


def pid(sample: mr.closed_loop.LoopSample, memory: Floats) -> Floats:
    """A PID of the stroke: forces in newtons."""
    memory += 1e-3 * sample.deformation
    assert sample.largest[0] == 60e3
    return 1e6 * sample.deformation + 4e6 * sample.rate + 1e5 * memory


def test_a_pid_in_python_sends_forces_that_saturate() -> None:
    law = {"law": pid, "label": "PID", "user": {"memory": 1}}
    results = mr.run_study(study([law], {**ACTUATOR, "largest_force": 60e3}), threads=1)
    assert [row.kind for row in results.rows] == ["uncontrolled", "actuator"]
    assert results.quantities.peak_force[1, 0, 0, 0] == 60e3
    assert results.quantities.peak_current[1, 0, 0, 0] == 60e3
    drifts = results.quantities.rms_drift[:, 0, 0].max(axis=1)
    assert drifts[1] < 0.95 * drifts[0]


def test_passive_dampers_may_stand_beside_actuators() -> None:
    held = {"storey": 2, "preset": "kwok2006", "command": 1.0, "count": 50}
    results = mr.run_study(study([LQR], ACTUATOR, held), threads=1)
    assert [row.kind for row in results.rows] == ["uncontrolled", "passive_off", "actuator"]
    forces = results.quantities.peak_force[1:, 0, 0]
    assert (forces[0] > 0.0).tolist() == [False, True]
    assert (forces[1] > 0.0).all()


def test_a_file_with_an_actuator_is_read_again(tmp_path: Path) -> None:
    made = study([{**LQR, "largest_command": "30 kN"}], {**ACTUATOR, "largest_force": 2e5})
    again = mr.read_study(made.to_toml(tmp_path / "study.toml"))
    assert again.devices[0].largest_command == 2e5
    assert again.devices[0].is_actuator
    assert dict(again.facts)["Actuator in storey 1"] == "Ideal actuator, up to 200 kN"
    np.testing.assert_array_equal(
        mr.run_study(again, threads=1).quantities.peak_force,
        mr.run_study(made, threads=1).quantities.peak_force,
    )


@pytest.mark.parametrize(
    ("laws", "dampers", "words"),
    [
        (["clipped_optimal"], [ACTUATOR], "is a force; give the law active"),
        (["best_passive"], [ACTUATOR], "is a force; give the law active"),
        (["passive_off"], [ACTUATOR], "is a force; give the law active"),
        (["active"], [ACTUATOR], "has no control_weight"),
        ([LQR], [{**ACTUATOR, "preset": "kwok2006"}], "preset is of a damper"),
        ([LQR], [{**ACTUATOR, "count": 2}], "count is of a damper"),
        ([LQR], [{"storey": 1, "model": "ideal_actuator"}], "actuator = true in place of the model"),
        ([LQR], [{"storey": 1, "preset": "kwok2006", "largest_force": 1e3}], "actuator = true"),
        ([LQR], [ACTUATOR, {"storey": 2, "preset": "kwok2006"}], "a command to hold"),
        ([{**LQR, "largest_command": "0.1 A"}], [ACTUATOR], r"number \[N\] is expected"),
        ([{**LQR, "largest_command": "0.1 A"}], [{"storey": 1, "preset": "kwok2006"}], r"\[N\] is expected"),
        ([{**LQR, "largest_command": 1.0}], [{"storey": 1, "preset": "kwok2006"}], "give it with its unit"),
        ([{**LQR, "command_slope": "1 A/s"}], [ACTUATOR], r"\[N/s\] is expected"),
        ([{**LQR, "largest_command": "30 kN"}], [{**ACTUATOR, "largest_force": 1e4}], "give 10000 at most"),
    ],
)
def test_what_is_of_dampers_is_refused_of_actuators(laws: Any, dampers: Any, words: str) -> None:
    refusal(study, laws, *dampers, match=words)


def test_nothing_of_dampers_is_sized_or_tuned_without_dampers() -> None:
    with_limit = study([LQR], tune=[mr.study.TuneTable(laws=("clipped_optimal",))])
    refusal(mr.tune, with_limit, match="no damper that follows a command")
