"""The page and summary of any folder, and a folder of tests that becomes one."""

import io
import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import mrwork, printed
from record_files import write_text
from refusals import command_refusal

import mrwork as mr

HELD_OUT = ("synthetic:spencer1997_slow", "--every", "40")


@pytest.fixture(scope="module")
def folder(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two fits, of which one has predicted a held-out test, a study and a tuning."""
    place = tmp_path_factory.mktemp("compare")
    for name, verb in (("one", "identify"), ("other", "identify"), ("study", "respond"), ("tuned", "tune")):
        shutil.copytree(runs / verb, place / name)
    printed("predict", place / "one", *HELD_OUT, "--quiet")
    return place


@pytest.mark.words
@pytest.mark.parametrize("name", ["one", "study", "tuned"])
def test_every_folder_has_a_page_and_a_summary(folder: Path, name: str) -> None:
    place = folder / name
    before = (place / "report.html").read_text()
    assert mr.report.write_page(place).read_text() == before
    summary = mr.report.write_page(place, summary=True)
    assert summary.name == "summary.html"
    assert "<details>" not in summary.read_text()
    ended = mrwork("report", place, "--summary", "--open")
    assert ended.returncode == 0


@pytest.mark.long
def test_a_folder_of_tests_becomes_a_damper_or_a_question(tmp_path: Path) -> None:
    rig = tmp_path / "rig"
    printed("init", "rig", rig)
    for each in ("tests.csv", *(path.name for path in rig.glob("8mm*"))):
        (rig / each).unlink()
    strange = "time,temp\n0,21\n1,22\n2,22\n"
    (rig / "temperature.csv").write_text(strange)
    ended = mrwork("characterise", rig, "--out", tmp_path / "out", "--json")
    assert ended.returncode == 2
    assert "temperature.csv" in json.loads(ended.stdout)["ask"]
    assert not (tmp_path / "out").exists()
    table = (rig / "tests.csv").read_text()
    assert table.count(",test,") == 2
    (rig / "tests.csv").write_text(table.replace("temperature.csv,fit,?,?,?", "temperature.csv,unused,,,"))
    found = json.loads(
        printed("characterise", rig, "--model", "viscous_dahl", "--out", tmp_path / "out", "--json")
    )
    assert found["uses"]["test"] == 2
    assert "velocity_derived" in {remark["code"] for remark in found["test_remarks"]}
    assert found["held_out"]["worst_percent"] > 85.0
    assert found["verdict"].startswith("Predicts 2 tests kept for test")
    assert Path(found["summary"]).is_file()
    assert not (tmp_path / "data").exists()


class Terminal(io.StringIO):
    """A stderr on which progress is one line, written again and again."""

    def isatty(self) -> bool:
        return True


def test_strokes_of_one_way_are_not_characterised_and_it_is_said_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for speed in (0.01, 0.02, 0.1):
        time = np.arange(0.0, 0.04 / speed, 0.005)
        force = 60.0 + 2000.0 * speed + 1500.0 * speed * time
        columns = {"t_s": time, "displacement_m": speed * time, "force_n": force}
        (tmp_path / "rig").mkdir(exist_ok=True)
        write_text(tmp_path / "rig" / f"{1e3 * speed:.0f}mmps.csv", columns)
    monkeypatch.setattr("command_line.io", SimpleNamespace(StringIO=Terminal))
    words = ("characterise", tmp_path / "rig", "--out", tmp_path / "out")
    said = [
        command_refusal(*words, *quiet, match="no test to fit turns back") for quiet in ((), ("--quiet",))
    ]
    assert ["\r" in each for each in said] == [True, False]


def test_a_test_that_is_kept_is_compared_with_the_others_before_a_fit(tmp_path: Path) -> None:
    """Without it, of two tests at one command neither is known to be wrong."""
    rig = tmp_path / "rig"
    rig.mkdir()
    time = np.arange(0.0, 4.0, 0.005)
    for number in range(5):
        speed = 2.0 * np.pi * (0.8 + 0.1 * number)
        x, v = 0.01 * np.sin(speed * time), 0.01 * speed * np.cos(speed * time)
        force = (3.0 if number == 2 else 1.0) * (200.0 * np.tanh(v / 0.005) + 900.0 * v)
        record = {"t_s": time, "displacement_m": x, "force_n": force, "current_a": np.full(time.size, 0.5)}
        write_text(rig / f"sine{number}.csv", record)
    strokes = {"t_s": time, "displacement_m": 0.01 * time, "force_n": 60.0 + 10.0 * time}
    write_text(rig / "stroke.csv", strokes)
    columns = "t_s:s,displacement_m:m,force_n:N,"
    rows = [f"sine{number}.csv,test,{columns},current_a:A," for number in range(5)]
    table = ["file,use,time,displacement,force,velocity,command,doubt", f"stroke.csv,fit,{columns},,", *rows]
    (rig / "tests.csv").write_text("\n".join(table) + "\n")
    said = command_refusal("characterise", rig, "--out", tmp_path / "out", match="no test to fit turns back")
    assert len(re.findall(r"dissipates \d+ % more", said)) == 1
    assert re.search(r"sine2.csv: dissipates \d+ % more than the other tests at 0.5 A", said)
