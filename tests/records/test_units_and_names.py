"""Units and headings of rigs beyond the plain ones: tonne-force, inch marks, sensors, set points, stamps, commands."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from odd_files import MM, NEWTON, TIME, assert_is_the_test, write_table
from record_files import codes, message
from refusals import refusal

from mrwork.records import ListedTest, guess_tests, read_damper_test
from mrwork.records.rig_table import UNKNOWN

POUND = 4.4482216152605
CONSTANT = np.ones_like(TIME)


@pytest.mark.parametrize(
    ("heading", "newtons"),
    [
        ("Load (lbs)", POUND),
        ("Load [lb]", POUND),
        ("load_Lbf", POUND),
        ("Load (kips)", 1e3 * POUND),
        ("load_kip", 1e3 * POUND),
        ("Load [tf]", 9806.65),
    ],
)
def test_pounds_kips_and_tonnes_of_force_are_known(tmp_path: Path, heading: str, newtons: float) -> None:
    columns = {"Time (s)": TIME, "Stroke (mm)": MM, heading: NEWTON / newtons}
    assert_is_the_test(read_damper_test(write_table(tmp_path / "rig.txt", columns)))


@pytest.mark.parametrize(("mark", "delimiter"), [('"', ","), ('"', "\t"), ("\N{DOUBLE PRIME}", ";")])
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
    ("heading", "command"),
    [
        *((name, (2.0, "A")) for name in ("I_set (A)", "I_cmd [A]", "Shunt_A", "i coil (A)")),
        *((name, (2.0, "V")) for name in ("Driver [V]", "MR driver (V)", "coil_V")),
        *((name, None) for name in ("input (V)", "damper (V)", "coil temperature (V)", "Shunt (mV)")),
    ],
)
def test_set_points_shunts_and_drivers_are_the_command_and_sensors_are_none(
    tmp_path: Path, heading: str, command: tuple[float, str] | None
) -> None:
    columns = {"t_s": TIME, "LVDT (mm)": MM, "Cell (N)": NEWTON, heading: 2.0 * CONSTANT}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert_is_the_test(test)
    assert test.commands == ((command,) if command else ())


def test_a_sensor_counts_only_where_no_column_has_the_name_of_the_quantity(tmp_path: Path) -> None:
    columns = {
        "t_s": TIME, "LVDT (mm)": 2.0 * MM, "Stroke (mm)": MM, "Cell (kN)": NEWTON, "Force (N)": NEWTON,
        "I_set (A)": CONSTANT, "Current (A)": 0.5 * CONSTANT,
    }  # fmt: skip
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert_is_the_test(test)
    assert test.current == 0.5


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


@pytest.mark.parametrize(
    ("form", "heading"),
    [*zip(STAMPS, cycle(["Timestamp", "Time", "Date/Time", "Recorded at"]), strict=False)],
)
def test_stamps_are_seconds_from_the_first(tmp_path: Path, heading: str, form: str) -> None:
    columns = {heading: stamps(STAMPS[form], TIME), "Stroke (mm)": MM, "Force (N)": NEWTON}
    test = read_damper_test(write_table(tmp_path / "rig.txt", columns))
    assert_is_the_test(test)
    assert test.start_time == 0.0
    assert codes(test) == ["velocity_derived"]


def test_a_column_of_times_in_seconds_goes_before_stamps(tmp_path: Path) -> None:
    columns = {"Clock": stamps("%H:%M:%S", TIME), "Time (s)": TIME, "x_mm": MM, "F_N": NEWTON}
    assert_is_the_test(read_damper_test(write_table(tmp_path / "rig.txt", columns)))


@pytest.mark.parametrize(
    ("stamp", "word"),
    [
        (stamps(STAMPS["ISO"], TIME)[199], "line 202: the time 0.995 s repeats"),
        (stamps(STAMPS["ISO"], TIME)[100], "line 202: .* from 0.995 s to 0.5 s"),
        ("later", "line 202, column 'Timestamp' holds 'later'"),
    ],
)
def test_wrong_stamps_are_refused_by_their_line(tmp_path: Path, stamp: str, word: str) -> None:
    times = stamps(STAMPS["ISO"], TIME)
    times[200] = stamp
    path = write_table(tmp_path / "rig.txt", {"Timestamp": times, "x_mm": MM, "F_N": NEWTON})
    refusal(read_damper_test, path, match=word)


MOTION = {"t_s": TIME, "x_mm": MM, "F_N": NEWTON}


def write(tmp_path: Path, name: str, heading: str, value: float) -> Path:
    return write_table(tmp_path / name, {**MOTION, heading: np.full_like(TIME, value)})


def guess(path: Path) -> ListedTest:
    (row,) = guess_tests([path])
    return row


@pytest.mark.parametrize("heading", ["Current (A)", "shunt_A"])
@pytest.mark.parametrize("name", ["10mm2Hz0A.lvm", "sine 0 A.txt"])
def test_a_column_goes_before_the_name(tmp_path: Path, name: str, heading: str) -> None:
    path = write(tmp_path, name, heading, 2.0)
    test = read_damper_test(path)
    assert test.current == 2.0
    assert guess(path).columns["command"] == f"{heading}:A"
    if name == "10mm2Hz0A.lvm":
        assert "says a current of 0 A, the record 2 A" in message(test, "name_disagrees")


def test_a_column_of_volts_and_a_stated_command_go_before_amperes_in_the_name(tmp_path: Path) -> None:
    with_column = read_damper_test(write(tmp_path, "10mm2Hz0A.lvm", "Command (V)", 2.0))
    path = write_table(tmp_path / "10mm2Hz0A.lvm", MOTION)
    stated = read_damper_test(path, columns={"command": "2 V"})
    for test in (with_column, stated):
        assert (test.current, test.voltage) == (None, 2.0)
        assert message(test, "name_not_used") == "the command is 2 V; the 0 A of the file name are not used"
    assert read_damper_test(path).current == 0.0


def test_no_command_is_guessed_beside_a_column_of_one_without_its_unit(tmp_path: Path) -> None:
    path = write(tmp_path, "10mm2Hz0A.lvm", "I_set", 2.0)
    test = read_damper_test(path)
    assert test.commands == ()
    assert "--column command=I_set:A or --column 'command=0 A'" in message(test, "command_unclear")
    row = guess(path)
    assert row.columns["command"] == UNKNOWN
    assert "give it as I_set:A" in row.doubt


def test_a_motor_is_no_command(tmp_path: Path) -> None:
    test = read_damper_test(write(tmp_path, "10mm2Hz0x5A.txt", "Motor current (A)", 12.0))
    assert test.current == 0.5
    assert message(test, "not_used") == "not used: column 'Motor current (A)'"
