"""An invalid record is refused by one sentence that names the file, the place and the remedy."""

from __future__ import annotations

import gzip
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from record_files import clean_columns, write_text
from sentences import Refused

import mrwork as mr
from mrwork.records import build_damper_test, read_damper_test, read_damper_tests

HEADER = "t_s,displacement_m,force_n"


def lines_of_a_clean_file() -> list[str]:
    columns = clean_columns()
    rows = zip(columns["t_s"], columns["displacement_m"], columns["force_n"], strict=True)
    return [HEADER, *(",".join(f"{cell:.12g}" for cell in row) for row in rows)]


def read(folder: Path, content: str | bytes, name: str = "rig.csv") -> object:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_damper_test(path)


def with_line(number: int, text: str) -> str:
    """A clean file with line `number`, from 1, replaced."""
    lines = lines_of_a_clean_file()
    lines[number - 1] = text
    return "\n".join(lines)


def test_a_file_that_is_no_table_is_refused(tmp_path: Path, refused: Refused) -> None:
    clean = lines_of_a_clean_file()
    for content in (
        "",
        " \n\n",
        "# only\n# comments\n",
        HEADER,
        HEADER + "\n\n# end\n",
        "\n".join(clean[:2]),
        "\n".join(clean[:10]),
        "\n".join(clean[1:]),
        "\n".join([HEADER, *reversed(clean[1:])]),
        "a" * 70_000,
        "t_s," * 1_000_000,
        b"\x89PNG\r\n\x1a\n" + bytes(100),
        gzip.compress(b"t_s,force_n\n"),
        HEADER.encode("utf-16"),
    ):
        refused(read, tmp_path, content)


def test_a_wrong_row_is_named_by_its_line(tmp_path: Path, refused: Refused) -> None:
    for line in (
        "0.075,abc,3",
        "0.075,1_0,3",
        "0.075,,3",
        "nan,nan,nan",
        ",,",
        "0.075,inf,3",
        "0.075,1,1e300",
        "0.075,0.001",
        "0,075,0,001,3,1",
        '0.075,"0,001",3',
        "0.03,0.001,3",
        "0.07,0.001,3",
    ):
        refused(read, tmp_path, with_line(17, line))
    commented = "# rig 3\n\n" + with_line(17, "0.03,0.001,3").replace("\n", "\r\n")
    refused(read, tmp_path, commented)
    for line in ("0.03,0.001,3", "0.075,,3"):
        lines = with_line(17, line).split("\n")
        lines[1] = lines[2] = ",,"
        refused(read, tmp_path, "\n".join(lines))


def test_a_dead_channel_is_refused(tmp_path: Path, refused: Refused) -> None:
    for column, value in (
        ("force_n", 0.0),
        ("force_n", 12.5),
        ("displacement_m", 0.02),
        ("velocity_mps", np.nan),
        ("current_a", np.nan),
    ):
        columns = clean_columns()
        columns[column] = np.full_like(columns["t_s"], value)
        refused(read_damper_test, write_text(tmp_path / "rig.csv", columns))


def test_times_of_a_gap_or_of_an_impossible_unit_are_refused(tmp_path: Path, refused: Refused) -> None:
    """A last point at ten minutes is not filled with interpolation."""
    columns = clean_columns()
    columns["t_s"][-1] = 600.0
    refused(read_damper_test, write_text(tmp_path / "rig.csv", columns))
    columns["t_s"] = 1e-9 * clean_columns()["t_s"]
    refused(read_damper_test, write_text(tmp_path / "rig.csv", columns))


def test_paths_that_are_no_records_are_refused(tmp_path: Path, refused: Refused) -> None:
    folder = tmp_path / "tests.csv"
    folder.mkdir()
    refused(read_damper_test, folder)
    refused(read_damper_test, tmp_path / "absent.csv")
    refused(read, tmp_path, "x", name="rig.xls")
    refused(read, tmp_path, "x", name="rig")
    refused(read_damper_tests, str(tmp_path / "rig*.csv"))
    refused(read_damper_tests, [])


def test_a_mat_header_is_believed_only_as_far_as_the_file_reaches(tmp_path: Path, refused: Refused) -> None:
    for order in ("<", ">"):
        kind = 0 if order == "<" else 1000
        for shape in ((2**31 - 1, 2**31 - 1), (1, 2**28), (-5, 1)):
            header = struct.pack(f"{order}5i", kind, *shape, 0, 4) + b"t_s\0"
            refused(read, tmp_path, header + bytes(200), name="rig.mat")


def test_a_compressed_variable_is_not_unpacked_without_bound(tmp_path: Path, refused: Refused) -> None:
    block = zlib.compress(struct.pack("<2I", 14, 2**31) + bytes(1000))
    content = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + struct.pack("<2I", 15, len(block)) + block
    refused(read, tmp_path, content, name="rig.mat")


def test_a_wrong_mat_file_is_refused(tmp_path: Path, refused: Refused) -> None:
    hdf5 = b"\x89HDF\r\n\x1a\n" + bytes(600)
    version_7_3 = b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF"
    for content in (b"", b"abc", HEADER.encode() * 10, hdf5, version_7_3):
        refused(read, tmp_path, content, name="rig.mat")


def test_arrays_are_refused_by_sample_number(refused: Refused) -> None:
    columns = clean_columns()
    columns["t_s"][7] = columns["t_s"][6]
    refused(
        build_damper_test,
        name="rig",
        time=columns["t_s"],
        displacement=columns["displacement_m"],
        force=columns["force_n"],
    )


def test_arrays_that_do_not_belong_together_are_refused(refused: Refused) -> None:
    for force in (np.ones(3), np.ones((400, 2))):
        columns = clean_columns()
        refused(
            build_damper_test,
            name="rig",
            time=columns["t_s"],
            displacement=columns["displacement_m"],
            force=np.asarray(force),
        )


def test_a_part_without_samples_and_a_test_without_compared_ones_are_refused(refused: Refused) -> None:
    test = mr.synthetic_test("spencer1997")
    refused(test.part, 10, 2)
    refused(mr.identify, "bingham", replace(test.part(0, 3), n_settle=3))
    refused(replace, test, n_settle=-1)


def test_a_constant_command_of_another_length_is_refused(refused: Refused) -> None:
    columns = clean_columns()
    time, displacement, force = (columns[name] for name in HEADER.split(","))
    refused(
        build_damper_test,
        name="rig",
        time=time,
        displacement=displacement,
        force=force,
        current=np.full(3, 0.5),
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


def test_a_test_whose_signals_do_not_vary_is_not_compared(refused: Refused) -> None:
    for channel in ("force", "displacement"):
        test = mr.synthetic_test("spencer1997")
        still = replace(test, **{channel: np.zeros(test.n_time)})
        refused(mr.identify, "bingham", still)


def test_the_command_of_a_test_made_by_hand_has_its_length_and_is_a_number_where_constant(
    refused: Refused,
) -> None:
    test = mr.synthetic_test("spencer1997")
    assert replace(test, current=np.full(test.n_time, 0.5)).current == 0.5
    for command in (np.ones(3), np.ones((test.n_time, 1))):
        refused(replace, test, current=command)
