"""A column of the command goes before the name of the file, which is used only where there is no such column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from odd_files import MM, NEWTON, TIME, write_table
from record_files import codes, message

from mrwork.records import ListedTest, guess_tests, read_damper_test
from mrwork.records.rig_table import UNKNOWN

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
