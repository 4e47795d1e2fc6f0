"""The amplitude of a motion is half its peak to peak, wherever it is shown or compared."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import mrwork
from odd_files import MM, NEWTON, TIME, write_table
from record_files import AMPLITUDE, codes, message

from mrwork.records import read_damper_test
from mrwork.records.damper_test import range_of_tests
from mrwork.uncertainty.candidate_tests import excitation_of


@pytest.fixture
def off_centre(tmp_path: Path) -> Path:
    """The clean test about 80 mm instead of zero, as a sensor shows it that was not set to zero."""
    return write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM + 80.0, "F_N": NEWTON})


def test_check_shows_half_the_peak_to_peak(off_centre: Path) -> None:
    assert "at 200 Hz, amplitude 10 mm, 126 mm/s, 362.8 N" in mrwork("check", off_centre).stdout
    (facts,) = json.loads(mrwork("check", off_centre, "--json").stdout)["files"]
    assert facts["amplitude_m"] == pytest.approx(AMPLITUDE, rel=1e-4)
    assert facts["peak_displacement_m"] == pytest.approx(0.090, rel=1e-4)


def test_plan_and_range_take_half_the_peak_to_peak(off_centre: Path) -> None:
    test = read_damper_test(off_centre)
    assert excitation_of(test).amplitude == pytest.approx(AMPLITUDE, rel=1e-4)
    assert range_of_tests([test]).stroke == pytest.approx(AMPLITUDE, rel=1e-4)


def test_the_name_of_a_file_is_compared_with_half_the_peak_to_peak(tmp_path: Path, off_centre: Path) -> None:
    named = off_centre.rename(tmp_path / "10mm2Hz.txt")
    assert "name_disagrees" not in codes(read_damper_test(named))
    named = named.rename(tmp_path / "20mm2Hz.txt")
    assert message(read_damper_test(named), "name_disagrees").startswith(
        "the file name says an amplitude of 20 mm, the record 10 mm (half the peak to peak); rename"
    )
