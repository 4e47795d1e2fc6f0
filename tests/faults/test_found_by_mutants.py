"""What mutants of the fuzzing harness have found, in its smallest form: one sentence, in little time and memory."""

from __future__ import annotations

import time
import zipfile
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import rig_files
from counted_calls import calls_of
from motion_files import knet_lines
from record_files import clean_columns, write_text
from sentences import Refused
from sinusoidal_tests import MOTIONS, sinusoidal_test
from study_texts import study_text

import mrwork as mr
from mrwork.buildings import read_building
from mrwork.errors import JournalError, MrworkError, MrworkWarning, RecordError
from mrwork.motions import read_motion
from mrwork.records import read_damper_test
from mrwork.store.input_file import RECORD, read_arrays
from mrwork.store.journal import line_of, read_lines
from mrwork.tuning import LawResult
from mrwork.tuning.results import judgement_of_objective
from studies.common.expected import departures


def record(change: Callable[[dict[str, np.ndarray]], None]) -> Callable[[Path], object]:
    """A record whose columns are changed before it is read."""

    def read(folder: Path) -> object:
        columns = clean_columns()
        change(columns)
        return read_damper_test(write_text(folder / "rig.csv", columns))

    return read


def text(name: str, content: str, read: Callable[[Path], object]) -> Callable[[Path], object]:
    def written(folder: Path) -> object:
        (folder / name).write_text(content)
        return read(folder / name)

    return written


def huge(columns: dict[str, np.ndarray]) -> None:
    columns["force_n"][5] = 1e200


def nearly_equal_times(columns: dict[str, np.ndarray]) -> None:
    columns["t_s"][:2] = 0.0, 1e-200


def read_still(path: Path) -> object:
    path.with_name("still.csv").write_text("t_s,acceleration_g\n" + "".join(f"{t},0\n" for t in range(9)))
    return mr.read_study(path)


STILL = ('synthetic = "kanai_tajimi"\nduration = 2', 'file = "still.csv"')
REFUSED = {
    "a force beyond any": record(huge),
    "times that nearly repeat": record(nearly_equal_times),
    "a start of LabVIEW with another decimal sign": text(
        "rig.lvm", rig_files.lvm("No").replace("X0\t0.0", "X0\t0,0"), read_damper_test
    ),
    "a mass without size": text("a.toml", "mass = [[1e-320]]\nstiffness = [[1.0]]", read_building),
    "a stiffness that overflows": text(
        "a.toml", "masses = [1.0, 1.0]\nstiffnesses = [1e308, 1e308]", read_building
    ),
    "damping that overflows": text(
        "a.toml", "masses = [1.0]\nstiffnesses = [1e40]\n[rayleigh]\na0 = 1.0\na1 = 1e300", read_building
    ),
    "expected figures that are no TOML": text("a.toml", "a = = 1", lambda path: departures({}, path)),
    "expected figures without tolerance": text(
        "a.toml", "a = { value = 1.0 }", lambda path: departures({"a": 1.0}, path)
    ),
    "a motion of many hours": text(
        "a.toml",
        study_text("control_weight = 1e-13").replace("duration = 2", "duration = 65536"),
        mr.read_study,
    ),
    "a motion that ends within a sample": text(
        "a.toml",
        study_text("control_weight = 1e-13").replace("= 2", "= 2\ntime_scale = 1e-9"),
        mr.read_study,
    ),
    "a motion without motion": text(
        "a.toml", study_text("control_weight = 1e-13").replace(*STILL), read_still
    ),
    "no constant command with a score": text(
        "a.toml",
        study_text("control_weight = 1e-13", damper="differential = true\nparameters = { k = 1e15 }")
        .replace('law = "clipped', 'law = "best_passive"\n[[controller]]\nlaw = "clipped')
        .replace("= 2", "= 0.1"),
        lambda path: mr.run_study(mr.read_study(path), threads=1),
    ),
    "a rest without end": text(
        "a.toml", study_text("control_weight = 1e-13").replace("= 2", "= 2\nrest = 1e300"), mr.read_study
    ),
    "a rest of many days": text(
        "a.toml", study_text("control_weight = 1e-13").replace("= 2", "= 2\nrest = 1e9"), mr.read_study
    ),
    "realisations without end": text(
        "a.toml",
        study_text("control_weight = 1e-13")
        + "[uncertainty]\nstiffness = 0.1\nrealisations = 9007199254740993\n",
        mr.read_study,
    ),
}


