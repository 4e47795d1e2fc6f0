"""The smallest files that showed a defect, found by damaged copies: each is read or refused in little time."""

from __future__ import annotations

import time
import zipfile
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest
import rig_files
from counted_calls import calls_of
from motion_files import knet_lines
from record_files import clean_columns, write_text
from refusals import refusal
from sinusoidal_tests import MOTIONS, sinusoidal_test
from study_texts import study_text

import mrwork as mr
from mrwork.errors import JournalError, RecordError
from mrwork.motions import read_motion
from mrwork.records import read_damper_test
from mrwork.store.input_file import RECORD, read_arrays
from mrwork.store.journal import line_of, read_lines

STUDY = study_text("control_weight = 1e-13")
STIFF = study_text("control_weight = 1e-13", damper="differential = true\nparameters = { k = 1e15 }")
BEST = STIFF.replace('law = "clipped', 'law = "best_passive"\n[[controller]]\nlaw = "clipped')
STILL = STUDY.replace('synthetic = "kanai_tajimi"\nduration = 2', 'file = "still.csv"')
LVM = rig_files.lvm("No").replace("X0\t0.0", "X0\t0,0")
KNET = "\n".join(knet_lines(np.arange(100), "1")).replace("100Hz", "1" * 60_000)
MASSLESS = "mass = [[1e-320]]\nstiffness = [[1.0]]"


def record(column: str, place: int, number: float) -> str:
    """A record with another number in one place."""
    columns = clean_columns()
    columns[column][place] = number
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(repr, map(float, row))) for row in rows)])


def responses(path: Path) -> object:
    return mr.run_study(mr.read_study(path), threads=1)


def numbers(path: Path) -> object:
    return read_motion(path, unit="g", dt=0.01)


