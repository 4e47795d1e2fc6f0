"""Headings and units of rigs, what a message suggests for those that are not known, and what is not used."""

import shlex
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, write_table
from record_files import clean_columns, codes, message, write_text
from refusals import refusal
from scipy.io import savemat

from mrwork.files.named_columns import TestQuantity, likely_unit
from mrwork.records import DamperTest, ListedTest, guess_tests, read_damper_test, read_damper_tests
from mrwork.records.columns import parse_column_option
from mrwork.records.rig_table import UNKNOWN

CONSTANT = np.ones_like(TIME)


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


def suggested(message: str) -> dict[str, str]:
    """The options of a message, as a shell splits them."""
    words = shlex.split(message[message.index("--column") :])
    assert words[::2] == ["--column"] * (len(words) // 2)
    return dict(parse_column_option(option) for option in words[1::2])


CASES: dict[str, Mapping[str, Sequence[float] | NDArray[np.float64]]] = {
    "no units": {"Time": TIME, "Stroke": MM, "Force": KN},
    "no units, in SI": {"t": TIME, "x": 1e-3 * MM, "F": NEWTON},
    "no units, in milliseconds": {"Time": 1e3 * TIME, "Stroke": MM, "Force": NEWTON},
    "blanks and brackets": {"Time": TIME, "Stroke (end 2)": MM, "Load Cell 3": NEWTON},
    "units in words of the heading": {"Time_raw_ms": 1e3 * TIME, "Stroke_mm_raw": MM, "Load_kN_raw": KN},
    "other names with units": {"Clock (s)": TIME, "Way [mm]": MM, "P [kN]": KN},
    "an apostrophe and a dollar": {"Time": TIME, "Stroke": MM, "Bob's force $HOME": KN},
    "two of a kind": {"t_s": TIME, "Load left (kN)": KN, "Load right (kN)": KN, "x_mm": MM},
    "other names without units": {"Ch 1": TIME, "Ch 2": MM, "Ch 3": KN},
    "a count and a state beside": {"n": np.arange(400), "on": 1 + 0 * TIME, "a": TIME, "b": MM, "c": KN},
    "an unknown unit": {"t_s": TIME, "x_mm": MM, "F_kNewtons": KN},
}


@pytest.mark.parametrize("case", CASES)
def test_what_a_message_suggests_reads_the_test(tmp_path: Path, case: str) -> None:
    path = write_table(tmp_path / "rig.txt", CASES[case])
    said = str(refusal(read_damper_test, path, match="--column"))
    assert_is_the_test(read_damper_test(path, columns=suggested(said)))


@pytest.mark.parametrize(
    ("quantity", "name", "samples", "unit"),
    [
        ("force", "Load", [-8.0, 8.0], "kN"),
        ("force", "Load lbs", [-8.0, 8.0], "lbs"),
        ("displacement", "x", [-25.0, 25.0], "mm"),
        ("displacement", "x", [100.0, 100.05], "m"),
        ("time", "t", [0.0, 5.0, 10.0], "ms"),
        ("time", "t", [0.0, 500.0, 1000.0], "us"),
        ("current", "i", [0.0, 500.0], "mA"),
        ("velocity", "v", [-50.0, 50.0], "mm/s"),
        ("velocity", "v", [np.nan, np.nan], "m/s"),
    ],
)
def test_the_likely_unit_follows_from_the_heading_or_the_size_of_the_numbers(
    quantity: TestQuantity, name: str, samples: list[float], unit: str
) -> None:
    assert likely_unit(quantity, name, np.array(samples)) == unit


@pytest.mark.parametrize(
    ("heading", "given"),
    [
        ("Load [kN]", "load"),
        ("Load_kN", "Load:kN"),
        ("Load cell 3 (kN)", "Load cell 3"),
        ("Position(Linear:Load) (kN)", "Position(Linear:Load) (kN)"),
        ("Position(Linear:Load) (kN)", "Position(Linear:Load)"),
    ],
)
def test_a_heading_is_found_without_its_unit_and_has_the_unit_of_the_file(
    tmp_path: Path, heading: str, given: str
) -> None:
    path = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, heading: KN, "Force (N)": MM})
    assert_is_the_test(read_damper_test(path, columns={"force": given}))


