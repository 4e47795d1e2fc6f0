"""Files as programs of test rigs write them read like a plain table, or are refused with what to pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from record_files import DT, N_TIME, clean_columns
from sentences import Refused

from mrwork.records import DamperTest, read_damper_test
from mrwork.store.input_file import RECORD

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


FILES: dict[str, tuple[str, Callable[[], str]]] = {
    "MTS with a row of units": (".txt", lambda: text(MTS, rows("n", "t", "x", "f"))),
    "MTS, CR LF": (".dat", lambda: text(MTS, rows("n", "t", "x", "f"), end="\r\n")),
    "MTS, its header repeated": (
        ".txt",
        lambda: text(MTS, rows("n", "t", "x", "f")[:150], MTS, rows("n", "t", "x", "f")[150:]),
    ),
    "Instron": (".csv", lambda: text(INSTRON, rows("t", "n", "x", "f", delimiter=","))),
    "Instron, quoted": (
        ".csv",
        lambda: text(
            ["Time,Extension,Load", "(s),(mm),(kN)"], rows("t", "x", "f", delimiter=",", form='"{:.9g}"')
        ),
    ),
    "decimal commas": (".csv", lambda: text(GERMAN, rows("t", "x", "f", delimiter=";", comma=True))),
    "decimal commas in quotes": (
        ".csv",
        lambda: text(["t_s,x_mm,f_kN"], rows("t", "x", "f", delimiter=",", form='"{:.9g}"')).replace(
            ".", ","
        ),
    ),
    "decimal commas and tabs": (
        ".txt",
        lambda: text(["Time (s)\tStroke (mm)\tForce (kN)"], rows("t", "x", "f", comma=True)),
    ),
    "blanks": (
        ".txt",
        lambda: text(
            ["  Time (s)   Axial Displacement (mm)   Axial Force (kN)"],
            rows("t", "x", "f", delimiter="   ", form="{:12.9g}"),
        ),
    ),
    "savetxt": (".txt", lambda: text(["# t_s x_mm f_kN"], rows("t", "x", "f", delimiter=" "))),
    "semicolons at the end": (
        ".csv",
        lambda: text(["t_s;x_mm;f_kN;;"], [f"{row};;" for row in rows("t", "x", "f", delimiter=";")]),
    ),
    "a column of remarks": (
        ".csv",
        lambda: text(
            ["Zeit;Weg;Kraft;Bemerkung", "s;mm;kN;"],
            [f"{row};" for row in rows("t", "x", "f", delimiter=";")],
        ),
    ),
    "clock times": (
        ".csv",
        lambda: text(
            ["Clock,Time,Stroke,Force", "-,s,mm,kN"],
            [f"12:00:{row % 60:02d},{each}" for row, each in enumerate(rows("t", "x", "f", delimiter=","))],
        ),
    ),
    "a rule below the names": (
        ".txt",
        lambda: text(["t_s\tx_mm\tf_kN", "-----\t-----\t-----"], rows("t", "x", "f")),
    ),
    "three hundred lines of settings": (
        ".txt",
        lambda: text([f"setting {k}\t{k}\t{k}" for k in range(300)], MTS, rows("n", "t", "x", "f")),
    ),
    "a table of a calibration above": (
        ".txt",
        lambda: text(
            ["Calibration"], [f"{k}\t{2.5 * k}" for k in range(30)], ["t_s\tx_mm\tf_kN"], rows("t", "x", "f")
        ),
    ),
    "units above the names": (
        ".txt",
        lambda: text(["s\tmm\tkN", "Time\tStroke\tForce"], rows("t", "x", "f")),
    ),
    "a remark on each column below the units": (
        ".txt",
        lambda: text(["Time\tStroke\tForce", "s\tmm\tkN", "run 1\trun 1\trun 1"], rows("t", "x", "f")),
    ),
    "a spreadsheet's first line": (
        ".csv",
        lambda: text(["sep=;", "Zeit;Weg;Kraft", "s;mm;kN"], rows("t", "x", "f", delimiter=";", comma=True)),
    ),
    "catman": (
        ".asc",
        lambda: text(
            ["Messrate: 200 Hz", "Zeit  1 - Standardmessrate [s]\tWeg [mm]\tKraft [kN]"],
            rows("t", "x", "f", comma=True),
        ),
    ),
    "words of several languages": (
        ".csv",
        lambda: text(["Tiempo (s),Desplazamiento (mm),Fuerza (kN)"], rows("t", "x", "f", delimiter=",")),
    ),
}


def assert_is_the_test(test: DamperTest) -> None:
    columns = clean_columns()
    assert test.dt == pytest.approx(DT, rel=1e-6)
    np.testing.assert_allclose(test.displacement, columns["displacement_m"], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(test.force, columns["force_n"], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_a_file_of_a_rig_reads_like_a_plain_table(tmp_path: Path, name: str, encoding: str) -> None:
    extension, written = FILES[name]
    path = tmp_path / f"rig{extension}"
    path.write_bytes(written().encode(encoding))
    assert_is_the_test(read_damper_test(path))


def test_micrometres_of_a_latin_1_header_are_micrometres(tmp_path: Path) -> None:
    path = tmp_path / "rig.txt"
    columns = clean_columns()
    lines = ["Zeit\tWeg\tKraft", "s\t\N{MICRO SIGN}m\tN"]
    values = zip(columns["t_s"], 1e6 * columns["displacement_m"], columns["force_n"], strict=True)
    lines += ["\t".join(f"{cell:.12g}" for cell in row) for row in values]
    path.write_bytes("\n".join(lines).encode("latin-1"))
    assert_is_the_test(read_damper_test(path))


def test_columns_without_names_are_given_by_number(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "rig.txt"
    path.write_text(text(rows("t", "x", "f")))
    refused(read_damper_test, path)
    assert_is_the_test(
        read_damper_test(path, columns={"time": "1:s", "displacement": "2:mm", "force": "3:kN"})
    )


def test_a_name_is_given_without_the_unit_below_it(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "rig.txt"
    path.write_text(text(["Ch 1\tCh 2\tCh 3", "s\tmm\tkN"], rows("t", "x", "f")))
    refused(read_damper_test, path)
    given = {"time": "Ch 1:s", "displacement": "Ch 2:mm", "force": "Ch 3:kN"}
    assert_is_the_test(read_damper_test(path, columns=given))


def test_what_the_header_leaves_open_is_asked_for(tmp_path: Path, refused: Refused) -> None:
    for header in (
        ["Time\tStroke\tForce", "s\tmm\tstone"],
        ["Time\tStroke\tForce", "s\tmm\t-"],
        ["Time\tStroke_mm\tForce", "s\tm\tkN"],
        ["Time (s)\tStroke (mm)\tForce"],
        ["Time (s)\tStroke error (mm)\tForce (kN)"],
    ):
        path = tmp_path / "rig.txt"
        path.write_text(text(header, rows("t", "x", "f")))
        refused(read_damper_test, path)


def test_two_force_cells_are_asked_for(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "rig.txt"
    path.write_text(
        text(["Time (s)\tStroke (mm)\tAxial Force (kN)\tLoad cell (kN)"], rows("t", "x", "f", "f"))
    )
    refused(read_damper_test, path)
    assert_is_the_test(read_damper_test(path, columns={"force": "Load cell (kN):kN"}))


def test_set_points_and_voltages_of_sensors_are_no_measured_signals(tmp_path: Path) -> None:
    path = tmp_path / "rig.txt"
    header = "Time (s)\tStroke (mm)\tStroke setpoint (mm)\tForce (kN)\tLVDT voltage (V)\tCoil current (A)"
    path.write_text(text([header], [f"{row}\t0.5" for row in rows("t", "x", "n", "f", "n")]))
    test = read_damper_test(path)
    assert_is_the_test(test)
    assert (test.current, test.voltage) == (0.5, None)


def test_commas_that_mean_two_things_are_refused(tmp_path: Path, refused: Refused) -> None:
    for lines in (
        ["t_s,x_mm,f_kN", *rows("t", "x", "f", delimiter=",", form="{:.6f}", comma=True)],
        ["t_s;x_mm;f_kN", *(f"{k},125;{k},250;{k},500" for k in range(1, 40))],
        ["t_s;x_mm;f_kN", *(f"0.{k};{k},2;{k},5" for k in range(10, 99))],
        ["t_s\tx_mm\tf_kN", *(f"0.{k}\t{k}.2\t1,234.5" for k in range(10, 99))],
    ):
        path = tmp_path / "rig.csv"
        path.write_text(text(lines))
        refused(read_damper_test, path)


def test_a_wrong_cell_below_a_header_block_is_named_by_its_line(tmp_path: Path, refused: Refused) -> None:
    body = rows("n", "t", "x", "f")
    body[100] = body[100].rpartition("\t")[0] + "\toverload"
    path = tmp_path / "rig.txt"
    path.write_text(text(MTS, body))
    refused(read_damper_test, path)


def test_a_file_larger_than_any_test_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    path = tmp_path / "rig.txt"
    path.write_text(text(MTS, rows("n", "t", "x", "f")))
    monkeypatch.setattr("mrwork.files.open_table.RECORD", replace(RECORD, largest=1000))
    refused(read_damper_test, path)
