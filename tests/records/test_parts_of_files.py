"""Sweeps, bursts and tests side by side of one file are tests by number, in calls, tables and the words of refusals."""

from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from odd_files import MM, NEWTON, TIME
from refusals import command_refusal, refusal

from mrwork.records import guess_tests, read_damper_test, read_damper_tests, write_test_table

STEP = float(TIME[1] - TIME[0])
HEADS = ("time_s", "displacement_mm", "force_N")


def saved(path: Path, *columns: np.ndarray, heads: tuple[str, ...] = HEADS) -> Path:
    np.savetxt(path, np.column_stack(columns), "%.9g", delimiter=",", header=",".join(heads), comments="")
    return path


def stacked(path: Path, *starts: float) -> Path:
    """Tests one below the other, the second twice as large and so on, whose times begin at these."""
    parts = [
        np.column_stack([start + TIME, size * MM, size * NEWTON])
        for size, start in enumerate(starts, start=1)
    ]
    return saved(path, *np.concatenate(parts).T)


def beside(path: Path) -> Path:
    return saved(path, TIME, MM, NEWTON, TIME, 2.0 * MM, 2.0 * NEWTON, heads=HEADS + HEADS)


FILES = {
    "sweeps": lambda path: stacked(path, 0.0, 0.0),
    "bursts": lambda path: stacked(path, 0.0, 9.0),
    "side by side": beside,
}


@pytest.mark.parametrize("kind", FILES)
def test_each_part_is_a_test_by_its_number(tmp_path: Path, kind: str) -> None:
    path = FILES[kind](tmp_path / "parts.csv")
    refusal(read_damper_test, path, match="parts.csv#1")
    first, second = (read_damper_test(f"{path}#{number}") for number in (1, 2))
    assert (first.name, second.name) == ("parts#1", "parts#2")
    assert first.sha256 != second.sha256
    np.testing.assert_allclose(first.displacement, 1e-3 * MM, atol=1e-9)
    np.testing.assert_allclose(second.force, 2.0 * first.force, rtol=1e-6)
    refusal(read_damper_test, f"{path}#3", match="has no part 3, .* there are 2; give one of .*#1 to .*#2")


@pytest.mark.parametrize("kind", FILES)
def test_a_table_has_a_row_for_each_part_and_is_read_back(tmp_path: Path, kind: str) -> None:
    path = FILES[kind](tmp_path / "parts.csv")
    rows = guess_tests([path])
    assert [Path(row.file).name for row in rows] == ["parts.csv#1", "parts.csv#2"]
    write_test_table(tmp_path / "tests.csv", rows)
    tests = read_damper_tests(tmp_path)
    assert [test.name for test in tests] == ["parts#1", "parts#2"]
    assert not [remark for test in tests for remark in test.remarks if remark.code == "files_not_read"]


def test_a_file_of_one_test_has_no_parts(tmp_path: Path) -> None:
    whole = saved(tmp_path / "whole.csv", TIME, MM, NEWTON)
    (row,) = guess_tests([whole])
    assert row.file == str(whole)
    refusal(read_damper_test, f"{whole}#2", match=f"has no part 2, .* there are 1; give {whole} alone")
    # A gap makes no bursts, and a name with such a mark is a name.
    kept = (TIME[100] > TIME) | (TIME[160] < TIME)
    assert len(guess_tests([saved(tmp_path / "gap.csv", TIME[kept], MM[kept], NEWTON[kept])])) == 1
    named = saved(tmp_path / "a.csv#1", TIME, MM, NEWTON).rename(tmp_path / "run#1.csv")
    assert read_damper_test(named).name == "run#1"


def test_what_a_refusal_proposes_works_when_typed(tmp_path: Path) -> None:
    path = stacked(tmp_path / "parts.csv", 0.0, 0.0)
    end = f"{TIME[-1]:g}"
    command_refusal("check", path, match=rf"as {path}#1, or take the first one \(--until {end}\)")
    for words in ((f"{path}#1",), (path, "--until", end)):
        assert mrwork("check", *words).returncode == 0
    assert (
        mrwork(
            "identify", f"{path}#1", f"{path}#2", "--model", "bingham", "--out", tmp_path / "run"
        ).returncode
        == 0
    )
    assert mrwork("report", tmp_path / "run").returncode == 0


def test_columns_that_are_given_go_into_the_table(tmp_path: Path) -> None:
    saved(tmp_path / "a.csv", TIME, MM, NEWTON, heads=("time_s", "displacement_mm", "Load"))
    table = tmp_path / "guess.csv"
    given = ("--column", "command=0.5A", "--column", "force=Load:N", "--table", table)
    assert mrwork("check", tmp_path, *given).returncode == 0
    (test,) = read_damper_tests([table])
    assert (test.current, test.force.max()) == (0.5, pytest.approx(NEWTON.max(), rel=1e-4))
    command_refusal(
        "check", tmp_path, "--table", tmp_path / "b.csv", "--from", "1", match="no place for --from"
    )
    command_refusal(
        "check", tmp_path, *given[:2], "--column", "Load=none", *given[-2:], match="no column for Load"
    )