def test_a_column_without_a_unit_has_that_of_the_row_of_units_or_is_asked_for_it(tmp_path: Path) -> None:
    columns = {"Ch 1": TIME, "Ch 2": MM, "Ch 3": KN}
    given = {"time": "Ch 1", "displacement": "Ch 2", "force": "Ch 3"}
    below = write_table(tmp_path / "a.txt", columns, "s", "mm", "kN")
    assert_is_the_test(read_damper_test(below, columns=given))
    without = write_table(tmp_path / "b.txt", columns)
    refusal(read_damper_test, without, columns=given, match="'time=Ch 1:s'")


def test_a_name_that_several_headings_have_but_for_their_units_is_refused(tmp_path: Path) -> None:
    path = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, "Load [kN]": KN, "Load (N)": NEWTON})
    refusal(read_damper_test, path, columns={"force": "Load"}, match=r"'Load \[kN\]', 'Load \(N\)'")
    assert_is_the_test(read_damper_test(path, columns={"force": "Load (N)"}))


WITH_OTHERS = {
    "t_s": TIME,
    "x_mm": MM,
    "F_N": NEWTON,
    "Temp [degC]": 20.0 + 0 * TIME,
    "Count": np.arange(TIME.size),
}
NOTE = "not used: columns 'Temp [degC]', 'Count'"


def not_read(test: DamperTest) -> str:
    return message(test, "files_not_read")


def test_columns_that_are_not_used_are_named_once(tmp_path: Path) -> None:
    assert message(read_damper_test(write_table(tmp_path / "rig.txt", WITH_OTHERS)), "not_used") == NOTE
    assert "not_used" not in codes(read_damper_test(write_text(tmp_path / "all.csv", clean_columns())))


def test_a_column_is_not_used_where_a_number_is_given_for_it(tmp_path: Path) -> None:
    path = write_text(tmp_path / "rig.csv", {**clean_columns(), "current_a": 0.5 + 0 * TIME})
    test = read_damper_test(path, columns={"command": "1 A"})
    assert (test.current, message(test, "not_used")) == (1.0, "not used: column 'current_a'")


def test_variables_without_a_vector_of_numbers_are_named(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {**clean_columns(), "operator": "me", "gains": np.eye(3), "temp": 20.0 + 0 * TIME})
    found = message(read_damper_test(path), "not_used")
    assert found == "not used: column 'temp'; variables 'operator' (text), 'gains' (3 x 3)"


def folder_of_two(tmp_path: Path) -> Path:
    rig = tmp_path / "rig"
    rig.mkdir()
    for name in ("a", "b"):
        write_table(rig / f"{name}.txt", WITH_OTHERS if name == "a" else {**WITH_OTHERS, "F_N": 1.5 * NEWTON})
    (rig / "photo.jpg").write_bytes(b"")
    (rig / "old").mkdir()
    (rig / ".hidden").write_text("")
    return rig


def test_files_of_a_folder_that_are_not_read_are_named_on_its_records(tmp_path: Path) -> None:
    rig = folder_of_two(tmp_path)
    tests = read_damper_tests(rig)
    assert [not_read(test) for test in tests] == 2 * [f"of the folder {rig}, not read: old/, photo.jpg"]
    assert [codes(test).count("files_not_read") for test in read_damper_tests([rig / "a.txt"])] == [0]


def test_records_that_a_table_does_not_name_are_named(tmp_path: Path) -> None:
    rig = folder_of_two(tmp_path)
    (rig / "tests.csv").write_text("file,use\na.txt,fit\n")
    (test,) = read_damper_tests(rig)
    assert not_read(test) == f"of the folder {rig}, not in tests.csv: b.txt"
    (rig / "tests.csv").write_text("file,use\na.txt,fit\nb.txt,unused\n")
    (test,) = read_damper_tests(rig)
    assert "files_not_read" not in codes(test)
