"""A command that is neither a current nor a voltage keeps the unit of the user: in tests, laws, files and messages."""

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from command_line import mrwork, printed
from numpy.typing import NDArray
from record_files import clean_columns, write_text
from refusals import refusal

import mrwork as mr
from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.dampers.command import levels_of_command
from mrwork.records import DamperTest, guess_tests, read_damper_test
from mrwork.records.damper_test import range_of_test, range_of_tests
from mrwork.records.likeness import RecordedMotion

DT = 2e-3
NOISE_N = 5.0
LEVELS = np.array([0.0, 1.0, 0.4])
SPEC = mr.damper("static_hysteretic")
LAWS = {"c": "log_linear:0,1", "alpha": "log_quadratic:0,0.4,1"}
TRUTH = np.array([1000.0, 2500.0, 500.0, 100.0, 400.0, 800.0, 60.0, 1.5, 1e-4, 20.0])


def recorded(*, rng: int = 0, n_time: int = 1500) -> tuple[NDArray[np.float64], ...]:
    """Time, motion, force, and the share of the largest command, which steps through three levels."""
    time = DT * np.arange(n_time)
    omega = 2.0 * np.pi * (2.0 + 0.4 * rng)
    displacement, velocity = 0.01 * np.sin(omega * time), 0.01 * omega * np.cos(omega * time)
    share = LEVELS[np.random.default_rng([rng, 3]).integers(3, size=200)[(time / 0.3).astype(int)]]
    spec = SPEC.with_current_laws(LAWS)
    loading = mr.Loading(dt=DT, displacement=displacement, velocity=velocity, command=share, command_unit="A")
    force = mr.simulate_force(spec, TRUTH, loading)
    force = force + NOISE_N * np.random.default_rng([rng, 5]).standard_normal(n_time)
    return time, displacement, velocity, force, share


def written(
    folder: Path, heading: str, scale: float, zero: float, *, rng: int = 0, n_time: int = 1500
) -> Path:
    time, displacement, velocity, force, share = recorded(rng=rng, n_time=n_time)
    columns = {"t_s": time, "displacement_mm": 1e3 * displacement, "velocity_mps": velocity, "force_N": force}
    return write_text(folder / f"rig{rng}.csv", {**columns, heading: zero + scale * share})


def test_units_of_commands_are_those_with_a_scale() -> None:
    assert get_args(CommandUnit) == tuple(COMMAND_SCALES)


@pytest.mark.parametrize(
    ("heading", "unit"),
    [
        ("valve_mm", "mm"),
        ("Gap (in)", "in"),
        ("opening_pct", "%"),
        ("setpoint_psi", "psi"),
        ("damper command (lb)", "lb"),
        ("command [deg C]", "degC"),
    ],
)
def test_a_heading_of_a_command_in_another_unit_is_read_without_conversion(
    tmp_path: Path, heading: str, unit: CommandUnit
) -> None:
    test = read_damper_test(written(tmp_path, heading, 50.0, 0.0))
    assert test.command_unit == unit
    assert levels_of_command(np.asarray(test.command)) == (0.0, 20.0, 50.0)
    assert unit in test.command_in_words
    assert (test.current, test.voltage) == (None, None)


@pytest.mark.parametrize("heading", ["Axial Command (mm)", "pressure_bar", "temperature_degC", "damper_mm"])
def test_a_column_that_is_no_command_of_the_damper_is_not_used(tmp_path: Path, heading: str) -> None:
    test = read_damper_test(written(tmp_path, heading, 50.0, 0.0))
    assert test.commands == ()
    assert "not_used" in {remark.code for remark in test.remarks}
    # Unless it is said to be.
    unit = heading.rpartition("_")[2].strip("()") if "_" in heading else "mm"
    assert read_damper_test(test.path, columns={"command": f"{heading}:{unit}"}).command_unit == unit


def test_a_current_is_the_command_where_a_record_has_both(tmp_path: Path) -> None:
    columns = clean_columns()
    columns["current_A"], columns["valve_mm"] = np.full_like(columns["t_s"], 0.5), columns["t_s"]
    test = read_damper_test(write_text(tmp_path / "rig.csv", columns))
    assert test.commands == ((0.5, "A"),)


def test_a_table_of_tests_guesses_a_command_in_another_unit(tmp_path: Path) -> None:
    (row,) = guess_tests([written(tmp_path, "valve_mm", 2.0, 0.0)])
    assert row.columns["command"] == "valve_mm:mm"
    assert row.doubt == ""