REFUSED: dict[str, tuple[str, str, Callable[[Path], object], str]] = {
    "a force beyond any": ("a.csv", record("force_n", 5, 1e200), read_damper_test, r"line 7: .* 1e\+200"),
    "times that nearly repeat": ("a.csv", record("t_s", 1, 1e-200), read_damper_test, "line 3: .* 1e-200 s"),
    "another decimal sign": ("a.lvm", LVM, read_damper_test, "X0 of the header is '0,0'"),
    "a mass without size": ("a.toml", MASSLESS, mr.buildings.read_building, "9.99989e-321 kg"),
    "hours": ("a.toml", STUDY.replace("= 2", "= 65536"), mr.read_study, "line 9: .* 0.315 GB"),
    "less than a sample": (
        "a.toml",
        STUDY.replace("= 2", "= 2\ntime_scale = 1e-9"),
        mr.read_study,
        "2e-09 s",
    ),
    "days of rest": ("a.toml", STUDY.replace("= 2", "= 2\nrest = 1e9"), mr.read_study, "line 9: .* GB"),
    "a motion without motion": ("a.toml", STILL, mr.read_study, "'still' is zero throughout"),
    "no score": ("a.toml", BEST.replace("= 2", "= 0.1"), responses, "no constant command has a score"),
    "thousands of digits": ("a.txt", "\n".join(3 * ["9" * 200_000 + "x"]), numbers, "64 KiB"),
    "a long line of a header": ("a.NS", KNET, read_motion, "Sampling Freq"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_soon(tmp_path: Path, name: str) -> None:
    file, text, read, word = REFUSED[name]
    (tmp_path / "still.csv").write_text("t_s,acceleration_g\n" + "".join(f"{t},0\n" for t in range(9)))
    (tmp_path / file).write_text(text)
    began = time.process_time()
    refusal(read, tmp_path / file, match=word)
    assert time.process_time() - began < 5.0


@pytest.mark.parametrize(
    ("names", "read"), [("t_s,acceleration", read_motion), ("t_s,displacement_mm,force", read_damper_test)]
)
def test_names_of_many_letters_take_no_time(
    tmp_path: Path, names: str, read: Callable[[Path], object]
) -> None:
    rows = "\n".join(f"{0.01 * row:.2f}" + names.count(",") * ",1.0" for row in range(50))
    for letters in ("(", "a("):
        (tmp_path / "a.csv").write_text(f"{names}{letters * 20_000}\n{rows}\n")
        began = time.process_time()
        assert len(str(refusal(read, tmp_path / "a.csv", match="a.csv"))) <= 2000
        assert time.process_time() - began < 1.0


def test_headers_that_are_repeated_often_take_no_time(tmp_path: Path) -> None:
    path = write_text(tmp_path / "rig.csv", clean_columns())
    names, *rows = path.read_text().splitlines()

    def refused_or_read() -> None:
        with suppress(RecordError):
            read_damper_test(path)

    def calls(times: int) -> int:
        path.write_text("\n".join([names, *rows, *(times * [names, "a block of a test"]), *rows[:20]]))
        return calls_of(refused_or_read)

    # Eight times as many would be 64 times the work, if each looked at the others.
    assert calls(4000) < 10 * calls(500)


def test_many_ends_of_lines_take_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"t_s,acceleration_g\n" + b"\r" * 60_000 + b"0.0,1.0\r\r\n0.01,2.0\n" + b"\r" * 60_000)
    began = time.process_time()
    assert read_motion(path).acceleration.size == 2
    assert time.process_time() - began < 2.0


def test_a_test_that_moves_with_its_last_sample_only_is_read(tmp_path: Path) -> None:
    columns = clean_columns()
    del columns["velocity_mps"]
    columns["displacement_m"][:-1] *= 1e-6
    assert read_damper_test(write_text(tmp_path / "rig.csv", columns)).n_time == columns["t_s"].size


@pytest.mark.parametrize("word", ["\u0131nf", "na\u0274", "1\u04355"])
def test_a_word_that_looks_like_a_number_is_refused_with_its_line(tmp_path: Path, word: str) -> None:
    path = write_text(tmp_path / "rig.csv", clean_columns())
    path.write_text(path.read_text() + ",".join(4 * [word]), encoding="utf-8")
    refusal(read_damper_test, path, match=f"line 402 '{word},")


def test_a_header_of_arrays_that_python_warns_of_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, a=np.zeros(3))
    with zipfile.ZipFile(path) as archive:
        content = archive.read("a.npy")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", content.replace(b"(3,), ", b"(3L,),"))
    refusal(read_arrays, path, RECORD, match="is damaged")


def test_a_journal_with_a_result_of_another_shape_is_refused(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(STUDY.replace("duration = 2", "duration = 0.2"))
    study, path = mr.read_study(tmp_path / "study.toml"), tmp_path / "journal.jsonl"
    with closing(mr.Journal(path)) as journal:
        mr.run_study(study, journal=journal, threads=1)
    entries, _ = read_lines(path.read_bytes(), path)
    run = next(entry for entry in entries if entry["step"] == "run")
    for forged in (1.5, [], [[1.0]]):
        run["result"]["peak_displacement"] = forged
        path.write_bytes(b"".join(map(line_of, entries)))
        with closing(mr.Journal(path, resume=True)) as journal:
            refusal(mr.run_study, study, journal=journal, threads=1, match="result of a run")


def test_a_journal_with_a_minimum_out_of_bounds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    test = sinusoidal_test("bingham", (670.0, 5e-3, 5000.0, -95.0), MOTIONS[0], noise=0.02)
    search = mr.search.EfficientGA(population=8, stop=mr.search.StopRules(max_generations=2))
    with closing(mr.Journal(path)) as journal:
        mr.identify("bingham", test, search=search, journal=journal)
    entries, _ = read_lines(path.read_bytes(), path)
    forged = next(entry for entry in reversed(entries) if "theta" in entry.get("result", {}))
    forged["result"]["theta"][1] = 0.0
    path.write_bytes(b"".join(map(line_of, entries)))
    journal = mr.Journal(path, resume=True)
    with closing(journal), pytest.raises(JournalError, match="outside of the bounds"):
        mr.identify("bingham", test, search=search, journal=journal)
