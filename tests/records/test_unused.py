"""The reader says what it did not use: columns, variables, files of a folder; on the record, and in every verb."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from command_line import mrwork
from odd_files import MM, NEWTON, TIME, write_table
from record_files import clean_columns, codes, message, write_text
from scipy.io import savemat

from mrwork.records import DamperTest, read_damper_test, read_damper_tests

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
    assert found == "not used: column 'temp'; variables 'operator', 'gains' (no vector of numbers)"


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


def test_check_says_it_once_for_the_folder_and_once_for_what_its_files_share(tmp_path: Path) -> None:
    rig = folder_of_two(tmp_path)
    ended = mrwork("check", rig)
    assert ended.returncode == 0
    assert ended.stderr == f"mrwork: of the folder {rig}, not read: old/, photo.jpg\n"
    assert ended.stdout.count("not used") == 1
    assert f"note in all 2 tests: {NOTE}" in ended.stdout
