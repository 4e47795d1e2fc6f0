"""What a message suggests can be pasted into a shell and reads the test; headings are found without their units."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, write_table
from refusals import refusal

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
