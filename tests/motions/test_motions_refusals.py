"""An invalid ground motion is refused by one sentence that names the file, the place and the remedy."""

from collections.abc import Callable
from contextlib import suppress
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
from refusals import refusal

from mrwork.closed_loop.evaluation import STANDARD_GRAVITY
from mrwork.errors import MrworkError
from mrwork.motions import read_motion

A = accelerations()


def at2() -> list[str]:
    return at2_lines(A / STANDARD_GRAVITY, f"NPTS=  {N_TIME}, DT= .01000 SEC")


def knet() -> list[str]:
    return knet_lines(np.arange(200), "2")


def esm() -> list[str]:
    return esm_lines(100.0 * A)


def cosmos() -> list[str]:
    return cosmos_lines(100.0 * A)


def table() -> list[str]:
    return ["t_s,a_mps2", *(f"{DT * k:.4f},{value:.12g}" for k, value in enumerate(A))]


FORMATS = {"a.AT2": at2, "MYG002.NS": knet, "a.ASC": esm, "a.v2": cosmos, "a.csv": table}


def with_line(lines: list[str], number: int, text: str) -> list[str]:
    """Lines with one replaced, by its number from 1."""
    return [*lines[: number - 1], text, *lines[number:]]


@pytest.mark.parametrize(("name", "content"), FORMATS.items())
def test_a_cut_of_a_file_is_refused_where_its_header_states_the_length(
    tmp_path: Path, name: str, content: Callable[[], list[str]]
) -> None:
    whole = "\n".join(content()).encode()
    path = tmp_path / name
    for size in [0, 1, *np.random.default_rng(7).integers(3, len(whole) - 30, 20)]:
        path.write_bytes(whole[:size])
        if size and name == "a.csv":
            with suppress(MrworkError):
                assert read_motion(path).n_time < N_TIME
        else:
            refusal(read_motion, path, match=str(path))


@pytest.mark.parametrize(("name", "content"), FORMATS.items())
@pytest.mark.parametrize("word", ["nan", "*****"])
def test_a_value_that_is_no_number_is_named_by_its_line(
    tmp_path: Path, name: str, content: Callable[[], list[str]], word: str
) -> None:
    lines = content()
    number = len(lines) - 4
    old = lines[number - 1]
    # Columns keep their positions: the last characters of the line are replaced.
    new = old[: -len(word)] + word if name != "a.csv" else old.partition(",")[0] + "," + word
    path = write_lines(tmp_path / name, with_line(lines, number, new))
    refusal(read_motion, path, match=rf"line {number}\b")


@pytest.mark.parametrize(
    ("name", "label", "text", "word"),
    [
        (
            "a.AT2",
            "ACCELERATION",
            "VELOCITY TIME HISTORY IN UNITS OF CM/S.",
            "line 3: the record holds velocity",
        ),
        ("a.AT2", "ACCELERATION", "ACCELERATION TIME HISTORY IN UNITS OF FURLONGS", "'FURLONGS' is no unit"),
        ("a.AT2", "NPTS", f"NPTS= {N_TIME + 1}, DT= .01", "204 numbers are announced.*203 follow"),
        ("a.AT2", "NPTS", f"NPTS= {N_TIME - 1}, DT= .01", "202 numbers are announced.*203 follow"),
        ("a.AT2", "NPTS", f"NPTS= {N_TIME}, DT= 0.0", "in line 4"),
        ("MYG002.NS", "Scale Factor", "Scale Factor      1/0", "found 'Scale Factor 1/0'"),
        ("MYG002.NS", "Sampling", "Sampling Freq(Hz) 0Hz", "0Hz"),
        ("a.ASC", "DATA_TYPE", "DATA_TYPE: VELOCITY", "holds velocity"),
        ("MYG002.NS", "Duration", "Duration Time(s)  3", "300 numbers are announced"),
        ("a.ASC", "NDATA", "NDATA: 7", "7 numbers are announced"),
        ("a.ASC", "SAMPLING", "SAMPLING_INTERVAL_S: -1", "SAMPLING_INTERVAL_S: -1"),
        ("a.ASC", "UNITS", "UNITS: counts", "'counts' is no unit"),
    ],
)
def test_a_false_or_damaged_header_is_quoted(
    tmp_path: Path, name: str, label: str, text: str, word: str
) -> None:
    lines = [text if line.startswith(label) else line for line in FORMATS[name]()]
    refusal(read_motion, write_lines(tmp_path / name, lines), match=word)


def test_counts_and_a_missing_step_of_cosmos_are_refused(tmp_path: Path) -> None:
    for lines, word in (
        (cosmos_lines(100.0 * A, title="Raw acceleration counts", unit="counts"), "'counts' is no unit"),
        (cosmos_lines(100.0 * A, step_ms=-999.0), "every 0 s"),
        ([line.replace(f"{N_TIME} acc", "999999999 acc") for line in cosmos()], "line 73"),
    ):
        refusal(read_motion, write_lines(tmp_path / "a.v2", lines), match=word)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        ("t_s,a_mps2\n0,1\n0.02,2\n0.01,3\n", "line 4: time goes from 0.02 to 0.01 s"),
        ("t_s,a_mps2\n0,1\n0.01,\n0.02,3\n", "line 3: the acceleration"),
        ("t_s,a_mps2\n0,1\n0.01,2\n0.02,3\n5,3\n5.01,2\n", "line 5: a gap of 4.98 s"),
        ("t_s,a_mps2\n0,1\n0.01,9999\n", "9999 m/s2 is beyond any earthquake"),
        ("time,t_s,a_mps2\n0,0,1\n1,2,2\n", "'time' and 't_s'.* `dt`"),
        ("t_s,force_n\n0,1\n1,2\n", 'column="2"'),
    ],
)
def test_a_table_that_is_no_motion_is_refused(tmp_path: Path, content: str, word: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(content)
    refusal(read_motion, path, match=word)


def test_lines_of_a_long_table_are_counted_though_they_end_with_two_carriage_returns(tmp_path: Path) -> None:
    lines = ["t_s,a_mps2", *(f"{0.01 * row:.2f},{row % 7}" for row in range(150))]
    path = write_lines(tmp_path / "motion.csv", with_line(lines, 122, "1.20,OL"), "\r\r\n")
    refusal(read_motion, path, match="line 122.*'OL'")
