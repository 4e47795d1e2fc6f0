"""A study takes a law from a program; it names the program before it starts, and has the numbers of the registry's."""

import json
import stat
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import mrwork, printed
from outside_controllers import CONTROLLER, RIGHT, build, compiled
from refusals import refusal

import mrwork as mr
from mrwork.dampers.simulation import Outcome

STUDY = """[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"

[[motion]]
synthetic = "kanai_tajimi"
duration = 0.2

[[controller]]
process = {{ program = ["./controller"], readings = ["rate"]{more} }}
"""
NAMED = "mrwork: study.toml, line 13: running ./controller for commands\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a study of a controller, in which commands run."""
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(folder: Path, text: str = RIGHT, more: str = "") -> None:
    program = folder / "controller"
    program.write_text(f"#!{sys.executable} -S\n{CONTROLLER}{text}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    (folder / "study.toml").write_text(STUDY.format(more=more))


@compiled
def test_a_row_of_a_controller_with_an_observer_is_that_of_the_registry(tmp_path: Path) -> None:
    given = {
        "building": {"published": "uts"},
        "dampers": [{"storey": 1, "preset": "kwok2006", "differential": True}],
        "motions": [mr.synthetic_motion(rng=seed, duration=3.0, peak=2.0, name=f"{seed}") for seed in (3, 4)],
        "hardware": {
            "feedback": "observer",
            "acceleration_noise": 0.02,
            "force_noise": "1 N",
            "delay": "1 ms",
        },
        "references": "none",
    }
    law = {"law": "clipped_optimal", "settings": {"energy": 1.0, "control_weight": 1e-8}}
    row = mr.study_of(laws=[law], **given).arrangements[-1]
    hardware = mr.study_of(laws=[law], **given).hardware
    program = build(tmp_path, row.building, row.devices, row.law, hardware)
    outside = mr.closed_loop.ProcessLaw(name="outside", program=[str(program)])
    study = mr.study_of(laws=[law, outside], **given)
    results = mr.run_study(study, threads=1)
    *_, ours, theirs = range(len(study.arrangements))
    assert study.arrangements[theirs].row.label == "outside"
    for motion in range(2):
        one, other = (results.quantities.at(number, motion) for number in (ours, theirs))
        assert one["command_travel"][0] > 0.0
        for name, values in one.items():
            np.testing.assert_array_equal(other[name], values, err_msg=name)
    assert study.arrangements[theirs].law.round_trips.messages == 6000


def test_the_program_is_named_before_it_starts_and_is_found_beside_the_study(folder: Path) -> None:
    mark = folder / "started"
    write(folder, f"    open({str(mark)!r}, 'w')\n{RIGHT}")
    mr.read_study(folder / "study.toml")
    assert not mark.exists()
    ended = mrwork("respond", "study.toml", "--out", "run", "--json", "--quiet")
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr.startswith(NAMED)
    assert mark.exists()
    rows = json.loads((folder / "run" / "results.json").read_text())["rows"]
    assert [row["label"] for row in rows if row["kind"] == "controller"] == ["controller"]


def test_an_edited_program_is_not_resumed(folder: Path) -> None:
    printed("respond", "study.toml", "--out", "run", "--quiet")
    moved = folder / "moved"
    moved.mkdir()
    write(moved)
    printed("respond", "moved/study.toml", "--out", "run", "--quiet", "--resume")
    write(folder, RIGHT.replace("10.0", "11.0"))
    assert "arrangement" in printed("respond", "study.toml", "--out", "run", "--quiet", "--resume", status=2)


def test_a_program_that_ends_is_told_by_its_row(folder: Path) -> None:
    write(folder, f"    if sample == 50: sys.exit(0)\n{RIGHT}")
    study = mr.read_study(folder / "study.toml")
    results = mr.run_study(study, threads=1)
    assert results.quantities.outcome[-1, 0, 0] == Outcome.FAILED_SAFE
    assert any("its controller gave no command" in remark.message for remark in results.remarks)


def test_a_program_that_does_not_begin_ends_the_study(folder: Path) -> None:
    (folder / "controller").unlink()
    refusal(
        mr.run_study, mr.read_study(folder / "study.toml"), match="controller does not start: .*No such file"
    )


def test_a_study_of_a_process_is_written_and_read(folder: Path) -> None:
    study = mr.study_of(
        building={"published": "uts"},
        dampers=[{"storey": 1, "preset": "kwok2006"}],
        motions=[mr.synthetic_motion(duration=0.1)],
        laws=[
            mr.closed_loop.ProcessLaw(name="mine", address=("localhost", 4000), readings=["force", "rate"])
        ],
    )
    study.to_toml(folder / "again.toml")
    law, again = (each.arrangements[-1].law for each in (study, mr.read_study(folder / "again.toml")))
    assert law == again
    assert again.readings == ("rate", "force")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (", timeout = 0", "line 13: .*timeout"),
        (', address = ["localhost", 4000]', "line 13: .*both a program and an address"),
        (" }\nlaw = 'fuzzy' #", "line 14: .*a law outside Python has no law; leave it out"),
        (
            ' }\nuser = { file = "a.py", function = "f"',
            "line 14: .*a law outside Python has no user; leave it out",
        ),
    ],
)
def test_a_process_that_is_none_is_refused_with_its_line(folder: Path, more: str, words: str) -> None:
    write(folder, more=more)
    refusal(mr.read_study, folder / "study.toml", match=words)