@pytest.mark.parametrize("read", REFUSED.values(), ids=REFUSED)
def test_it_is_refused_in_a_sentence(
    tmp_path: Path, read: Callable[[Path], object], refused: Refused
) -> None:
    refused(read, tmp_path)


def test_a_test_that_moves_with_its_last_sample_only_is_read(tmp_path: Path) -> None:
    columns = clean_columns()
    del columns["velocity_mps"]
    columns["displacement_m"][:-1] *= 1e-6
    assert read_damper_test(write_text(tmp_path / "rig.csv", columns)).n_time == columns["t_s"].size


def test_a_word_that_looks_like_a_number_is_refused_with_its_line(tmp_path: Path) -> None:
    for word in ("\u0131nf", "\u0130NF", "inf\u0131nity", "na\u0274", "1\u04355"):
        path = write_text(tmp_path / "rig.csv", clean_columns())
        lines = path.read_text().splitlines()
        lines.append(",".join([word] * (lines[-1].count(",") + 1)))
        path.write_text("\n".join(lines), encoding="utf-8")
        with pytest.raises(RecordError, match=f"line 402 '{word},"):
            read_damper_test(path)


def test_rows_of_thousands_of_digits_take_no_time(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "a.txt"
    path.write_text("\n".join(3 * ["9" * 200_000 + "x"]))
    began = time.process_time()
    refused(read_motion, path, unit="g", dt=0.01)
    assert time.process_time() - began < 10.0


@pytest.mark.parametrize("letters", ["(", "[", "a(", "( ", " a"])
@pytest.mark.parametrize("columns", ["t_s,acceleration", "t_s,displacement_mm,force"])
def test_names_of_many_letters_take_no_time(tmp_path: Path, letters: str, columns: str) -> None:
    path = tmp_path / "a.csv"
    rows = "\n".join(f"{0.01 * row:.2f}" + columns.count(",") * ",1.0" for row in range(50))
    path.write_text(f"{columns}{letters * 20_000}\n{rows}\n")
    began = time.process_time()
    with pytest.raises(MrworkError) as caught:
        (read_motion if "acceleration" in columns else read_damper_test)(path)
    assert time.process_time() - began < 1.0
    assert len(str(caught.value)) <= 2000


def test_a_long_line_of_a_header_takes_no_time(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "a.NS"
    lines = knet_lines(np.arange(100), "1")
    path.write_text("\n".join(lines).replace("100Hz", "1" * 60_000))
    began = time.process_time()
    refused(read_motion, path)
    assert time.process_time() - began < 1.0


def test_headers_that_are_repeated_often_take_no_time(tmp_path: Path) -> None:
    path = write_text(tmp_path / "rig.csv", clean_columns())
    names, *rows = path.read_text().splitlines()

    def calls(times: int) -> int:
        path.write_text("\n".join([names, *rows, *(times * [names, "a block of a test"]), *rows[:20]]))
        return calls_of(lambda: refused_or_read(path))

    # Eight times as many would be 64 times the work, if each looked at the others.
    assert calls(4000) < 10 * calls(500)


def test_many_ends_of_lines_take_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"t_s,acceleration_g\n" + b"\r" * 60_000 + b"0.0,1.0\r\r\n0.01,2.0\n" + b"\r" * 60_000)
    began = time.process_time()
    assert read_motion(path).acceleration.size == 2
    assert time.process_time() - began < 2.0


def test_a_header_of_arrays_that_python_warns_of_is_refused(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, a=np.zeros(3))
    with zipfile.ZipFile(path) as archive:
        content = archive.read("a.npy")
    for damaged in (content.replace(b"(3,), ", b"(3L,),"), content.replace(b"'<f8'", b"'\\/8'")):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.npy", damaged)
        refused(read_arrays, path, RECORD)


def refused_or_read(path: Path) -> None:
    with suppress(RecordError):
        read_damper_test(path)


def test_what_a_library_says_of_a_cut_file_is_a_warning_of_ours(tmp_path: Path) -> None:
    pytest.importorskip("nptdms", reason="reading TDMS needs npTDMS")
    path = tmp_path / "rig.tdms"
    rig_files.write_tdms(path, rig_files.tdms_channels(wf_increment=0.005))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.warns(MrworkWarning, match="npTDMS reports"):
        refused_or_read(path)


def test_a_journal_with_a_result_of_another_shape_is_refused(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(
        study_text("control_weight = 1e-13").replace("duration = 2", "duration = 0.2")
    )
    study = mr.read_study(tmp_path / "study.toml")
    path = tmp_path / "journal.jsonl"
    with closing(mr.Journal(path)) as journal:
        mr.run_study(study, journal=journal, threads=1)
    entries, _ = read_lines(path.read_bytes(), path)
    number = next(place for place, entry in enumerate(entries) if entry["step"] == "run")
    for forged in (1.5, [], [[1.0]]):
        entries[number]["result"]["peak_displacement"] = forged
        path.write_bytes(b"".join(map(line_of, entries)))
        with (
            closing(mr.Journal(path, resume=True)) as journal,
            pytest.raises(JournalError, match="result of a run"),
        ):
            mr.run_study(study, journal=journal, threads=1)


@pytest.mark.parametrize("engine", ["lanes", "optimistix"])
def test_a_journal_with_a_minimum_out_of_bounds_is_refused(
    tmp_path: Path, engine: Literal["lanes", "optimistix"]
) -> None:
    path = tmp_path / "journal.jsonl"
    test = sinusoidal_test("bingham", (670.0, 5e-3, 5000.0, -95.0), MOTIONS[0], noise=0.02)
    search = mr.search.EfficientGA(population=8, stop=mr.search.StopRules(max_generations=2))
    with closing(mr.Journal(path)) as journal:
        mr.identify("bingham", test, search=search, engine=engine, journal=journal, rng=0)
    entries, _ = read_lines(path.read_bytes(), path)
    forged = next(entry for entry in reversed(entries) if "theta" in entry.get("result", {}))
    forged["result"]["theta"][1] = 0.0
    path.write_bytes(b"".join(map(line_of, entries)))
    with (
        closing(mr.Journal(path, resume=True)) as journal,
        pytest.raises(JournalError, match="outside of the bounds"),
    ):
        mr.identify("bingham", test, search=search, engine=engine, journal=journal, rng=0)


@pytest.mark.parametrize("largest", [[], "", None, {"a": 1}, True])
def test_a_largest_command_that_is_no_number_contradicts_a_tuned_law(largest: object) -> None:
    nominal = judgement_of_objective(1.0)
    law = LawResult(
        law="clipped_optimal",
        label="law",
        settings={"largest_command": 1.0},
        origin="tuned",
        train=nominal,
        test=None,
        candidates=1,
        seconds=0.0,
        certificate="",
        limited=True,
    )
    assert not law.disagreement()
    assert "largest_command" in replace(law, settings={"largest_command": largest}).disagreement()
    assert "largest_command" in replace(law, settings={}).disagreement()


def test_texts_of_arrays_have_characters_that_exist(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / "a.npz"
    for number in (0x10FFFF, 0x110000):
        np.savez(path, facts=np.array([number], "<u4").view("<U1"))
        if number == 0x10FFFF:
            assert read_arrays(path, RECORD)["facts"][0] == chr(number)
        else:
            refused(read_arrays, path, RECORD)


def test_a_building_is_no_taller_than_any(refused: Refused) -> None:
    refused(mr.buildings.shear_building, name="tower", masses=[1e3] * 1001, stiffnesses=[1e6] * 1001)
