"""The smallest files that showed a defect, found by damaged copies: each is read or refused in little time."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rig_files
from motion_files import knet_lines
from record_files import clean_columns, write_text
from refusals import refusal
from study_texts import study_text

import mrwork as mr
from mrwork.motions import read_motion
from mrwork.records import read_damper_test

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


REFUSED: dict[str, tuple[str, str, Callable[[Path], object], str]] = {
    "a force beyond any": ("a.csv", record("force_n", 5, 1e200), read_damper_test, r"line 7: .* 1e\+200"),
    "times that nearly repeat": ("a.csv", record("t_s", 1, 1e-200), read_damper_test, "line 3: .* 1e-200 s"),
    "another decimal sign": ("a.lvm", LVM, read_damper_test, "X0 of the header is '0,0'"),
    "a mass without size": ("a.toml", MASSLESS, mr.buildings.read_building, "9.99989e-321 kg"),
    "hours": ("a.toml", STUDY.replace("= 2", "= 65536"), mr.read_study, "line 9: .* 0.315 GB"),
    "days of rest": ("a.toml", STUDY.replace("= 2", "= 2\nrest = 1e9"), mr.read_study, "line 9: .* GB"),
    "a motion without motion": ("a.toml", STILL, mr.read_study, "'still' is zero throughout"),
    "no score": ("a.toml", BEST.replace("= 2", "= 0.1"), responses, "no constant command has a score"),
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


def test_a_test_that_moves_with_its_last_sample_only_is_read(tmp_path: Path) -> None:
    columns = clean_columns()
    del columns["velocity_mps"]
    columns["displacement_m"][:-1] *= 1e-6
    assert read_damper_test(write_text(tmp_path / "rig.csv", columns)).n_time == columns["t_s"].size
