"""Records in the forms of loggers and programs: without times or names, with events, in other encodings and words."""

from pathlib import Path

import numpy as np
import pytest
from refusals import command_refusal, refusal
from scipy.io import savemat

from mrwork.records import read_damper_test
from mrwork.records.columns import parse_column_option
from tools.faults import planted_rigs
from tools.faults.planted import sweep

# 4 Hz through friction and a dashpot, at 200 Hz.
TIME = 0.005 * np.arange(200)
STROKE = 10.0 * np.sin(8.0 * np.pi * TIME)
SPEED = 80.0 * np.pi * np.cos(8.0 * np.pi * TIME)
FORCE = 400.0 * np.tanh(0.2 * SPEED) + 0.5 * SPEED


def text(names: str, *columns: np.ndarray, delimiter: str = ",") -> list[str]:
    return [names, *(delimiter.join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True))]


def write(path: Path, lines: list[str], encoding: str = "utf-8") -> Path:
    path.write_bytes("\n".join([*lines, ""]).encode(encoding))
    return path


def test_a_record_without_times_takes_a_step_or_a_rate(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", text("Force (N),Stroke (mm)", FORCE, STROKE))
    refusal(read_damper_test, path, match="step or sampling rate, as in --column 'time=200 Hz'")
    for stated in ("200 Hz", "0.005s", "5 ms"):
        test = read_damper_test(path, columns={"time": stated})
        assert (test.dt, test.n_time) == (pytest.approx(0.005, rel=1e-12), 200)
    refusal(read_damper_test, path, columns={"time": "0 s"}, match="above zero")


def test_columns_have_numbers_in_every_format(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"data": np.stack([TIME, STROKE, FORCE], axis=1)})
    write(tmp_path / "b.csv", text("A,B,C", TIME, STROKE, FORCE))
    columns = {"time": "1:s", "displacement": "2:mm", "force": "3:N"}
    for name in ("a.mat", "b.csv"):
        test = read_damper_test(tmp_path / name, columns=columns)
        assert np.allclose(test.displacement, 1e-3 * STROKE, atol=1e-8)
        assert np.allclose(test.force, FORCE, atol=1e-2)
    refusal(read_damper_test, tmp_path / "a.mat", match="by their numbers, likely --column time=1:s")


