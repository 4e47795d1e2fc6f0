"""What a message suggests can be pasted into a shell and reads the test; headings are found without their units."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork, printed
from numpy.typing import NDArray
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, write_table
from sentences import Refused

from mrwork.errors import MrworkError, RecordError
from mrwork.files.named_columns import TestQuantity, likely_unit
from mrwork.records import parse_column_option, read_damper_test


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
    with pytest.raises(MrworkError) as refusal:
        read_damper_test(path)
    assert_is_the_test(read_damper_test(path, columns=suggested(str(refusal.value))))


def test_a_suggestion_is_pasted_at_the_command_line(tmp_path: Path) -> None:
    path = write_table(tmp_path / "rig.txt", CASES["an apostrophe and a dollar"])
    refused = mrwork("check", path)
    assert refused.returncode == 2
    options = shlex.split(refused.stderr[refused.stderr.index("--column") :])
    text = printed("check", path, *options)
    assert "10 mm" in text
    assert "362.8 N" in text


def test_columns_without_names_are_suggested_by_number(tmp_path: Path) -> None:
    path = tmp_path / "rig.txt"
    path.write_text("\n".join("\t".join(map(str, row)) for row in zip(TIME, MM, KN, strict=True)))
    with pytest.raises(RecordError) as refusal:
        read_damper_test(path)
    assert_is_the_test(read_damper_test(path, columns=suggested(str(refusal.value))))


@pytest.mark.parametrize(
    ("quantity", "name", "samples", "unit"),
    [
        ("force", "Load", [-80.0, 80.0], "N"),
        ("force", "Load", [-8.0, 8.0], "kN"),
        ("force", "Load lbs", [-8.0, 8.0], "lbs"),
        ("displacement", "x", [-0.025, 0.025], "m"),
        ("displacement", "x", [-25.0, 25.0], "mm"),
        ("displacement", "x", [100.0, 100.05], "m"),
        ("time", "t", [0.0, 0.005, 0.01], "s"),
        ("time", "t", [0.0, 5.0, 10.0], "ms"),
        ("time", "t", [0.0, 500.0, 1000.0], "us"),
        ("current", "i", [0.0, 2.0], "A"),
        ("current", "i", [0.0, 500.0], "mA"),
        ("voltage", "u", [0.0, 5.0], "V"),
        ("velocity", "v", [-0.5, 0.5], "m/s"),
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
        ("Load [kN]", "Load"),
        ("Load (kN)", "load"),
        ("Load_kN", "Load"),
        ("Load cell 3 (kN)", "Load cell 3"),
        ("Load [kN]", "Load:kN"),
        ("Load [kN]", "Load [kN]"),
        ("Position(Linear:Load) (kN)", "Position(Linear:Load) (kN)"),
        ("Position(Linear:Load) (kN)", "Position(Linear:Load)"),
    ],
)
def test_a_heading_is_found_without_its_unit_and_has_the_unit_of_the_file(
    tmp_path: Path, heading: str, given: str
) -> None:
    path = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, heading: KN, "Force (N)": MM})
    assert_is_the_test(read_damper_test(path, columns={"force": given}))


def test_a_column_without_a_unit_has_that_of_the_row_of_units_or_is_asked_for_it(
    tmp_path: Path, refused: Refused
) -> None:
    columns = {"Ch 1": TIME, "Ch 2": MM, "Ch 3": KN}
    given = {"time": "Ch 1", "displacement": "Ch 2", "force": "Ch 3"}
    assert_is_the_test(
        read_damper_test(write_table(tmp_path / "a.txt", columns, "s", "mm", "kN"), columns=given)
    )
    refused(read_damper_test, write_table(tmp_path / "b.txt", columns), columns=given)


def test_a_name_that_several_headings_have_but_for_their_units_is_refused(
    tmp_path: Path, refused: Refused
) -> None:
    path = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, "Load [kN]": KN, "Load (N)": NEWTON})
    refused(read_damper_test, path, columns={"force": "Load"})
    assert_is_the_test(read_damper_test(path, columns={"force": "Load (N)"}))
