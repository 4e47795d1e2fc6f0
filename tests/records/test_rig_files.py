"""Files as programs of test rigs write them, of LabVIEW and of MATLAB 7.3 read like a plain table, or are refused."""

from collections.abc import Sequence
from functools import partial
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from odd_files import assert_is_the_test
from record_files import DT, N_TIME, clean_columns
from refusals import refusal
from rig_files import lvm, tdms_channels, write_matlab_73, write_tdms
from sentences import Refused

from mrwork.records import read_damper_test

MM, KN = 1e3, 1e-3


def rows(*order: str, delimiter: str = "\t", form: str = "{:.9g}", comma: bool = False) -> list[str]:
    """Rows of the clean test in s, mm, mm/s and kN; `order` gives the columns."""
    columns = clean_columns()
    scaled = {
        "t": columns["t_s"],
        "x": MM * columns["displacement_m"],
        "v": MM * columns["velocity_mps"],
        "f": KN * columns["force_n"],
        "n": np.arange(N_TIME, dtype=float),
    }
    lines = zip(*(scaled[name] for name in order), strict=True)
    texts = [delimiter.join(form.format(cell) for cell in line) for line in lines]
    return [text.replace(".", ",") for text in texts] if comma else texts


MTS = [
    "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A",
    "",
    "Data Header:\tTime:\t12.5\tSec\t1/2/2010 1:02:03 PM",
    "Data Acquisition:\tTimed Acquisition",
    "Station Name:\tdamper.cfg",
    "Axial Count\tRunning Time\tAxial Displacement\tAxial Force",
    "segments\tSec\tmm\tkN",
]
INSTRON = [
    '"Test Name","rig 3"',
    '"Sample rate",200,"Hz"',
    '"Limits",-10,10',
    "",
    "Results Table 1",
    "",
    "Total Time (s),Cycle Elapsed Time (s),Position(Linear:Digital Position) (mm),Load(Linear:Load) (kN)",
]
GERMAN = ["Prüfung;Dämpfer 3", "Datum;01.02.2020;12:00", "", "Zeit;Weg;Kraft", "[s];[mm];[kN]"]


def text(*blocks: Sequence[str], end: str = "\n") -> str:
    return end.join(line for block in blocks for line in block) + end


seconds_and_loop = partial(rows, "t", "x", "f")

FILES = {
    "MTS with a row of units": text(MTS, rows("n", "t", "x", "f"), end="\r\n"),
    "MTS, its header repeated": text(
        MTS, rows("n", "t", "x", "f")[:150], MTS, rows("n", "t", "x", "f")[150:]
    ),
    "Instron": text(INSTRON, rows("t", "n", "x", "f", delimiter=",")),
    "decimal commas": text(GERMAN, seconds_and_loop(delimiter=";", comma=True)),
    "a column of remarks": text(
        ["Zeit;Weg;Kraft;Bemerkung", "s;mm;kN;"], [f"{row};" for row in seconds_and_loop(delimiter=";")]
    ),
    "clock times": text(
        ["Clock,Time,Stroke,Force", "-,s,mm,kN"],
        [f"12:00:{row % 60:02d},{each}" for row, each in enumerate(seconds_and_loop(delimiter=","))],
    ),
    "a table of a calibration above": text(
        ["Calibration"], [f"{k}\t{2.5 * k}" for k in range(30)], ["t_s\tx_mm\tf_kN"], seconds_and_loop()
    ),
    "units above the names": text(["s\tmm\tkN", "Time\tStroke\tForce"], seconds_and_loop()),
    "a spreadsheet's first line": text(
        ["sep=;", "Zeit;Weg;Kraft", "s;mm;kN"], seconds_and_loop(delimiter=";", comma=True)
    ),
    "catman": text(
        ["Messrate: 200 Hz", "Zeit  1 - Standardmessrate [s]\tWeg [mm]\tKraft [kN]"],
        seconds_and_loop(comma=True),
    ),
}


@pytest.mark.parametrize(
    ("name", "extension", "encoding"),
    [
        *zip(
            FILES,
            cycle([".txt", ".csv", ".dat", ".asc"]),
            cycle(["utf-8", "utf-8-sig", "latin-1"]),
            strict=False,
        )
    ],
)
def test_a_file_of_a_rig_reads_like_a_plain_table(
    tmp_path: Path, name: str, extension: str, encoding: str
) -> None:
    path = tmp_path / f"rig{extension}"
    path.write_bytes(FILES[name].encode(encoding))
    assert_is_the_test(read_damper_test(path))


