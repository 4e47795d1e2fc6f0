"""Units and headings of rigs beyond the plain ones: tonne-force, inch marks, sensors, set points, stamps, commands."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from odd_files import MM, NEWTON, TIME, assert_is_the_test, write_table
from record_files import DT, codes, message
from sentences import Refused

from mrwork.records import ListedTest, guess_tests, read_damper_test
from mrwork.records.rig_table import UNKNOWN

POUND = 4.4482216152605
CONSTANT = np.ones_like(TIME)


@pytest.mark.parametrize(
    ("unit", "newtons"),
    [
        ("lbs", POUND),
        ("lb", POUND),
        ("Lbf", POUND),
        ("kips", 1e3 * POUND),
        ("kip", 1e3 * POUND),
        ("tf", 9806.65),
    ],
)
@pytest.mark.parametrize("heading", ["Load ({})", "Load [{}]", "load_{}"])
def test_pounds_kips_and_tonnes_of_force_are_known(
    tmp_path: Path, heading: str, unit: str, newtons: float
) -> None:
    columns = {"Time (s)": TIME, "Stroke (mm)": MM, heading.format(unit): NEWTON / newtons}
    assert_is_the_test(read_damper_test(write_table(tmp_path / "rig.txt", columns)))


@pytest.mark.parametrize("delimiter", ["\t", ";", ","])
@pytest.mark.parametrize("mark", ['"', "\N{DOUBLE PRIME}"])
def test_the_mark_of_an_inch_is_an_inch_in_a_heading_and_in_a_row_of_units(
    tmp_path: Path, mark: str, delimiter: str
) -> None:
    inches = MM / 25.4
    columns = {"Time (s)": TIME, f"Stroke ({mark})": inches, "Force (N)": NEWTON}
    assert_is_the_test(read_damper_test(write_table(tmp_path / "a.txt", columns, delimiter=delimiter)))
    columns = {"Time": TIME, "Stroke": inches, "Force": NEWTON}
    below = write_table(tmp_path / "b.txt", columns, "s", mark, "N", delimiter=delimiter)
    assert_is_the_test(read_damper_test(below))


@pytest.mark.parametrize(
    "heading", ["I_set (A)", "I_set_A", "I_cmd [A]", "shunt (A)", "Shunt_A", "i coil (A)"]
)
def test_set_points_and_shunts_are_the_current(tmp_path: Path, heading: str) -> None:
    columns = {"t_s": TIME, "LVDT (mm)": MM, "Cell (N)": NEWTON, heading: 0.75 * CONSTANT}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert_is_the_test(test)
    assert (test.current, test.voltage) == (0.75, None)


@pytest.mark.parametrize("heading", ["driver_V", "Driver [V]", "MR driver (V)", "coil_V", "driver coil (V)"])
def test_a_voltage_of_the_driver_is_the_command(tmp_path: Path, heading: str) -> None:
    columns = {"t_s": TIME, "x_mm": MM, "F_N": NEWTON, heading: 2.0 * CONSTANT}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert (test.current, test.voltage) == (None, 2.0)


@pytest.mark.parametrize("heading", ["input (V)", "drive (V)", "damper (V)", "coil temperature (V)"])
def test_a_voltage_that_may_be_of_a_sensor_is_no_command(tmp_path: Path, heading: str) -> None:
    columns = {"t_s": TIME, "x_mm": MM, "F_N": NEWTON, heading: 2.0 * CONSTANT}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert (test.current, test.voltage) == (None, None)


def test_a_sensor_counts_only_where_no_column_has_the_name_of_the_quantity(tmp_path: Path) -> None:
    columns = {
        "t_s": TIME, "LVDT (mm)": 2.0 * MM, "Stroke (mm)": MM, "Cell (kN)": NEWTON, "Force (N)": NEWTON,
        "I_set (A)": CONSTANT, "Current (A)": 0.5 * CONSTANT,
    }  # fmt: skip
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert_is_the_test(test)
    assert test.current == 0.5


def test_a_shunt_in_volts_is_no_command(tmp_path: Path) -> None:
    columns = {"t_s": TIME, "x_mm": MM, "F_N": NEWTON, "Shunt (mV)": 50.0 * CONSTANT}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert (test.current, test.voltage) == (None, None)


STAMPS = {
    "ISO": "%Y-%m-%d %H:%M:%S.%f",
    "ISO with T": "%Y-%m-%dT%H:%M:%S.%f",
    "ISO in UTC": "%Y-%m-%dT%H:%M:%S.%fZ",
    "ISO with an offset": "%Y-%m-%dT%H:%M:%S.%f+02:00",
    "slashes": "%Y/%m/%d %H:%M:%S.%f",
    "German": "%d.%m.%Y %H:%M:%S.%f",
    "a comma": "%d.%m.%Y %H:%M:%S,%f",
    "the clock alone": "%H:%M:%S.%f",
}
# The first day ends within the record.
BEGIN = datetime(2024, 2, 29, 23, 59, 59)


def stamps(form: str, times: Sequence[float]) -> list[str]:
    return [(BEGIN + timedelta(seconds=float(each))).strftime(form) for each in times]


@pytest.mark.parametrize("form", STAMPS)
@pytest.mark.parametrize("heading", ["Timestamp", "Time", "Date/Time", "Zeit", "Recorded at"])
@pytest.mark.parametrize("delimiter", ["\t", ";"])
def test_stamps_are_seconds_from_the_first(tmp_path: Path, delimiter: str, heading: str, form: str) -> None:
    columns = {heading: stamps(STAMPS[form], TIME), "Stroke (mm)": MM, "Force (N)": NEWTON}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns, delimiter=delimiter))
    assert_is_the_test(test)
    assert test.start_time == 0.0
    assert codes(test) == ["velocity_derived"]


def test_a_column_of_times_in_seconds_goes_before_stamps(tmp_path: Path) -> None:
    columns = {"Clock": stamps("%H:%M:%S", TIME), "Time (s)": TIME, "x_mm": MM, "F_N": NEWTON}
    assert_is_the_test(read_damper_test(write_table(tmp_path / "rig.txt", columns)))


def test_uneven_stamps_are_told_as_any_uneven_times(tmp_path: Path) -> None:
    uneven = TIME + 1e-3 * np.sin(np.arange(TIME.size) ** 2)
    columns = {"Timestamp": stamps(STAMPS["ISO"], uneven), "x_mm": MM, "F_N": NEWTON}
    assert "resampled" in codes(read_damper_test(write_table(tmp_path / "rig.txt", columns)))


def test_wrong_stamps_are_refused_by_their_line(tmp_path: Path, refused: Refused) -> None:
    for change in (
        lambda each: [*each[:200], each[199], *each[201:]],
        lambda each: [*each[:200], each[100], *each[201:]],
        lambda each: [*each[:200], "later", *each[201:]],
        lambda each: [*each[:200], "", *each[201:]],
    ):
        assert callable(change)
        columns = {"Timestamp": change(stamps(STAMPS["ISO"], TIME)), "x_mm": MM, "F_N": NEWTON}
        refused(read_damper_test, write_table(tmp_path / "rig.txt", columns))


def test_two_columns_of_stamps_are_asked_for(tmp_path: Path, refused: Refused) -> None:
    columns = {
        "begin": stamps(STAMPS["ISO"], TIME),
        "end": stamps(STAMPS["ISO"], TIME + DT),
        "x_mm": MM,
        "F_N": NEWTON,
    }
    path = write_table(tmp_path / "rig.txt", columns)
    refused(read_damper_test, path)
    assert_is_the_test(read_damper_test(path, columns={"time": "end:s"}))


MOTION = {"t_s": TIME, "x_mm": MM, "F_N": NEWTON}


def write(tmp_path: Path, name: str, heading: str, value: float) -> Path:
    return write_table(tmp_path / name, {**MOTION, heading: np.full_like(TIME, value)})


def guess(path: Path) -> ListedTest:
    (row,) = guess_tests([path])
    return row


@pytest.mark.parametrize("heading", ["Current (A)", "I_set (A)", "Coil [A]", "shunt_A", "Command (A)"])
@pytest.mark.parametrize("name", ["test_0A.lvm", "10mm2Hz0A.lvm", "sine 0 A.txt"])
def test_a_column_goes_before_the_name(tmp_path: Path, name: str, heading: str) -> None:
    path = write(tmp_path, name, heading, 2.0)
    test = read_damper_test(path)
    assert test.current == 2.0
    assert guess(path).columns["command"] == f"{heading}:A"
    if name == "10mm2Hz0A.lvm":
        assert "says a current of 0 A, the record 2 A" in message(test, "name_disagrees")


def test_a_column_of_volts_goes_before_amperes_in_the_name(tmp_path: Path) -> None:
    test = read_damper_test(write(tmp_path, "10mm2Hz0A.lvm", "Command (V)", 2.0))
    assert (test.current, test.voltage) == (None, 2.0)
    assert message(test, "name_not_used") == "the command is 2 V; the 0 A of the file name are not used"


def test_a_stated_command_goes_before_the_name(tmp_path: Path) -> None:
    path = write_table(tmp_path / "10mm2Hz0A.lvm", MOTION)
    test = read_damper_test(path, columns={"command": "2 V"})
    assert (test.current, test.voltage) == (None, 2.0)
    assert "name_not_used" in codes(test)
    assert read_damper_test(path).current == 0.0


def test_no_command_is_guessed_beside_a_column_of_one_without_its_unit(tmp_path: Path) -> None:
    path = write(tmp_path, "10mm2Hz0A.lvm", "I_set", 2.0)
    test = read_damper_test(path)
    assert test.commands == ()
    assert "give one, as in --column command=I_set:A or --column 'command=0 A'" in message(
        test, "command_unclear"
    )
    row = guess(write(tmp_path, "test_0A.lvm", "Current", 2.0))
    assert row.columns["command"] == UNKNOWN
    assert row.doubt == "'Current' may be the command and does not say its unit; give it as Current:A"


def test_no_command_is_guessed_beside_two_columns_of_it(tmp_path: Path) -> None:
    both = {**MOTION, "Coil current (A)": 2.0 + 0 * TIME, "Damper current (A)": 1.0 + 0 * TIME}
    row = guess(write_table(tmp_path / "test_0A.lvm", both))
    assert row.columns["command"] == UNKNOWN
    assert row.doubt.startswith(
        "columns 'Coil current (A)' and 'Damper current (A)' both look like the current"
    )


def test_a_motor_is_no_command(tmp_path: Path) -> None:
    test = read_damper_test(write(tmp_path, "10mm2Hz0x5A.txt", "Motor current (A)", 12.0))
    assert test.current == 0.5
    assert message(test, "not_used") == "not used: column 'Motor current (A)'"