@pytest.mark.parametrize(
    ("stated", "command"), [("20 %", (20.0, "%")), ("-15 deg C", (-15.0, "degC")), ("0.8mm", (0.8, "mm"))]
)
def test_a_number_in_another_unit_is_the_command(
    tmp_path: Path, stated: str, command: tuple[float, CommandUnit]
) -> None:
    path = written(tmp_path, "pressure_bar", 50.0, 0.0)
    assert read_damper_test(path, columns={"command": stated}).commands == (command,)


def test_a_negative_opening_is_a_warning_and_a_negative_temperature_is_none(tmp_path: Path) -> None:
    for heading, warned in (("valve_mm", True), ("command (degC)", False)):
        test = read_damper_test(written(tmp_path, heading, 50.0, -20.0))
        assert ("command_negative" in {remark.code for remark in test.remarks}) is warned


def made(unit: CommandUnit, command: float | NDArray[np.float64], *, rng: int = 0) -> DamperTest:
    time, displacement, velocity, force, _ = recorded(rng=rng)
    return mr.test_from_arrays(
        name=f"{unit} {rng}",
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=force,
        command=command,
        command_unit=unit,
    )


@pytest.mark.parametrize("change", [{"command": None}, {"command_unit": None}, {"command_unit": "A"}])
def test_a_command_and_its_unit_come_together(change: dict[str, str | None]) -> None:
    refusal(replace, made("mm", 2.0), **change, match="give both")


def test_parts_resampled_times_and_samples_keep_the_command() -> None:
    share = recorded()[-1]
    test = made("bar", 3.0 * share)
    np.testing.assert_array_equal(test.part(100, 900).command, 3.0 * share[100:900])
    assert RecordedMotion.of(test).levels == {"bar": 3.0}
    time = recorded()[0] + 0.2 * DT * np.random.default_rng(1).uniform(-1.0, 1.0, share.size)
    jittered = mr.test_from_arrays(
        name="jitter",
        time=time,
        displacement=test.displacement,
        force=test.force,
        command=share,
        command_unit="bar",
    )
    assert set(np.unique(np.asarray(jittered.command))) == set(LEVELS)


def test_a_colder_test_than_any_is_outside_of_the_tested_range() -> None:
    tested = range_of_tests([made("degC", -10.0), made("degC", 30.0, rng=1)])
    assert tested.command == (-10.0, 30.0)
    inside, colder = (range_of_test(made("degC", at), "degC") for at in (-10.2, -14.0))
    assert tested.exceeded_by(inside) == ()
    (found,) = tested.exceeded_by(colder)
    assert "command -14 degC" in found.in_words


def test_tests_in_two_units_are_refused() -> None:
    spec = SPEC.with_current_laws({"c": "linear"}, unit="mm")
    tests = [made("mm", 2.0), made("%", 20.0, rng=1)]
    refusal(mr.identify, spec, tests, match="takes its command in mm, the test has 20 %")


@pytest.mark.usefixtures("pages")
def test_the_command_line_fits_predicts_and_reports_in_the_unit_of_the_user(tmp_path: Path) -> None:
    """In degrees Celsius, which have no zero where a command ends."""
    first, second = (written(tmp_path, "command (degC)", 40.0, -10.0, rng=rng, n_time=3000) for rng in (0, 1))
    checked = json.loads(mrwork("check", first, "--json").stdout)["files"][0]
    assert (checked["command"], checked["command_unit"]) == ({"lowest": -10.0, "highest": 30.0}, "degC")
    out = tmp_path / "run"
    text = printed(
        *("identify", first, "--model", "static_hysteretic", "--quiet", "--json", "--out", out),
        *("--law", "c=log_linear:-10,30", "--law", "alpha=log_quadratic:-10,6,30"),
        *("--fix", "x_s=1e-4", "--fix", "alpha@6degC=400"),
    )
    found = json.loads(text)
    assert found["current_laws"]["unit"] == "degC"
    # A name of a parameter can be given again, as it was in --fix.
    assert found["parameters"]["alpha@6degC"]["value"] == 400.0
    for name, truth in (("c@-10degC", 1000.0), ("c@30degC", 2500.0)):
        estimate = found["parameters"][name]
        assert abs(estimate["value"] - truth) < 5.0 * estimate["standard_error"]
    assert "degC, stepped" in (out / "report.html").read_text()
    loaded = mr.load(out).fit
    assert loaded.spec.command_unit == loaded.tested.command_unit == "degC"
    predicted = json.loads(mrwork("predict", out, second, "--json").stdout)["files"][0]
    assert predicted["rmse_n"] == pytest.approx(NOISE_N, rel=0.15)
    printed("calibrate", out, second, "--json")
