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

from mrwork.closed_loop import STANDARD_GRAVITY
from mrwork.errors import MrworkError, RecordError, SettingError, UnitError
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


def refusal(path: Path, kind: type[MrworkError] = RecordError, **options: float | str) -> str:
    with pytest.raises(kind) as caught:
        read_motion(path, **options)
    sentence = str(caught.value)
    assert sentence.startswith(str(path))
    assert "\n" not in sentence
    return sentence


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
def test_no_damage_ends_in_another_error(tmp_path: Path, name: str, content: Callable[[], list[str]]) -> None:
    whole = bytearray("\n".join(content()).encode())
    rng = np.random.default_rng(11)
    path = tmp_path / name
    for _ in range(150):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 3):
            damaged[place] = int(rng.choice(list(b"0-9.eE, \t\n:=()xN\xe9")))
        path.write_bytes(damaged)
        came = outcome(path)
        assert isinstance(came, GroundMotion) or str(path) in came


@pytest.mark.parametrize(("name", "content"), FORMATS.items())
@pytest.mark.parametrize("word", ["nan", "inf", "*****"])
def test_a_value_that_is_no_number_is_named_by_its_line(
    tmp_path: Path, name: str, content: Callable[[], list[str]], word: str
) -> None:
    lines = content()
    number = len(lines) - 4
    old = lines[number - 1]
    # Columns keep their positions: the last characters of the line are replaced.
    new = old[: -len(word)] + word if name != "a.csv" else old.partition(",")[0] + "," + word
    sentence = refusal(write_lines(tmp_path / name, with_line(lines, number, new)))
    assert f"line {number}" in sentence


@pytest.mark.parametrize(
    "size", [f"NPTS= {N_TIME + 1}, DT= .01", f"NPTS= {N_TIME - 1}, DT= .01", "NPTS= 0, DT= .01"]
)
def test_at2_with_another_number_of_samples_is_refused(tmp_path: Path, size: str) -> None:
    assert f"{N_TIME} follow" in refusal(write_lines(tmp_path / "a.at2", with_line(at2(), 4, size)))


@pytest.mark.parametrize(
    ("number", "text", "said"),
    [
        (3, "VELOCITY TIME HISTORY IN UNITS OF CM/S.", "holds velocity"),
        (3, "ACCELERATION TIME HISTORY IN UNITS OF FURLONGS", "'FURLONGS' is no unit of acceleration"),
        (4, "NPTS= many, DT= .01", "line 4: expected 'NPTS"),
        (4, f"NPTS= {N_TIME}, DT= 0.0", "the step between samples is 0 s"),
        (4, "0.1 0.2 0.3", "has the extension of a PEER AT2 record but not its header"),
        (3, "The units are (g)", "line 3 reads 'The units are (g)'"),
    ],
)
def test_a_false_header_of_at2_is_quoted(tmp_path: Path, number: int, text: str, said: str) -> None:
    kind = UnitError if "unit of acceleration" in said else RecordError
    assert said in refusal(write_lines(tmp_path / "a.AT2", with_line(at2(), number, text)), kind)


@pytest.mark.parametrize(
    ("label", "text", "said"),
    [
        ("Scale Factor", "Scale Factor      1/0", "expected 'Scale Factor'"),
        ("Sampling", "Sampling Freq(Hz) fast", "expected 'Sampling Freq'"),
        ("Sampling", "Sampling Freq(Hz) 0Hz", "is zero"),
        ("Duration", "Duration Time(s)  3", "announces 300 samples (3 s at 100 Hz), 200 follow"),
        ("Memo.", "Note", "has no line 'Memo'"),
    ],
)
def test_a_damaged_header_of_knet_is_quoted(tmp_path: Path, label: str, text: str, said: str) -> None:
    lines = [text if line.startswith(label) else line for line in knet()]
    assert said in refusal(write_lines(tmp_path / "MYG.EW", lines))


@pytest.mark.parametrize(
    ("key", "text", "said"),
    [
        ("DATA_TYPE", "DATA_TYPE: VELOCITY", "holds velocity"),
        ("NDATA", "NDATA: 7", "announces 7 samples"),
        ("NDATA", "NUMBER: 7", "has no 'NDATA'"),
        ("SAMPLING", "SAMPLING_INTERVAL_S: -1", "positive number was expected"),
        ("UNITS", "UNITS: counts", "'counts' is no unit of acceleration"),
    ],
)
def test_a_damaged_header_of_esm_is_quoted(tmp_path: Path, key: str, text: str, said: str) -> None:
    lines = [text if line.startswith(key) else line for line in esm()]
    kind = UnitError if "unit of acceleration" in said else RecordError
    assert said in refusal(write_lines(tmp_path / "a.ASC", lines), kind)


