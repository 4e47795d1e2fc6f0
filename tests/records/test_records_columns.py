"""Columns and file names are understood, or refused with the way to state their meaning."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from record_files import clean_columns, codes, message, write_text
from refusals import refusal
from sentences import Refused

from mrwork.files.grid import grid
from mrwork.files.named_columns import TestQuantity, likely_unit
from mrwork.records import read_damper_test
from mrwork.records.columns import parse_column_option
from mrwork.records.command_column import nominal_from_name


def renamed(tmp_path: Path, old: str, *new: str) -> Path:
    """The clean test with one column renamed, or duplicated."""
    columns = clean_columns()
    samples = columns.pop(old)
    return write_text(tmp_path / "rig.csv", {**columns, **dict.fromkeys(new, samples)})


def test_a_force_that_cannot_be_told_is_refused_with_the_remedy(tmp_path: Path, refused: Refused) -> None:
    for name in ("force", "F", "force_stone", "force_mm", "cell 1"):
        refused(read_damper_test, renamed(tmp_path, "force_n", name))


def test_time_displacement_and_force_are_needed(tmp_path: Path, refused: Refused) -> None:
    for missing in ("t_s", "displacement_m", "force_n"):
        refused(read_damper_test, renamed(tmp_path, missing))


def test_a_mapping_goes_before_the_names(tmp_path: Path) -> None:
    path = renamed(tmp_path, "force_n", "force_n", "F:cell 1")
    test = read_damper_test(path, columns={"force": "F:cell 1:kN"})
    np.testing.assert_allclose(test.force, 1e3 * clean_columns()["force_n"], rtol=1e-15)


@pytest.mark.parametrize(
    ("columns", "word"),
    [
        ({"force": "G:N"}, "no column 'G'; the columns are 't_s'"),
        ({"speed": "G:N"}, "'speed' is not a quantity"),
        ({"time": "none"}, "the time cannot be left out"),
    ],
)
def test_a_wrong_mapping_is_refused(tmp_path: Path, columns: dict[str, str], word: str) -> None:
    path = write_text(tmp_path / "rig.csv", clean_columns())
    refusal(read_damper_test, path, columns=columns, match=word)


@pytest.mark.parametrize(
    ("option", "word"),
    [
        ("force", "has no '='"),
        ("torque=F:N", "'torque' is not a quantity"),
        ("force=F:furlong", "'furlong' is no unit of force"),
        ("command=-5A", "from 0 to 1000 A"),
    ],
)
def test_a_wrong_column_option_is_refused(option: str, word: str) -> None:
    refusal(parse_column_option, option, match=word)


def test_v_is_velocity_or_voltage_by_its_unit(tmp_path: Path) -> None:
    columns = clean_columns()
    columns["v_mps"] = columns.pop("velocity_mps")
    columns["v_V"] = np.full_like(columns["t_s"], 2.5)
    test = read_damper_test(write_text(tmp_path / "rig.csv", columns))
    assert test.voltage == 2.5
    assert test.velocity_source == "measured"


@pytest.mark.parametrize(("column", "scale"), [("current_A", 1.0), ("i_mA", 1e3), ("Current [mA]", 1e3)])
def test_the_current_is_the_median_of_its_column(tmp_path: Path, column: str, scale: float) -> None:
    columns = clean_columns()
    rng = np.random.default_rng(5)
    columns[column] = scale * (0.75 + 0.003 * rng.standard_normal(columns["t_s"].size))
    test = read_damper_test(write_text(tmp_path / "rig.csv", columns))
    assert test.current == pytest.approx(0.75, abs=1e-3)
    assert codes(test) == []


@pytest.mark.parametrize(
    ("name", "amplitude", "frequency", "command"),
    [
        ("10mm1Hz0x5A", 0.010, 1.0, (0.5, "A")),
        ("25mm0x25Hz_0.75A", 0.025, 0.25, (0.75, "A")),
        ("2mm_5hz_0a", 0.002, 5.0, (0.0, "A")),
        ("rig3-12.5mm2Hz2x25V", 0.0125, 2.0, (2.25, "V")),
        ("10mm1Hz", 0.010, 1.0, None),
        ("ensaio.A.1", None, None, None),
        ("10mm", None, None, None),
        ("V01_15mm_4Hz_1000mA", 0.015, 4.0, (1.0, "A")),
        ("run3_0x5A", None, None, (0.5, "A")),
        ("1.0A", None, None, (1.0, "A")),
        ("test 2V", None, None, (2.0, "V")),
    ],
)
def test_file_names_give_nominal_values(
    name: str, amplitude: float | None, frequency: float | None, command: tuple[float, str] | None
) -> None:
    nominal = nominal_from_name(name)
    assert (nominal.amplitude, nominal.frequency) == (amplitude, frequency)
    assert nominal.command == command


def test_the_name_gives_the_current_where_no_column_does(tmp_path: Path) -> None:
    test = read_damper_test(write_text(tmp_path / "10mm2Hz0x5A.csv", clean_columns()))
    assert (test.amplitude, test.frequency, test.current) == (0.010, 2.0, 0.5)
    assert codes(test) == []


@pytest.mark.parametrize(("name", "quantity"), [("25mm2Hz0A", "amplitude"), ("10mm3Hz0A", "frequency")])
def test_a_motion_far_from_its_name_is_told(tmp_path: Path, name: str, quantity: str) -> None:
    test = read_damper_test(write_text(tmp_path / f"{name}.csv", clean_columns()))
    assert quantity in message(test, "name_disagrees")


def test_the_amplitude_of_a_name_and_of_check_is_half_the_peak_to_peak(tmp_path: Path) -> None:
    """About 80 mm instead of zero, as a sensor shows it that was not set to zero."""
    columns = clean_columns()
    columns["displacement_m"] = columns["displacement_m"] + 0.08
    path = write_text(tmp_path / "10mm2Hz0A.csv", columns)
    assert codes(read_damper_test(path)) == []
    (facts,) = json.loads(printed("check", path, "--json"))["files"]
    assert (facts["amplitude_m"], facts["peak_displacement_m"]) == pytest.approx((0.010, 0.090), rel=1e-4)


def test_times_in_rounded_decimals_are_those_of_their_grid_and_a_shifted_one_is_not() -> None:
    times = np.round(0.003 + 0.01 * np.arange(200), 4)
    uniform = grid(np.round(times + 2e-5, 4)).uniform
    assert uniform is not None
    np.testing.assert_allclose(uniform, times, atol=1e-4)
    # A second in whole numbers has a coarse digit, and stands more than half a step off.
    times[99] = 1.0
    assert grid(times).uniform is None


def test_what_is_no_motion_and_no_force_is_no_candidate_for_one(tmp_path: Path) -> None:
    columns = clean_columns()
    motion = {name: columns[name] for name in ("t_s", "displacement_m")}
    swaying = 60.0 + np.sin(columns["t_s"])
    # Revolutions a minute are no velocity, whatever their column is called, and do not stand in the way.
    for name in ("Velocidad_RPM", "speed (rpm)"):
        test = read_damper_test(
            write_text(tmp_path / "rig.csv", {**motion, "force_n": columns["force_n"], name: swaying})
        )
        assert test.velocity_source == "derived"
    # A mass and a height are no force.
    file = write_text(tmp_path / "rig.csv", {**motion, "mass": swaying, "height": swaying})
    refusal(read_damper_test, file, match="no column for the force .* --column force=COLUMN:N")
    # Of a column of texts and one of kilonewtons the second is the likely force.
    lines = (
        write_text(tmp_path / "rig.csv", {**motion, "Fh [kN]": columns["force_n"]}).read_text().splitlines()
    )
    lines = [f"{line},{'load_step_name' if not number else 'loading'}" for number, line in enumerate(lines)]
    file.write_text("\n".join(lines))
    refusal(read_damper_test, file, match=r"likely --column 'force=Fh \[kN\]:kN'")
    table = "specimen,mass_kg,height_mm\n" + "\n".join(
        f"S{row},{row + 1.5},{100 + row % 7}" for row in range(12)
    )
    file.write_text(table)
    refusal(read_damper_test, file, match="--column displacement=COLUMN:m .* leave out what is no record")


def test_of_two_columns_with_one_name_none_is_taken_for_the_other(tmp_path: Path) -> None:
    columns = clean_columns()
    rows = np.column_stack(
        [
            columns["t_s"],
            columns["displacement_m"],
            columns["force_n"],
            1.2 * columns["force_n"],
        ]
    )
    path = tmp_path / "twice.csv"
    np.savetxt(path, rows, delimiter=",", header="t_s,displacement_m,force_N,force_N", comments="")
    refusal(read_damper_test, path, match="'3 force_N' and '4 force_N' both look like the force")
    refusal(read_damper_test, path, columns={"force": "force_N:N"}, match="may be '3 force_N', '4 force_N'")
    forces = [read_damper_test(path, columns={"force": column}).force for column in ("3:N", "4", "4 force_N")]
    np.testing.assert_allclose(forces[1], 1.2 * forces[0])
    np.testing.assert_array_equal(forces[1], forces[2])


@pytest.mark.parametrize(
    ("quantity", "heading", "unit"),
    [
        ("force", "Load (tonf)", "tf"), ("velocity", "velocity_kmh", "km/h"), ("velocity", "v (kph)", "m/s"),
        ("force", "Load (mN)", "N"), ("displacement", "main", "m"), ("force", "Load (kN)", "kN"),
    ],
)  # fmt: skip
def test_a_unit_that_is_written_longer_is_suggested(quantity: TestQuantity, heading: str, unit: str) -> None:
    assert likely_unit(quantity, heading, None) == unit
