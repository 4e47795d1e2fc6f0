"""`mrwork calibrate` and the bands of `mrwork predict`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import mrwork, printed
from refusals import command_refusal

# One free number: the search is over at once.
FIXED = {"k_w": 650.0, "rho": 15000.0, "sigma": 0.5, "n": 2.0, "k": 2500.0, "x0": 0.038}
OTHERS = ["synthetic:spencer1997_slow", "synthetic:spencer1997_fast"]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("calibrate") / "run"
    held = [f"--fix={name}={value}" for name, value in FIXED.items()]
    tests = ["synthetic:spencer1997", "synthetic:spencer1997_fast"]
    printed("identify", *tests, *held, "--every", "4", "--out", out, "--quiet", "--json")
    return out


def test_bands_are_calibrated_on_tests_that_the_fit_has_not_seen(place: Path) -> None:
    command_refusal("predict", place, OTHERS[0], "--level", "0.9", match="run `mrwork calibrate .*run`")
    made = json.loads(mrwork("calibrate", place, OTHERS[0], "--json").stdout)
    assert made["tests"] == [OTHERS[0]]
    predicted = json.loads(mrwork("predict", place, OTHERS[0], "--level", "0.9", "--json").stdout)
    # Its own quantile: all that calibration can say of a single test.
    row = predicted["files"][0]
    assert row["band"]["inside"] == pytest.approx(0.9, abs=0.01)
    assert row["coverage_percent"] == 100.0 * row["band"]["inside"]
    assert row["mean_width_n"] == 2.0 * row["band"]["half_width_n"]
    assert row["interval_score"] >= row["mean_width_n"]
    assert (made["level"], made["coverage_percent"]) == (0.9, None)
    # A wider motion than those of the fit.
    assert predicted["files"][0]["outside_tested_range"] == ["stroke"]
    assert "outside the tested range of the fit in stroke" in predicted["files"][0]["band"]["basis"]


def test_without_files_the_tests_of_the_run_are_left_out_in_turn_and_kept(place: Path) -> None:
    document = json.loads(printed("calibrate", place, "--json"))
    assert len(document["coverage"]) == 2 * 3
    at_level = [each["samples"]["coverage"] for each in document["coverage"] if each["level"] == 0.9]
    assert (document["level"], document["coverage_percent"]) == (0.9, 100.0 * sum(at_level) / 2)
    folds = sorted((place / "left_out").iterdir())
    assert len(folds) == 2
    written = [path.stat().st_mtime_ns for path in folds]
    again = mrwork("calibrate", place)
    assert "each predicted without itself" in again.stdout
    assert [path.stat().st_mtime_ns for path in folds] == written


def test_a_lone_fold_is_refused(place: Path) -> None:
    command_refusal("calibrate", place, "--leave-out", "command", match="have one command in common")
