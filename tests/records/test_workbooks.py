"""Workbooks of spreadsheets: the sheet with the record is read like a text table, and the others are named."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, workbook
from record_files import codes, message
from refusals import refusal

from mrwork.records import DamperTest, read_damper_test

Rows = list[Sequence[object]]
needs_calamine = pytest.mark.skipif(
    importlib.util.find_spec("python_calamine") is None, reason="reading .xlsx needs python-calamine"
)
HEAD: Rows = [["Time (s)", "Stroke (mm)", "Force (kN)"]]
BODY: Rows = [list(row) for row in zip(TIME, MM, KN, strict=True)]


def read(path: Path, sheets: dict[str, Rows], **columns: str) -> DamperTest:
    path.write_bytes(workbook(sheets))
    return read_damper_test(path, columns=columns)


SHEETS: dict[str, Rows] = {

    "a header block": [["Rig 3"], ["Rate", 200.0, "Hz"], ["Limits", -10.0, 10.0], [], *HEAD, *BODY],
    "a row of units": [["Zeit", "Weg", "Kraft"], ["[s]", "[mm]", "[kN]"], *BODY],
    "empty columns before": [[None, None, *row] for row in HEAD + BODY],
    "marks below": [["t", "x", "F"], ["s", '"', "N"], *zip(TIME, MM / 25.4, NEWTON, strict=True)],

    "remarks": [[*HEAD[0], "Remark"], [*BODY[0], "start"], *BODY[1:]],
    "numbers as texts with commas": [*HEAD, *([f"{cell:.9f}".replace(".", ",") for cell in row] for row in BODY)],
}  # fmt: skip


@needs_calamine
@pytest.mark.parametrize("sheet", SHEETS)
def test_a_sheet_reads_like_a_plain_table(tmp_path: Path, sheet: str) -> None:
    assert_is_the_test(read(tmp_path / "rig.xlsx", {"Sheet 1": SHEETS[sheet]}))


@needs_calamine
def test_cells_of_dates_are_times(tmp_path: Path) -> None:
    begin = datetime(2024, 2, 29, 23, 59, 59)
    stamps = [begin + timedelta(seconds=float(each)) for each in TIME]
    rows: Rows = [["Recorded at", "Stroke (mm)", "Force (kN)"], *zip(stamps, MM, KN, strict=True)]
    test = read(tmp_path / "rig.xlsx", {"Sheet 1": rows})
    assert_is_the_test(test)
    assert test.start_time == 0.0


@needs_calamine
def test_the_first_sheet_with_a_record_is_read_and_the_others_are_named(tmp_path: Path) -> None:
    longer: Rows = [["a", "b"], *([float(k), float(k)] for k in range(3000))]
    sheets = {"Info": [["operator", "me"]], "Raw & more": longer, "Run 1": HEAD + BODY, "Empty": []}
    test = read(tmp_path / "rig.xlsx", sheets)
    assert_is_the_test(test)
    assert message(test, "not_used") == "not used: sheets 'Info', 'Raw & more'"
    assert "further_records" not in codes(test)


@needs_calamine
def test_further_sheets_with_a_record_are_a_warning(tmp_path: Path) -> None:
    test = read(tmp_path / "rig.xlsx", {"Run 1": HEAD + BODY, "Run 2": HEAD + BODY, "Info": [["a"]]})
    assert_is_the_test(test)
    (warning,) = [each for each in test.findings if each.code == "further_records"]
    assert warning.severity == "warning"
    assert "have a record: 'Run 2'; save each as a file" in warning.message
    assert message(test, "not_used") == "not used: sheet 'Info'"


@needs_calamine
def test_without_a_known_heading_the_longest_sheet_is_asked_about(tmp_path: Path) -> None:
    sheets = {"Info": [["a", "b"], [1.0, 2.0]], "Run": [["Ch 1", "Ch 2", "Ch 3"], *BODY]}
    refusal(read, tmp_path / "rig.xlsx", sheets, match="--column 'force=Ch 3:kN'")
    given = {"time": "Ch 1:s", "displacement": "Ch 2:mm", "force": "Ch 3:kN"}
    assert_is_the_test(read(tmp_path / "rig.xlsx", sheets, **given))


@needs_calamine
def test_a_wrong_cell_is_named_by_its_sheet_and_row(tmp_path: Path) -> None:
    body = [*BODY[:100], [*BODY[100][:2], "overload"], *BODY[101:]]
    sheets = {"Run 1": [[], *HEAD, *body]}
    refusal(read, tmp_path / "rig.xlsx", sheets, match=r"sheet 'Run 1': line 103, column 'Force \(kN\)'")


@needs_calamine
@pytest.mark.parametrize(
    ("content", "word"),
    [(b"t_s,x_mm,F_N\n0,0,0\n", "not a readable .xlsx"), (workbook({"Notes": [["me"]]}), "'Notes'")],
)
def test_what_is_no_workbook_with_a_record_is_refused(tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "rig.xlsx"
    path.write_bytes(content)
    refusal(read_damper_test, path, match=word)
