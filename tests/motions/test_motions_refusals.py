"""An invalid ground motion is refused by one sentence that names the file, the place and the remedy."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from motion_files import (
    DT,
    N_TIME,
    accelerations,
    at2_lines,
    cosmos_lines,
    esm_lines,
    knet_lines,
    write_lines,
)
from sentences import Refused

from mrwork.closed_loop import STANDARD_GRAVITY
from mrwork.errors import MrworkError
from mrwork.motions import GroundMotion, read_motion

A = accelerations()
SIZE = f"NPTS=  {N_TIME}, DT= .01000 SEC"


def at2() -> list[str]:
    return at2_lines(A / STANDARD_GRAVITY, SIZE)


def knet() -> list[str]:
    return knet_lines(np.arange(200), "2")


def esm() -> list[str]:
    return esm_lines(100.0 * A)


def cosmos() -> list[str]:
    return cosmos_lines(100.0 * A)


def table() -> list[str]:
    return ["t_s,a_mps2", *(f"{DT * k:.4f},{value:.12g}" for k, value in enumerate(A))]


FORMATS = {"a.AT2": at2, "MYG002.NS": knet, "a.ASC": esm, "a.v2": cosmos, "a.csv": table}


def read(folder: Path, name: str, lines: list[str]) -> GroundMotion:
    return read_motion(write_lines(folder / name, lines))


def outcome(path: Path) -> GroundMotion | str:
    """Return the motion, or the message of its refusal."""
    try:
        return read_motion(path)
    except MrworkError as error:
        return str(error)


def with_line(lines: list[str], number: int, text: str) -> list[str]:
    """Lines with one replaced, by its number from 1."""
    return [*lines[: number - 1], text, *lines[number:]]


@pytest.mark.parametrize(("name", "content"), FORMATS.items())
def test_every_cut_of_a_file_is_refused_or_named(
    tmp_path: Path, name: str, content: Callable[[], list[str]]
) -> None:
    whole = "\n".join(content()).encode()
    rng = np.random.default_rng(7)
    for size in [0, 1, 2, *rng.integers(3, len(whole) - 30, 60)]:
        path = tmp_path / name
        path.write_bytes(whole[:size])
        came = outcome(path)
        if isinstance(came, GroundMotion):
            # A table does not state its length; every other format does.
            assert name == "a.csv", size
            assert came.n_time < N_TIME
        else:
            assert came.startswith(str(path))
            assert "\n" not in came


@pytest.mark.parametrize(("name", "content"), FORMATS.items())
def test_a_value_that_is_no_number_is_named_by_its_line(
    tmp_path: Path, name: str, content: Callable[[], list[str]], refused: Refused
) -> None:
    lines = content()
    number = len(lines) - 4
    old = lines[number - 1]
    for word in ("nan", "inf", "*****"):
        # Columns keep their positions: the last characters of the line are replaced.
        new = old[: -len(word)] + word if name != "a.csv" else old.partition(",")[0] + "," + word
        refused(read, tmp_path, name, with_line(lines, number, new))


def test_a_false_header_of_at2_is_quoted(tmp_path: Path, refused: Refused) -> None:
    for number, text in (
        (3, "VELOCITY TIME HISTORY IN UNITS OF CM/S."),
        (3, "ACCELERATION TIME HISTORY IN UNITS OF FURLONGS"),
        (3, "The units are (g)"),
        (4, "NPTS= many, DT= .01"),
        (4, f"NPTS= {N_TIME + 1}, DT= .01"),
        (4, f"NPTS= {N_TIME - 1}, DT= .01"),
        (4, "NPTS= 0, DT= .01"),
        (4, "NPTS= 99999999999999999999, DT= .01"),
        (4, f"NPTS= {N_TIME}, DT= 0.0"),
        (4, "0.1 0.2 0.3"),
    ):
        refused(read, tmp_path, "a.AT2", with_line(at2(), number, text))


def test_a_damaged_header_of_knet_is_quoted(tmp_path: Path, refused: Refused) -> None:
    for label, text in (
        ("Scale Factor", "Scale Factor      1/0"),
        ("Sampling", "Sampling Freq(Hz) fast"),
        ("Sampling", "Sampling Freq(Hz) 0Hz"),
        ("Duration", "Duration Time(s)  3"),
        ("Duration", "Duration Time(s)  1e999"),
        ("Memo.", "Note"),
    ):
        lines = [text if line.startswith(label) else line for line in knet()]
        refused(read, tmp_path, "MYG.EW", lines)


def test_a_damaged_header_of_esm_is_quoted(tmp_path: Path, refused: Refused) -> None:
    for key, text in (
        ("DATA_TYPE", "DATA_TYPE: VELOCITY"),
        ("NDATA", "NDATA: 7"),
        ("NDATA", "NUMBER: 7"),
        ("SAMPLING", "SAMPLING_INTERVAL_S: -1"),
        ("UNITS", "UNITS: counts"),
    ):
        lines = [text if line.startswith(key) else line for line in esm()]
        refused(read, tmp_path, "a.ASC", lines)


def test_counts_and_absurd_numbers_of_cosmos_are_refused(tmp_path: Path, refused: Refused) -> None:
    counts = cosmos_lines(100.0 * A, title="Raw acceleration counts", unit="counts")
    refused(read, tmp_path, "a.v0", counts)
    refused(read, tmp_path, "a.v1", cosmos_lines(100.0 * A, step_ms=-999.0))
    for number in ("99999999999999999999", "999999999"):
        refused(read, tmp_path, "a.v2", [line.replace(f"{N_TIME} acc", f"{number} acc") for line in cosmos()])


def test_a_table_that_is_no_motion_is_refused(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "a.csv"
    for content in (
        "",
        "# only\n% comments\n",
        "t_s,a_mps2\n",
        "t_s,a_mps2\n0,1\n",
        "t_s,a_mps2\n0,1\n0.01,2\n0.01,3\n",
        "t_s,a_mps2\n0,1\n0.02,2\n0.01,3\n",
        "t_s,a_mps2\n0,1\n0.01,\n0.02,3\n",
        "t_s,a_mps2\n0,1\n0.01\n0.02,3\n",
        "t_s,a_mps2\n0,1\n0.01,2\n0.02,3\n5,3\n5.01,2\n",
        "t_s,a_mps2\n0,1\n0.01,9999\n",
        "time,t_s,a_mps2\n0,0,1\n1,1,2\n",
        "t_s,force_n\n0,1\n1,2\n",
        "El Centro 1940\n0 0.1\n0.01 0.2\n",
        "a_mps2\n0\n1\n",
    ):
        path.write_text(content)
        refused(read_motion, path)


def test_paths_that_are_no_files_are_refused(tmp_path: Path, refused: Refused) -> None:
    refused(read_motion, tmp_path)
    refused(read_motion, tmp_path / "a.at2")
    image = tmp_path / "a.at2"
    image.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    refused(read_motion, image)
    hollow = tmp_path / "a.mat"
    hollow.write_bytes(struct.pack("<5i", 0, 2, 1000, 0, 2) + b"e\0")
    refused(read_motion, hollow)


def test_impossible_steps_and_units_are_refused(tmp_path: Path, refused: Refused) -> None:
    path = write_lines(tmp_path / "a.txt", ["0.1", "0.2", "0.3"])
    refused(read_motion, path, dt=-0.01, unit="g")
    refused(read_motion, path, dt=0.01, unit="N")


def test_a_motion_is_never_empty_or_infinite(refused: Refused) -> None:
    for dt, acceleration in ((0.01, []), (0.01, [1.0]), (0.01, [1.0, np.nan]), (0.0, [1.0, 2.0])):
        refused(GroundMotion, name="a", dt=dt, acceleration=np.array(acceleration))


@pytest.mark.parametrize("numbers", [[], [0.1], [0.1, 1e308, 0.2], [0.1, 30.0, 0.2]])
def test_records_without_samples_or_beyond_earthquakes_are_refused(
    tmp_path: Path, numbers: list[float], refused: Refused
) -> None:
    in_g = np.array(numbers)
    files = {
        "a.at2": at2_lines(in_g, f"NPTS= {in_g.size}, DT= .01 SEC"),
        "a.asc": esm_lines(in_g * 980.665 if in_g.max(initial=0.0) < 1e3 else in_g),
        "a.v2": cosmos_lines(
            in_g, unit="g", series_format="(6F13.5)" if in_g.max(initial=0.0) < 1e3 else "(1F320.1)"
        ),
        "a.csv": ["t_s,a (g)", *(f"{DT * k:.4f},{value:.12g}" for k, value in enumerate(in_g))],
    }
    for name, lines in files.items():
        refused(read, tmp_path, name, lines)


def test_lines_of_a_long_table_are_counted_though_they_end_with_two_carriage_returns(
    tmp_path: Path, refused: Refused
) -> None:
    rows = [f"{0.01 * row:.2f},{row % 7}" for row in range(150)]
    rows[120] = "1.20,OL"
    path = tmp_path / "motion.csv"
    path.write_bytes("\r\r\n".join(["t_s,a_mps2", *rows]).encode())
    refused(read_motion, path)