def test_a_column_is_left_out_by_quantity_or_heading(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", text("t_s,x_mm,F_N,v_mps", TIME, STROKE, FORCE, 0.3 * SPEED))
    for name in ("velocity", "v_mps", "v"):
        assert read_damper_test(path, columns={name: "none"}).velocity_source == "derived"
    refusal(parse_column_option, "force=none", match="force cannot be left out")


@pytest.mark.parametrize("mark", ["EVENT 3", "Start,,", "1205,Switched from 1 to 2,", "% step 2", "Mark,3,7"])
@pytest.mark.parametrize("place", [3, 60])
def test_marker_lines_are_told_together_and_skipped_by_one_answer(
    tmp_path: Path, mark: str, place: int
) -> None:
    lines = text("t_s,x_mm,F_N", TIME, STROKE, FORCE)
    path = write(tmp_path / "a.csv", [*lines[:place], mark, *lines[place:100], mark, *lines[100:]])
    refusal(read_damper_test, path, match=f"2 lines .*line {place + 1} '.*line 102 '.*--column markers=skip")
    test = read_damper_test(path, columns={"markers": "skip"})
    assert test.n_time == 200
    assert any(f"line {place + 1}" in each.message for each in test.remarks)
    assert np.allclose(test.displacement, 1e-3 * STROKE, atol=1e-8)


@pytest.mark.parametrize(
    ("row", "word"),
    [
        ("0.245,overload,3.2", "line 61, column 'x_mm' holds 'overload'"),
        ("0.3,-3.45e-06", "line 61 has 2 fields"),
    ],
)
def test_a_wrong_row_is_no_marker(tmp_path: Path, row: str, word: str) -> None:
    lines = text("t_s,x_mm,F_N", TIME, STROKE, FORCE)
    path = write(tmp_path / "a.csv", [*lines[:60], row, *lines[61:]])
    refusal(read_damper_test, path, columns={"markers": "skip"}, match=word)


@pytest.mark.parametrize(("unit", "scale"), [("ms", 1e3), ("us", 1e6)])
def test_a_slow_clock_beside_a_velocity_is_named_first(tmp_path: Path, unit: str, scale: float) -> None:
    path = write(tmp_path / "a.csv", text("t_s,x_mm,F_N,v_mmps", scale * TIME, STROKE, FORCE, SPEED))
    (remark,) = [each for each in read_damper_test(path).remarks if each.code == "time_factor"]
    assert f"a time in {unit} is taken for one in s" in remark.message
    # Without the velocity the time is as wrong as with it.
    arguments = ("identify", path, "--repair", "velocity", "--out", tmp_path / "out")
    command_refusal(*arguments, match=f"time=COLUMN:{unit}")


NAMES = [
    ("Zeit [s];Kolbenweg [mm];Dämpferkraft [N];Spulenstrom [A]", "cp1252"),
    ("時間(s);ピストン変位(mm);減衰力(N);コイル電流(A)", "cp932"),
    ("時間（s）;変位（㎜）;荷重（N）;電流（A）", "utf-8-sig"),
    ("时间(s);位移(mm);阻尼力(N);控制电流(A)", "gb18030"),
    ("Temps (s);Déplacement du piston (mm);Force (N);Courant (A)", "utf-16"),
    ("Tiempo (s);Desplazamiento (mm);Fuerza (N);Corriente (A)", "latin-1"),
]


@pytest.mark.parametrize(("names", "encoding"), NAMES)
def test_words_of_the_field_are_known_in_their_encodings(tmp_path: Path, names: str, encoding: str) -> None:
    lines = text(names, TIME, STROKE, FORCE, np.full(200, 0.5), delimiter=";")
    test = read_damper_test(write(tmp_path / "a.csv", lines, encoding))
    assert (test.n_time, test.current, test.dt) == (200, 0.5, pytest.approx(0.005))
    assert np.allclose(test.displacement, 1e-3 * STROKE, atol=1e-8)
    said = [each.message for each in test.remarks if each.code == "encoding"]
    assert len(said) == ((encoding not in ("utf-8-sig",) and not names.isascii()) or encoding == "utf-16")


def test_other_quantities_with_the_end_of_a_word_are_not_taken_for_it(tmp_path: Path) -> None:
    for name in ("Sollweg (mm)", "目標変位(mm)", "Stroke error (mm)"):
        lines = text(f"Zeit (s);{name};Kraft (N)", TIME, STROKE, FORCE, delimiter=";")
        refusal(read_damper_test, write(tmp_path / "a.csv", lines), match="no column for the displacement")


def test_a_name_is_found_however_its_characters_are_written(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", text("t_s,x_mm,\N{NO-BREAK SPACE}Da\u0308mpfer  F", TIME, STROKE, FORCE))
    test = read_damper_test(path, columns={"force": "Dämpfer F:N"})
    assert np.allclose(test.force, FORCE, atol=1e-2)


def test_a_name_with_two_commands_is_asked_about(tmp_path: Path) -> None:
    path = write(tmp_path / "sweep_0A_to_2A.csv", text("t_s,x_mm,F_N", TIME, STROKE, FORCE))
    test = read_damper_test(path)
    assert not test.commands
    assert any("says 0 A and 2 A" in each.message for each in test.remarks)


@pytest.mark.long
def test_planted_faults_are_told_and_honest_rigs_are_silent() -> None:
    told, alarms = sweep(planted_rigs.FAULTS, planted_rigs.honest, len(planted_rigs.FAULTS))
    assert alarms == []
    # A rig of each of eleven kinds, of which one may be missed.
    assert float(np.mean([*told.values()])) > 0.9