def test_micrometres_of_a_latin_1_header_are_micrometres(tmp_path: Path) -> None:
    lines = rows("t", "x", "f")
    path = tmp_path / "rig.txt"
    path.write_bytes(text(["Zeit\tWeg\tKraft", "s\t\N{MICRO SIGN}m\tN"], lines).encode("latin-1"))
    columns = clean_columns()
    test = read_damper_test(path)
    np.testing.assert_allclose(test.displacement, 1e-3 * columns["displacement_m"], rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(test.force, 1e-3 * columns["force_n"], rtol=1e-8)


def test_what_the_header_leaves_open_is_asked_for(tmp_path: Path, refused: Refused) -> None:
    for header in (
        ["Time\tStroke\tForce", "s\tmm\tstone"],
        ["Time\tStroke\tForce", "s\tmm\t-"],
        ["Time\tStroke_mm\tForce", "s\tm\tkN"],
        ["Time (s)\tStroke (mm)\tForce"],
        ["Time (s)\tStroke error (mm)\tForce (kN)"],
    ):
        path = tmp_path / "rig.txt"
        path.write_text(text(header, seconds_and_loop()))
        refused(read_damper_test, path)


def test_set_points_and_voltages_of_sensors_are_no_measured_signals(tmp_path: Path) -> None:
    path = tmp_path / "rig.txt"
    header = "Time (s)\tStroke (mm)\tStroke setpoint (mm)\tForce (kN)\tLVDT voltage (V)\tCoil current (A)"
    path.write_text(text([header], [f"{row}\t0.5" for row in rows("t", "x", "n", "f", "n")]))
    test = read_damper_test(path)
    assert_is_the_test(test)
    assert (test.current, test.voltage) == (0.5, None)


def test_commas_that_mean_two_things_are_refused(tmp_path: Path, refused: Refused) -> None:
    for lines in (
        ["t_s,x_mm,f_kN", *seconds_and_loop(delimiter=",", form="{:.6f}", comma=True)],
        ["t_s;x_mm;f_kN", *(f"{k},125;{k},250;{k},500" for k in range(1, 40))],
        ["t_s;x_mm;f_kN", *(f"0.{k};{k},2;{k},5" for k in range(10, 99))],
        ["t_s\tx_mm\tf_kN", *(f"0.{k}\t{k}.2\t1,234.5" for k in range(10, 99))],
    ):
        path = tmp_path / "rig.csv"
        path.write_text(text(lines))
        refused(read_damper_test, path)


@pytest.mark.parametrize(("cuts", "comma"), [((), False), ((100, 150), True)])
@pytest.mark.parametrize("x_columns", ["One", "Multi", "No"])
def test_a_labview_file_reads_like_a_plain_table(
    tmp_path: Path, x_columns: str, cuts: tuple[int, ...], comma: bool
) -> None:
    path = tmp_path / f"rig{'.txt' if comma else '.lvm'}"
    path.write_text(lvm(x_columns, cuts=cuts, comma=comma))
    assert_is_the_test(read_damper_test(path))


def test_a_labview_file_is_refused_by_its_lines(tmp_path: Path) -> None:
    path = tmp_path / "rig.lvm"
    lines, parted = lvm("One").split("\n"), lvm("Multi").split("\n")
    head, _, rest = lvm("One", cuts=(100,)).rpartition("X_Value\tStroke\tLoad cell")
    cell = lines[40].rpartition("\t")[0] + "\toverload"
    parted[40] = parted[40].replace("\t", "9\t", 1)
    for content, word in (
        (lvm("No", steps="0.005\t0.01"), r"2 steps \(Delta_X\)"),
        ("\n".join([*lines[:40], cell, *lines[41:]]), "line 41, column 'Load cell' holds 'overload'"),
        (f"{head}X_Value\tStroke\tTemperature{rest}", "line 133 starts a block with other channels"),
        ("\n".join(lines[:23]), "no data line after it"),
        ("\n".join(parted), "line 41: the channels have different times"),
    ):
        path.write_text(content)
        refusal(read_damper_test, path, match=word)


@pytest.mark.parametrize("struct", ["", "rig"])
def test_a_matlab_73_file_reads_like_a_plain_table(tmp_path: Path, struct: str) -> None:
    path = tmp_path / "rig.mat"
    columns = clean_columns()
    write_matlab_73(
        path, {**columns, "current_a": 0.5, "gains": np.eye(3), "pair": 1j * np.ones(3)}, struct=struct
    )
    test = read_damper_test(path)
    np.testing.assert_array_equal(test.force, columns["force_n"])
    np.testing.assert_array_equal(test.velocity, columns["velocity_mps"])
    assert test.current == 0.5


def test_a_tdms_file_reads_like_a_plain_table(tmp_path: Path) -> None:
    pytest.importorskip("nptdms", reason="reading TDMS needs npTDMS")
    path = tmp_path / "rig.tdms"
    time = clean_columns()["t_s"]
    stamps = np.datetime64("2020-01-02T12:00") + np.round(1e6 * time).astype("timedelta64[us]")
    for channels in (
        tdms_channels(wf_increment=DT, wf_start_offset=0.0),
        {"Time": (time, {"unit_string": "s"}), **tdms_channels()},
        {"Time": (stamps, {}), **tdms_channels()},
    ):
        write_tdms(path, channels)
        assert_is_the_test(read_damper_test(path))
    write_tdms(path, tdms_channels())
    refusal(read_damper_test, path, match="no column for the time among 'Stroke', 'Axial Force'")
