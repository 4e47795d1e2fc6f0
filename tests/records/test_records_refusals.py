"""An invalid record is refused by one sentence that names the file, the place and the remedy."""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from record_files import clean_columns, write_text

import mrwork as mr
from mrwork.errors import RecordError, SettingError
from mrwork.records import build_damper_test, read_damper_test, read_damper_tests

HEADER = "t_s,displacement_m,force_n"


def lines_of_a_clean_file() -> list[str]:
    columns = clean_columns()
    rows = zip(columns["t_s"], columns["displacement_m"], columns["force_n"], strict=True)
    return [HEADER, *(",".join(f"{cell:.12g}" for cell in row) for row in rows)]


def refusal(path: Path) -> str:
    with pytest.raises(RecordError) as caught:
        read_damper_test(path)
    sentence = str(caught.value)
    assert str(path) in sentence
    assert "\n" not in sentence
    return sentence


def refusal_of(tmp_path: Path, content: str | bytes, name: str = "rig.csv") -> str:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return refusal(path)


def with_line(number: int, text: str) -> str:
    """A clean file with line `number`, from 1, replaced."""
    lines = lines_of_a_clean_file()
    lines[number - 1] = text
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        pytest.param("", "empty", id="empty file"),
        pytest.param(" \n\n", "empty", id="blank file"),
        pytest.param("# only\n# comments\n", "no header", id="comments only"),
        pytest.param(HEADER, "no data line", id="header only"),
        pytest.param(HEADER + "\n\n# end\n", "no data line", id="header and comment only"),
        pytest.param("\n".join(lines_of_a_clean_file()[:2]), "has 1 complete sample", id="one sample"),
        pytest.param("\n".join(lines_of_a_clean_file()[:10]), "at least 10", id="nine samples"),
        pytest.param("\n".join(lines_of_a_clean_file()[1:]), "add a header line", id="no header"),
        pytest.param("a" * 70_000, "longer than 64 KiB", id="absurd header"),
        pytest.param("t_s," * 1_000_000, "longer than 64 KiB", id="megabytes of header"),
        pytest.param(b"\x89PNG\r\n\x1a\n" + bytes(100), "binary", id="image"),
        pytest.param(gzip.compress(b"t_s,force_n\n"), "binary", id="compressed"),
        pytest.param(HEADER.encode("utf-16"), "UTF-16", id="UTF-16"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path: Path, content: str | bytes, expected: str) -> None:
    assert expected in refusal_of(tmp_path, content)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        pytest.param("0.075,abc,3", "column 'displacement_m' holds 'abc'", id="text"),
        pytest.param("0.075,1_0,3", "column 'displacement_m' holds '1_0'", id="underscore"),
        pytest.param("0.075,,3", "no value for displacement;", id="empty cell"),
        pytest.param("nan,nan,nan", "no value for time, displacement, force", id="NaN row"),
        pytest.param(",,", "no value for time, displacement, force", id="blank row"),
        pytest.param("0.075,inf,3", "the displacement is inf", id="infinite"),
        pytest.param("0.075,1,1e300", "the force is 1e+300", id="absurd"),
        pytest.param("0.075,0.001", "2 fields where the header names 3", id="short row"),
        pytest.param("0,075,0,001,3,1", "decimal commas", id="decimal commas"),
        pytest.param('0.075,"0,001",3', "decimal comma", id="quoted decimal comma"),
        pytest.param("0.03,0.001,3", "time runs backwards, from 0.07 s to 0.03 s", id="time backwards"),
        pytest.param("0.07,0.001,3", "time 0.07 s repeats", id="time repeated"),
    ],
)
def test_a_wrong_row_is_named_by_its_line(tmp_path: Path, line: str, expected: str) -> None:
    sentence = refusal_of(tmp_path, with_line(17, line))
    assert "line 17" in sentence
    assert expected in sentence


def test_lines_are_counted_as_an_editor_counts_them(tmp_path: Path) -> None:
    commented = "# rig 3\n\n" + with_line(17, "0.03,0.001,3").replace("\n", "\r\n")
    assert "line 19" in refusal_of(tmp_path, commented)


@pytest.mark.parametrize("wrong", ["0.03,0.001,3", "0.075,,3"])
def test_incomplete_rows_dropped_at_the_start_still_count_as_lines(tmp_path: Path, wrong: str) -> None:
    lines = with_line(17, wrong).split("\n")
    lines[1] = lines[2] = ",,"
    assert "line 17" in refusal_of(tmp_path, "\n".join(lines))


def test_decimal_commas_throughout_are_not_taken_for_columns(tmp_path: Path) -> None:
    rows = [f"0,{row:03d},0,001,{row},5" for row in range(1, 40)]
    assert "decimal commas" in refusal_of(tmp_path, "\n".join([HEADER, *rows]))


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("force_n", 0.0, "force is zero throughout"),
        ("force_n", 12.5, "force is constant at 12.5 N"),
        ("displacement_m", 0.02, "displacement is constant at 0.02 m"),
        ("velocity_mps", np.nan, "velocity has no value"),
        ("current_a", np.nan, "current has no value"),
    ],
)
def test_a_dead_channel_is_refused(tmp_path: Path, column: str, value: float, expected: str) -> None:
    columns = clean_columns()
    columns[column] = np.full_like(columns["t_s"], value)
    assert expected in refusal(write_text(tmp_path / "rig.csv", columns))


def test_a_last_point_at_ten_minutes_is_not_filled_with_interpolation(tmp_path: Path) -> None:
    columns = clean_columns()
    columns["t_s"][-1] = 600.0
    assert "cut out one continuous part" in refusal(write_text(tmp_path / "rig.csv", columns))


