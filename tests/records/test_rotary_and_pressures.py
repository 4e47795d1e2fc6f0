"""Angle and torque, and pressures in the place of a force: what a rotary or hydraulic rig records has a way in."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal

import mrwork as mr
from mrwork.embedded.c_source import Flavour
from mrwork.records import guess_tests
from mrwork.runs.printed import damper_of_fit

TIME = np.arange(0.0, 4.0, 0.002)
ANGLE = 0.8 * np.sin(2.0 * np.pi * TIME)
RATE = 0.8 * 2.0 * np.pi * np.cos(2.0 * np.pi * TIME)


def torque(rate: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(3.0 * np.tanh(rate / 0.2) + 0.5 * rate)


def write(path: Path, heading: str, *columns: NDArray[np.float64]) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=heading, comments="", fmt="%.7f")
    return path


def codes(test: mr.DamperTest) -> set[str]:
    return {remark.code for remark in test.remarks}


@pytest.mark.parametrize(
    ("heading", "angle", "rate", "moment"),
    [
        ("Time (s),Angle (deg),Speed (rpm),Torque (Nm)", 180.0 / np.pi, 30.0 / np.pi, 1.0),
        ("t_s,phi_rad,omega_rad/s,M_N m", 1.0, 1.0, 1.0),
        ("Zeit (s),Drehwinkel (°),Drehzahl (1/min),Drehmoment (Nmm)", 180.0 / np.pi, 30.0 / np.pi, 1e3),
        ("Time (s),Rotation [rev],Rate [deg/s],Torque [lbf-in]", 0.5 / np.pi, 180.0 / np.pi, 1.0 / 0.1129848),
    ],
)
def test_angle_and_torque_are_the_motion_and_the_force(
    tmp_path: Path, heading: str, angle: float, rate: float, moment: float
) -> None:
    path = write(tmp_path / "rotary.csv", heading, TIME, angle * ANGLE, rate * RATE, moment * torque(RATE))
    test = mr.read_damper_test(path)
    np.testing.assert_allclose(test.displacement, ANGLE, atol=1e-5)
    np.testing.assert_allclose(test.force, torque(RATE), atol=1e-4)
    assert "rotary" in codes(test)
    # Sizes of strokes and forces are none of angles and torques.
    assert not codes(test) & {"displacement_unusual", "force_unusual"}
    (row,) = guess_tests([path])
    again = mr.read_damper_test(path, columns={name: row.columns[name] for name in ("displacement", "force")})
    np.testing.assert_array_equal(again.force, test.force)


def test_a_rotary_fit_has_the_parameters_per_radian_and_says_so_on_its_c(tmp_path: Path) -> None:
    path = write(
        tmp_path / "rotary.csv", "Time (s),Angle (deg),Torque (Nm)", TIME, np.degrees(ANGLE), torque(RATE)
    )
    fit = mr.identify("bingham", [mr.read_damper_test(path)])
    values = {estimate.name: estimate.value for estimate in fit.fitted}
    assert [values[name] for name in ("f_c", "v_s", "c0")] == pytest.approx([3.0, 0.2, 0.5], rel=1e-3)
    assert "rotary" in {remark.code for remark in fit.remarks}
    header = "".join(damper_of_fit(fit, "hinge", Flavour(), None).files.values())
    assert "N s/m is N m s/rad" in " ".join(header.replace("*", " ").split())
    linear = mr.test_from_arrays(TIME, 0.01 * np.sin(6.3 * TIME), 100.0 * np.cos(6.3 * TIME))
    refusal(mr.identify, "bingham", [mr.read_damper_test(path), linear], match="angle and torque .* apart")


def test_an_angle_that_is_counted_anew_at_a_turn_is_continued(tmp_path: Path) -> None:
    turning, rate = 3.0 * np.pi * np.sin(0.5 * np.pi * TIME), 1.5 * np.pi**2 * np.cos(0.5 * np.pi * TIME)
    heading = "Time (s),Angle (deg),Torque (Nm)"
    columns = TIME, np.mod(np.degrees(turning), 360.0), torque(rate)
    test = mr.read_damper_test(write(tmp_path / "wrapped.csv", heading, *columns))
    np.testing.assert_allclose(test.displacement, turning, atol=1e-5)
    (said,) = (remark for remark in test.remarks if remark.code == "angle_continued")
    assert said.measured is not None
    assert said.measured.value == np.count_nonzero(np.abs(np.diff(columns[1])) > 180.0)
    first = 2 + int(np.argmax(np.abs(np.diff(columns[1])) > 180.0)) + 1
    assert f"first at line {first}" in said.message
    beyond = mr.read_damper_test(
        write(tmp_path / "beyond.csv", heading, TIME, np.degrees(turning), torque(rate))
    )
    assert "angle_continued" not in codes(beyond)
    np.testing.assert_allclose(beyond.displacement, turning, atol=1e-5)


def test_an_angle_beside_a_force_is_asked_for_its_arm(tmp_path: Path) -> None:
    path = write(
        tmp_path / "arm.csv", "Time (s),Angle (deg),Force (N)", TIME, np.degrees(ANGLE), torque(RATE) / 0.05
    )
    error = refusal(mr.read_damper_test, path, match="is of a rotation, and 'Force")
    typed = str(error).split("--column '")[1].split("'")[0]
    name, _, specification = typed.partition("=")
    test = mr.read_damper_test(path, columns={name: specification})
    np.testing.assert_allclose(test.displacement, 0.05 * ANGLE, atol=1e-6)
    assert "rotary" not in codes(test)
    write(path, "Time (s),Stroke (mm),Torque (Nm)", TIME, 50.0 * ANGLE, torque(RATE))
    test = mr.read_damper_test(path, columns={"force": "Torque (Nm):Nm/0.05m"})
    np.testing.assert_allclose(test.force, torque(RATE) / 0.05, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(
    ("unit", "size", "areas"),
    [
        ("bar", 1e5, "19.6cm2 14.7cm2"),
        ("MPa", 1e6, "1960mm2 1470mm2"),
        ("psi", 6894.757, "3.038in2 2.2785in2"),
    ],
)
def test_two_pressures_are_a_force_with_their_areas(
    tmp_path: Path, unit: str, size: float, areas: str
) -> None:
    speed = 62.8e-3 * np.cos(2.0 * np.pi * TIME)
    force = 3e3 * speed + 200.0 * np.tanh(speed / 4e-3)
    rod = 20e5 - 0.5 * force / 14.7e-4
    cap = (force + 14.7e-4 * rod) / 19.6e-4
    heading = f"Time (s),Stroke (mm),P cap ({unit}),P rod ({unit})"
    path = write(
        tmp_path / "valve.csv", heading, TIME, 10.0 * np.sin(2.0 * np.pi * TIME), cap / size, rod / size
    )
    refusal(
        mr.read_damper_test,
        path,
        match=r"give the areas of pistons in place of 12.5 cm2, as in --column 'force=",
    )
    first, second = areas.split()
    option = f"P cap ({unit}):{unit}*{first}-P rod ({unit}):{unit}*{second}"
    test = mr.read_damper_test(path, columns={"force": option})
    np.testing.assert_allclose(test.force, force, rtol=2e-3, atol=0.5)
    assert "not_used" not in codes(test)
    # A scale without a unit.
    refusal(
        mr.read_damper_test, path, columns={"force": option.replace("cm2", "").replace("mm2", "").replace("in2", "")},
        match="has no unit; give it",
    )  # fmt: skip
