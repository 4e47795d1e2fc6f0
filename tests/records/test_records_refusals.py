"""An invalid record is refused by one sentence that names the file, the place and the remedy."""

import gzip
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from record_files import Columns, clean_columns, write_text
from refusals import refusal
from sentences import Refused

import mrwork as mr
from mrwork.records import read_damper_test, read_damper_tests
from mrwork.records.reading import Reading

HEADER = "t_s,displacement_m,force_n"
COLUMNS = {name: clean_columns()[name] for name in HEADER.split(",")}
CLEAN = [HEADER, *(",".join(f"{cell:.12g}" for cell in row) for row in zip(*COLUMNS.values(), strict=True))]


def read(folder: Path, content: str | bytes, name: str = "rig.csv") -> mr.DamperTest:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_damper_test(path)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("", "the file is empty"),
        (HEADER + "\n\n# end\n", "no data line after it"),
        ("\n".join(CLEAN[:10]), "9 complete samples; a test needs at least 10"),
        ("\n".join(CLEAN[1:]), "--column time=1:s"),
        ("\n".join([HEADER, *reversed(CLEAN[1:])]), "line 3: .* from 1.995 s to 1.99 s .as do 398 more rows"),
        (gzip.compress(b"t_s,force_n\n", mtime=0), "a binary file"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path: Path, content: str | bytes, word: str) -> None:
    refusal(read, tmp_path, content, match=word)


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("0.075,abc,3", "'displacement_m' holds 'abc'"),
        ("0.075,,3", "no value for displacement"),
        ("0.075,1,1e300", r"force is 1e\+300"),
        ("0.075,0.001", "2 fields"),
        ("0,075,0,001,3,1", "6 fields .* decimal commas"),
        ('0.075,"0,001",3', "'0,001' with a decimal comma"),
        ("0.03,0.001,3", "from 0.07 s to 0.03 s"),
        ("0.07,0.001,3", "0.07 s repeats"),
    ],
)
def test_a_wrong_row_is_named_by_its_line(tmp_path: Path, line: str, word: str) -> None:
    lines = [*CLEAN[:16], line, *CLEAN[17:]]
    refusal(read, tmp_path, "\n".join(lines), match=f"line 17.*{word}")
    refusal(read, tmp_path, "# rig 3\n\n" + "\r\n".join(lines), match=f"line 19.*{word}")


@pytest.mark.parametrize(
    ("column", "value", "word"),
    [
        ("force_n", 0.0, "force is zero throughout"),
        ("displacement_m", 0.02, "displacement is constant at 0.02 m"),
        ("velocity_mps", np.nan, "velocity has no value"),
        ("current_a", np.nan, "current has no value"),
    ],
)
def test_a_dead_channel_is_refused(tmp_path: Path, column: str, value: float, word: str) -> None:
    columns = clean_columns()
    columns[column] = np.full_like(columns["t_s"], value)
    refusal(read_damper_test, write_text(tmp_path / "rig.csv", columns), match=word)


def test_times_of_a_gap_or_of_an_impossible_unit_are_refused(tmp_path: Path) -> None:
    """A last point at ten minutes is not filled with interpolation."""
    columns = clean_columns()
    columns["t_s"][-1] = 600.0
    path = write_text(tmp_path / "rig.csv", columns)
    refusal(read_damper_test, path, match="largest gap 598 s after 1.99 s")
    path = write_text(tmp_path / "rig.csv", columns | {"t_s": 1e-9 * clean_columns()["t_s"]})
    refusal(read_damper_test, path, match="time step is 5e-12 s")


def test_rows_in_the_order_of_the_displacement_are_refused_and_a_stroke_one_way_is_not(
    tmp_path: Path,
) -> None:
    time = 0.005 * np.arange(800)
    phase, noise = 2.0 * np.pi * time, np.random.default_rng(1).normal(0.0, 5.0, time.size)
    displacement, velocity = 0.01 * np.sin(phase), 0.0628 * np.cos(phase)
    force = 300.0 * np.tanh(velocity / 0.01) + 500.0 * velocity + noise
    order = np.argsort(displacement)
    for rows in (order, order[::-1]):
        refusal(mr.test_from_arrays, time, displacement[rows], force[rows], match="ordered by displacement")
    timeless = {"displacement_mm": 1e3 * displacement[order], "force_N": force[order]}
    path = write_text(tmp_path / "rig.csv", timeless)
    refusal(read_damper_test, path, match="ordered by displacement")
    # Friction and noise alone over a stroke that never turns back.
    mr.test_from_arrays(time, 0.01 * time, 50.0 + noise)


