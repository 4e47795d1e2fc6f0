"""A folder of eleven odd files: each is read without an option, or refused with a sentence that can be pasted."""

from __future__ import annotations

import importlib.util
import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork
from numpy.typing import NDArray
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, workbook
from record_files import DT, FREQUENCY, codes, message
from rig_files import HEAD
from scipy.io import savemat
from sentences import Refused

from mrwork.errors import UnitError
from mrwork.records import parse_column_option, read_damper_test

ONES = np.ones_like(TIME)
STEPPED = np.where(TIME < 1.0, 0.2, 0.8)
POUND = 4.4482216152605


def rows(*columns: NDArray[np.float64], delimiter: str, comma: bool = False) -> list[str]:
    lines = [delimiter.join(repr(float(cell)) for cell in row) for row in zip(*columns, strict=True)]
    return [line.replace(".", ",") for line in lines] if comma else lines


def labview() -> str:
    """A .lvm of three channels, the last of which is the command."""
    head = HEAD.format(point=".", columns="One")
    n, dt = TIME.size, DT
    head += f"Channels\t3\nSamples\t{n}\t{n}\t{n}\nY_Unit_Label\tmm\tkN\tA\nX_Dimension\tTime\tTime\tTime\n"
    head += (
        f"X0\t0\t0\t0\nDelta_X\t{dt}\t{dt}\t{dt}\n***End_of_Header***\nX_Value\tLVDT\tCell\tI_set\tComment\n"
    )
    return head + "\n".join(rows(TIME, MM, KN, 0.75 * ONES, delimiter="\t")) + "\n"


def write_folder(folder: Path) -> Path:
    folder.mkdir()
    metric = [
        "Station: damper 3", "Started\t2024-05-01 12:00:00", "Rate\t200\tHz", "",
        "Time [s]\tLVDT [mm]\tCell [kN]\tShunt [A]\tTemp [degC]",
        *rows(TIME, MM, KN, 0.5 * ONES, 20.0 * ONES, delimiter="\t"),
    ]  # fmt: skip
    american = [
        '"Test","rig 3"', '"Limits",-10,10', "", "Elapsed Time,Stroke,Axial Load,I_set", 'sec,",lbs,A',
        *rows(TIME, MM / 25.4, NEWTON / POUND, 0.25 * ONES, delimiter=","),
    ]  # fmt: skip
    german = ["Zeit;Weg;Kraft;Strom", "s;mm;kN;A", *rows(TIME, MM, KN, 1.5 * ONES, delimiter=";", comma=True)]
    milli = ["t_s,disp_mm,force_N,current_mA", *rows(TIME, MM, NEWTON, 500.0 * ONES, delimiter=",")]
    varying = ["t_s,disp_mm,force_N,current_A", *rows(TIME, MM, NEWTON, STEPPED, delimiter=",")]
    texts = {
        "metric.txt": metric, "american.csv": american, "german.csv": german, "milli.csv": milli,
        "varying.csv": varying, "notes.csv": ["name,remark", "A,first", "B,second"],
    }  # fmt: skip
    for name, lines in texts.items():
        (folder / name).write_text("\n".join(lines) + "\n", encoding="latin-1")
    (folder / "test_0A.lvm").write_text(labview())
    savemat(folder / "struct.mat", {"rig": {"time_s": TIME, "disp_mm": MM, "force_kN": KN, "notes": "a"}})
    savemat(folder / "plain.mat", {"t": TIME, "x": MM, "F": NEWTON})
    (folder / "damaged.mat").write_bytes((folder / "struct.mat").read_bytes()[:3000])
    table = [
        ["Zeit", "Weg", "Kraft"],
        ["ms", "mm", "tf"],
        *zip(1e3 * TIME, MM, NEWTON / 9806.65, strict=True),
    ]
    (folder / "book.xlsx").write_bytes(workbook({"Info": [["rig", "3"]], "Messung": table}))
    return folder


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What is known of a file that is read: the current [A], and the note on what is not used."""

    current: float | NDArray[np.float64] | None = None
    unused: str = ""


READ: Mapping[str, Truth] = {
    "metric.txt": Truth(current=0.5, unused="column 'Temp [degC]'"),
    "american.csv": Truth(current=0.25),
    "test_0A.lvm": Truth(current=0.75),
    "struct.mat": Truth(unused="variable 'notes' (no vector of numbers)"),
    "german.csv": Truth(current=1.5),
    "milli.csv": Truth(current=0.5),
    "varying.csv": Truth(current=STEPPED),
    "book.xlsx": Truth(unused="sheet 'Info'"),
}
needs_calamine = pytest.mark.skipif(
    importlib.util.find_spec("python_calamine") is None, reason="reading .xlsx needs python-calamine"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_folder(tmp_path / "odd")


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=needs_calamine) if each.endswith("xlsx") else each for each in READ]
)
def test_an_odd_file_is_read_without_an_option_to_its_known_values(folder: Path, name: str) -> None:
    test, truth = read_damper_test(folder / name), READ[name]
    assert_is_the_test(test)
    if truth.current is None:
        assert test.commands == ()
    else:
        np.testing.assert_allclose(test.current, truth.current, rtol=1e-12)
    assert test.voltage is None
    assert (message(test, "not_used") if truth.unused else "") == (
        f"not used: {truth.unused}" if truth.unused else ""
    )
    known = {"velocity_derived", "not_used", "command_varies"}
    # That name says 0 A.
    assert set(codes(test)) <= known | ({"name_disagrees"} if name == "test_0A.lvm" else set())
    assert test.n_time * test.dt * FREQUENCY == pytest.approx(4.0, rel=1e-6)


def test_arrays_without_units_are_refused_with_options_that_read_them(folder: Path) -> None:
    with pytest.raises(UnitError) as refusal:
        read_damper_test(folder / "plain.mat")
    said = str(refusal.value)
    words = shlex.split(said[said.index("--column") :])
    assert words == ["--column", "time=t:s", "--column", "displacement=x:mm", "--column", "force=F:N"]
    columns = dict(map(parse_column_option, words[1::2]))
    assert_is_the_test(read_damper_test(folder / "plain.mat", columns=columns))
    ended = mrwork("check", folder / "plain.mat", *words)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_what_is_damaged_or_no_record_is_refused_in_a_sentence(folder: Path, refused: Refused) -> None:
    for name in ("damaged.mat", "notes.csv"):
        refused(read_damper_test, folder / name)


@needs_calamine
def test_check_reads_the_folder_and_says_each_refusal_once(folder: Path) -> None:
    ended = mrwork("check", folder, "--json")
    rows_of_files = {Path(row["file"]).name: row for row in json.loads(ended.stdout)["files"]}
    assert set(rows_of_files) == {*READ, "plain.mat", "damaged.mat", "notes.csv"}
    assert {name for name, row in rows_of_files.items() if "error" in row} == set(rows_of_files) - set(READ)
    assert ended.returncode == 2
    assert len(ended.stderr.splitlines()) == 3
    assert "a library reports" not in ended.stderr
