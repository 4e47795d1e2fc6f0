"""Files of several loggers, or a channel a file, are one test: by times, by a channel that both have, or row by row."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal

import mrwork as mr
from mrwork.records import guess_tests, write_test_table

Floats = NDArray[np.float64]


def stroke(time: Floats) -> Floats:
    """Stroke [mm], which repeats in no two parts."""
    return 10.0 * np.sin(2.0 * np.pi * time) + 2.0 * np.sin(2.0 * np.pi * 1.7 * time + 0.3)


def force(time: Floats) -> Floats:
    speed = 62.8 * np.cos(2.0 * np.pi * time) + 21.4 * np.cos(2.0 * np.pi * 1.7 * time + 0.3)
    return 2.0 * speed + 150.0 * np.tanh(speed / 20.0)


FAST, SLOW = np.arange(0.0, 8.0, 0.002), np.arange(0.0, 8.0, 0.005)


def write(path: Path, heading: str, *columns: Floats) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=heading, comments="", fmt="%.6f")
    return path


@pytest.fixture
def motion(tmp_path: Path) -> Path:
    return write(tmp_path / "motion.csv", "Time (s),Displacement (mm)", FAST, stroke(FAST))


def codes(test: mr.DamperTest) -> set[str]:
    return {remark.code for remark in test.remarks}


def assert_joined(test: mr.DamperTest, shift: float = 0.0) -> None:
    """Displacement and force are those of one instant, `shift` [s] after the times of the test."""
    time = test.dt * np.arange(test.n_time) + shift
    np.testing.assert_allclose(test.displacement, 1e-3 * stroke(time), atol=2e-6)
    np.testing.assert_allclose(test.force, force(time), atol=0.5)


def test_two_loggers_are_joined_by_their_times_at_those_of_the_slower_one(motion: Path) -> None:
    write(motion.parent / "load.csv", "Time (s),Force (N)", SLOW, force(SLOW))
    test = mr.read_damper_test(f"{motion}+load.csv")
    assert test.name == "motion+load"
    assert test.dt == pytest.approx(0.005)
    assert_joined(test)
    # Both count from 0, and nothing shows that this is one instant.
    assert "files_joined_by_times" in codes(test)


def test_a_channel_in_both_tells_the_lag(motion: Path) -> None:
    late = 0.3712
    write(
        motion.parent / "load.csv",
        "Time (s),Force (N),Stroke (mm)",
        SLOW,
        force(SLOW + late),
        stroke(SLOW + late),
    )
    test = mr.read_damper_test(f"{motion}+load.csv")
    assert_joined(test, late)
    (said,) = (remark.message for remark in test.remarks if remark.code == "files_joined")
    assert "moved by -0.3712 s" in said
    assert "files_joined_by_times" not in codes(test)


def test_times_of_the_day_join_without_a_doubt(tmp_path: Path) -> None:
    for name, start, heading, values in (
        ("a", 10.0, "Displacement (mm)", stroke), ("b", 11.25, "Force (N)", force),
    ):  # fmt: skip
        times = start + np.arange(0.0, 8.0, 0.004)
        rows = [f"2024-05-01 12:00:{time:06.3f},{values(np.array(time)):.5f}" for time in times]
        (tmp_path / f"{name}.csv").write_text("\n".join([f"Time,{heading}", *rows]) + "\n")
    test = mr.read_damper_test(f"{tmp_path / 'a.csv'}+b.csv")
    assert_joined(test, 11.252)
    assert "files_joined" in codes(test)
    assert test.n_time * test.dt == pytest.approx(6.75, abs=0.01)


def test_a_channel_a_file_is_joined_row_by_row(motion: Path) -> None:
    write(motion.parent / "load.csv", "Force (N)", force(FAST))
    assert_joined(mr.read_damper_test(f"{motion}+load.csv"))
    write(motion.parent / "bare.csv", "Displacement (mm)", stroke(FAST))
    bare = f"{motion.parent / 'bare.csv'}+load.csv"
    assert_joined(mr.read_damper_test(bare, columns={"time": "500 Hz"}))
    write(motion.parent / "short.csv", "Force (N)", force(FAST[:100]))
    refusal(
        mr.read_damper_test,
        f"{motion}+short.csv",
        match="100 rows and no column of times, and motion.csv has 4000",
    )


def test_loggers_that_do_not_overlap_are_refused_with_what_brings_them_together(motion: Path) -> None:
    write(motion.parent / "load.csv", "Time (s),Force (N)", 100.0 + SLOW, force(SLOW))
    error = refusal(
        mr.read_damper_test, f"{motion}+load.csv", match="from 100 to 107.995 s, which do not overlap"
    )
    assert_joined(mr.read_damper_test(str(error).split("as in ")[1]))
    write(motion.parent / "back.csv", "Time (s),Force (N)", np.r_[SLOW[:9], 0.01], np.arange(10.0))
    refusal(mr.read_damper_test, f"{motion}+back.csv", match="back.csv: line 11: the time does not rise")


def test_a_table_of_tests_names_joined_files(motion: Path) -> None:
    write(motion.parent / "load.csv", "Time (s),Force (N)", SLOW, force(SLOW))
    (row,) = guess_tests([Path(f"{motion}+load.csv")])
    assert row.columns["force"] == "Force (N):N"
    table = motion.parent / "tests.csv"
    write_test_table(table, [row])
    (test,) = mr.read_damper_tests(motion.parent)
    assert_joined(test)
    # Both files are read, and no other is.
    assert "files_not_read" not in codes(test)


def test_a_name_with_a_plus_is_a_name(tmp_path: Path) -> None:
    write(tmp_path / "0.5A+20C.csv", "Time (s),Displacement (mm),Force (N)", SLOW, stroke(SLOW), force(SLOW))
    test = mr.read_damper_test(tmp_path / "0.5A+20C.csv")
    assert_joined(test)
    assert not codes(test) & {"files_joined", "files_joined_by_times"}
    refusal(mr.read_damper_test, f"{tmp_path / '0.5A+20C.csv'}+none.csv", match="there is no such file")