def test_a_clock_that_is_slower_than_the_samples_asks_for_their_rate(tmp_path: Path) -> None:
    time = 0.002 * np.arange(500)
    displacement, force = 10.0 * np.sin(6.0 * time), 300.0 * np.cos(6.0 * time)
    columns = {
        "time_s": np.floor(100.0 * time + 1e-9) / 100.0,
        "displacement_mm": displacement,
        "force_N": force,
    }
    path = write_text(tmp_path / "rig.csv", columns)
    refusal(read_damper_test, path, match="--column time=500Hz")
    read = read_damper_test(path, columns={"time": "500Hz"})
    assert (read.n_time, read.dt) == (500, pytest.approx(0.002))
    # Of a row that was written twice, no rate is asked.
    columns["time_s"] = np.where(np.arange(500) == 300, time[299], time)
    refusal(read_damper_test, write_text(tmp_path / "twice.csv", columns), match="delete the repeated rows")


def test_a_part_is_taken_before_what_lies_outside_is_refused(tmp_path: Path) -> None:
    later = [
        ",".join((f"{float(line.partition(',')[0]) + 400:.12g}", line.partition(",")[2]))
        for line in CLEAN[1:]
    ]
    whole = Reading(files=(str(read(tmp_path, "\n".join(CLEAN)).path),), end=1.5).tests()[0]
    hole = [*CLEAN[:350], CLEAN[350].rpartition(",")[0] + ",", *CLEAN[351:]]
    for number, (lines, start, end) in enumerate((
        ([*CLEAN, *later], None, 1.5), ([*CLEAN, *later], 400.0, 401.5), ([*CLEAN, "", *CLEAN], None, 1.5),
        (hole, None, 1.5),
    )):  # fmt: skip
        file = tmp_path / f"{number}.csv"
        file.write_text("\n".join(lines))
        refusal(read_damper_test, file, match="--until")
        (part,) = Reading(files=(str(file),), start=start, end=end).tests()
        np.testing.assert_allclose(part.force, whole.force, rtol=1e-9)
    refusal(read_damper_test, file, start=500.0, match="no row has a time from 500 to inf s; .* 0 to 1.995 s")


def test_paths_that_are_no_records_are_refused(tmp_path: Path, refused: Refused) -> None:
    folder = tmp_path / "tests.csv"
    folder.mkdir()
    refused(read_damper_test, folder)
    refused(read_damper_test, tmp_path / "absent.csv")
    refused(read, tmp_path, "x", name="rig.ods")
    refused(read, tmp_path, "x", name="rig")
    refused(read_damper_tests, str(tmp_path / "rig*.csv"))
    refused(read_damper_tests, [])


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "the file is empty"),
        (HEADER.encode() * 10, "is a text"),
        (HEADER.encode() + bytes(300), "no byte-order mark"),
        (b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF", "version 7.3"),
        (struct.pack("<5i", 0, 1, 2**28, 0, 4) + b"t_s\0" + bytes(200), "cut off or damaged"),
        (struct.pack(">5i", 1000, 1, 2**28, 0, 4) + b"t_s\0" + bytes(200), "cut off or damaged"),
    ],
)
def test_a_wrong_mat_file_is_refused(tmp_path: Path, content: bytes, word: str) -> None:
    refusal(read, tmp_path, content, name="rig.mat", match=word)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (
            lambda given: {"time": np.r_[given["t_s"][:7], given["t_s"][6:-1]]},
            "sample 8: the time 0.03 s repeats",
        ),
        (lambda given: {"force": np.ones(3)}, "force has 3 samples where the time has 400"),
        (lambda given: {"current": np.full(3, 0.5)}, "current has 3 samples where the time has 400"),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(
    change: Callable[[Columns], dict[str, Any]], word: str
) -> None:
    time, displacement, force = COLUMNS.values()
    given = {"time": time, "displacement": displacement, "force": force}
    refusal(mr.test_from_arrays, name="rig", **given | change(COLUMNS), match=word)


def test_a_test_without_compared_samples_or_signals_is_refused() -> None:
    test = mr.synthetic_test("spencer1997")
    refusal(test.part, 10, 2, match="from sample 10 up to 2 of 2001")
    refusal(mr.identify, "bingham", replace(test.part(0, 3), n_settle=3), match="none of its 3 samples")
    for channel in ("force", "displacement"):
        still = replace(test, **{channel: np.zeros(test.n_time)})
        refusal(mr.identify, "bingham", still, match=f"{channel} is constant")


def test_the_command_of_a_test_made_by_hand_has_its_length_and_is_a_number_where_constant() -> None:
    test = mr.synthetic_test("spencer1997")
    assert replace(test, current=np.full(test.n_time, 0.5)).current == 0.5
    refusal(replace, test, current=np.ones(3), match=r"`current` .* shape \(3,\)")