def test_time_in_an_impossible_unit_is_refused(tmp_path: Path) -> None:
    columns = clean_columns()
    columns["t_s"] = 1e-9 * columns["t_s"]
    assert "check the unit of the time" in refusal(write_text(tmp_path / "rig.csv", columns))


def test_paths_that_are_no_records_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "tests.csv"
    folder.mkdir()
    assert "directory" in refusal(folder)
    assert "no such file" in refusal(tmp_path / "absent.csv")
    assert "'.xls'" in refusal_of(tmp_path, "x", name="rig.xls")
    assert "no extension" in refusal_of(tmp_path, "x", name="rig")


def test_an_empty_selection_of_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="no file matches"):
        read_damper_tests(str(tmp_path / "*.csv"))
    with pytest.raises(RecordError, match="at least one file"):
        read_damper_tests([])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("shape", [(2**31 - 1, 2**31 - 1), (1, 2**28), (-5, 1)])
def test_a_mat_header_is_believed_only_as_far_as_the_file_reaches(
    tmp_path: Path, order: str, shape: tuple[int, int]
) -> None:
    kind = 0 if order == "<" else 1000
    header = struct.pack(f"{order}5i", kind, *shape, 0, 4) + b"t_s\0"
    sentence = refusal_of(tmp_path, header + bytes(200), name="rig.mat")
    assert "claims a " in sentence
    assert "damaged" in sentence


def test_a_compressed_variable_is_not_unpacked_without_bound(tmp_path: Path) -> None:
    block = zlib.compress(struct.pack("<2I", 14, 2**31) + bytes(1000))
    content = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<2I", 15, len(block)) + block
    assert "a compressed variable claims 2,147 MB" in refusal_of(tmp_path, content, name="rig.mat")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        pytest.param(b"", "empty", id="empty"),
        pytest.param(b"abc", "not a readable .mat file", id="three bytes"),
        pytest.param(HEADER.encode() * 10, "not a readable .mat file", id="text"),
        pytest.param(b"\x89HDF\r\n\x1a\n" + bytes(600), "not a readable version 7.3", id="HDF5"),
        pytest.param(
            b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF", "not a readable version 7.3", id="version 7.3"
        ),
    ],
)
def test_a_wrong_mat_file_is_refused(tmp_path: Path, content: bytes, expected: str) -> None:
    assert expected in refusal_of(tmp_path, content, name="rig.mat")


def test_arrays_are_refused_by_sample_number() -> None:
    columns = clean_columns()
    columns["t_s"][7] = columns["t_s"][6]
    with pytest.raises(RecordError, match=r"^rig: sample 8: the time 0\.03 s repeats"):
        build_damper_test(
            name="rig",
            time=columns["t_s"],
            displacement=columns["displacement_m"],
            force=columns["force_n"],
        )


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        (np.ones(3), "has 3 samples where the time has 400"),
        (np.ones((400, 2)), "shape"),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(force: object, expected: str) -> None:
    columns = clean_columns()
    with pytest.raises(RecordError, match=expected):
        build_damper_test(
            name="rig", time=columns["t_s"], displacement=columns["displacement_m"], force=np.asarray(force)
        )


def test_a_part_without_samples_and_a_test_without_compared_ones_are_refused() -> None:
    test = mr.synthetic_test("spencer1997")
    with pytest.raises(SettingError, match=r"a part from sample 10 up to 2 of .* has none"):
        test.part(10, 2)
    with pytest.raises(SettingError, match="none of its 3 samples is compared, `n_settle` is"):
        mr.identify("bingham", replace(test.part(0, 3), n_settle=3))
    with pytest.raises(SettingError, match="`n_settle` of DamperTest is -1"):
        replace(test, n_settle=-1)


def test_a_constant_command_of_another_length_is_refused() -> None:
    columns = clean_columns()
    time, displacement, force = (columns[name] for name in HEADER.split(","))
    with pytest.raises(RecordError, match="the current has 3 samples where the time has"):
        build_damper_test(
            name="rig", time=time, displacement=displacement, force=force, current=np.full(3, 0.5)
        )


def test_millimetres_taken_for_metres_are_told() -> None:
    columns = clean_columns()
    time, displacement, force = (columns[name] for name in HEADER.split(","))
    for factor, told in ((1.0, False), (1e3, True)):
        test = build_damper_test(name="rig", time=time, displacement=factor * displacement, force=force)
        assert ("displacement_unusual" in [each.code for each in test.findings]) == told


def test_an_arc_without_noise_has_no_moving_average() -> None:
    time = 0.01 * np.arange(150)
    test = build_damper_test(
        name="line", time=time, displacement=0.01 * np.sin(6.0 * time), force=np.arange(150.0)
    )
    assert test.smoothing is None


@pytest.mark.parametrize("channel", ["force", "displacement"])
def test_a_test_whose_signals_do_not_vary_is_not_compared(channel: str) -> None:
    test = mr.synthetic_test("spencer1997")
    still = replace(test, **{channel: np.zeros(test.n_time)})
    with pytest.raises(RecordError, match=f"the {channel} is constant, so there is nothing to compare"):
        mr.identify("bingham", still)


def test_the_command_of_a_test_made_by_hand_has_its_length_and_is_a_number_where_constant() -> None:
    test = mr.synthetic_test("spencer1997")
    assert replace(test, current=np.full(test.n_time, 0.5)).current == 0.5
    for command in (np.ones(3), np.ones((test.n_time, 1))):
        with pytest.raises(SettingError, match=r"`current` of .* has shape .*; give a number, or shape"):
            replace(test, current=command)