def test_counts_and_missing_steps_of_cosmos_are_refused(tmp_path: Path) -> None:
    counts = cosmos_lines(100.0 * A, title="Raw acceleration counts", unit="counts")
    assert "in counts of the recorder" in refusal(write_lines(tmp_path / "a.v0", counts))
    stepless = cosmos_lines(100.0 * A, step_ms=-999.0)
    assert "states no step" in refusal(write_lines(tmp_path / "a.v1", stepless))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "empty"),
        ("# only\n% comments\n", "only comments"),
        ("t_s,a_mps2\n", "no data line"),
        ("t_s,a_mps2\n0,1\n", "1 rows"),
        ("t_s,a_mps2\n0,1\n0.01,2\n0.01,3\n", "line 4: time goes from 0.01 to 0.01 s"),
        ("t_s,a_mps2\n0,1\n0.02,2\n0.01,3\n", "line 4: time goes from 0.02 to 0.01 s"),
        ("t_s,a_mps2\n0,1\n0.01,\n0.02,3\n", "line 3: the acceleration is no finite number"),
        ("t_s,a_mps2\n0,1\n0.01\n0.02,3\n", "line 3 has 1 field"),
        ("t_s,a_mps2\n0,1\n0.01,2\n0.02,3\n5,3\n5.01,2\n", "a gap of 4.98 s"),
        ("t_s,a_mps2\n0,1\n0.01,9999\n", "beyond any earthquake"),
        ("time,t_s,a_mps2\n0,0,1\n1,1,2\n", "both look like time"),
        ("t_s,force_n\n0,1\n1,2\n", "no column is the acceleration among 't_s', 'force_n'"),
        ("El Centro 1940\n0 0.1\n0.01 0.2\n", "no column is the acceleration among '1', '2'"),
        ("a_mps2\n0\n1\n", "no column is time"),
    ],
)
def test_a_table_that_is_no_motion_is_refused(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(content)
    assert said in refusal(path)


def test_paths_that_are_no_files_are_refused(tmp_path: Path) -> None:
    assert "is a directory" in refusal(tmp_path)
    assert "there is no such file" in refusal(tmp_path / "a.at2")
    image = tmp_path / "a.at2"
    image.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    assert "binary" in refusal(image)
    hollow = tmp_path / "a.mat"
    hollow.write_bytes(struct.pack("<5i", 0, 2, 1000, 0, 2) + b"e\0")
    assert "cut off or damaged" in refusal(hollow)


def test_impossible_steps_and_units_are_refused(tmp_path: Path) -> None:
    path = write_lines(tmp_path / "a.txt", ["0.1", "0.2", "0.3"])
    assert "give a positive step" in refusal(path, SettingError, dt=-0.01, unit="g")
    assert "no unit of acceleration" in refusal(path, UnitError, dt=0.01, unit="N")


@pytest.mark.parametrize(
    ("dt", "acceleration", "said"),
    [
        (0.01, [], "0 samples"),
        (0.01, [1.0], "1 samples"),
        (0.01, [1.0, np.nan], "sample 1 is not a finite number"),
        (0.0, [1.0, 2.0], "its step is 0.0 s"),
    ],
)
def test_a_motion_is_never_empty_or_infinite(dt: float, acceleration: list[float], said: str) -> None:
    with pytest.raises(RecordError, match=said):
        GroundMotion(name="a", dt=dt, acceleration=np.array(acceleration))


@pytest.mark.parametrize("numbers", [[], [0.1], [0.1, 1e308, 0.2], [0.1, 30.0, 0.2]])
def test_records_without_samples_or_beyond_earthquakes_are_refused(
    tmp_path: Path, numbers: list[float]
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
        refusal(write_lines(tmp_path / name, lines))


def test_headers_of_absurd_numbers_end_at_once(tmp_path: Path) -> None:
    endless = "99999999999999999999"
    duration = ["Duration Time(s)  1e999" if line.startswith("Duration") else line for line in knet()]
    refusal(write_lines(tmp_path / "MYG.EW", duration))
    refusal(write_lines(tmp_path / "a.at2", with_line(at2(), 4, f"NPTS= {endless}, DT= .01")))
    for number in (endless, endless[:9]):
        series = [line.replace(f"{N_TIME} acc", f"{number} acc") for line in cosmos()]
        assert "line" in refusal(write_lines(tmp_path / "a.v2", series))


def test_lines_of_a_long_table_are_counted_though_they_end_with_two_carriage_returns(tmp_path: Path) -> None:
    rows = [f"{0.01 * row:.2f},{row % 7}" for row in range(150)]
    rows[120] = "1.20,OL"
    path = tmp_path / "motion.csv"
    path.write_bytes("\r\r\n".join(["t_s,a_mps2", *rows]).encode())
    with pytest.raises(RecordError, match="line 122, column 'a_mps2' holds 'OL'"):
        read_motion(path)
