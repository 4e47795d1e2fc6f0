"""A killed run is not begun anew without leave; a complete one has nothing to resume: the same words of every verb."""

from __future__ import annotations

import json
import shutil
import signal
from contextlib import closing
from pathlib import Path

import pytest
import tuning_samples
from command_line import COMMAND, mrwork, started, wait_until
from record_files import write_test
from refusals import command_refusal
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.errors import JournalError
from mrwork.store.journal import n_steps

FIT = ("identify", "rig", "--model", "viscous_dahl", "--fix", "k_x=800", "--every", "4", "--threads", "1")
LINES = {
    "identify": ("identify", "rig", "--model", "bouc_wen", "--threads", "1", "--out", "run"),
    "laws": (*FIT, "--law", "auto", "--out", "run"),
    "models": (*FIT[:2], "--model", "viscous_dahl,dahl", *FIT[-4:], "--out", "run"),
    "respond": ("respond", "tuned.toml", "--motions", "all", "--threads", "1", "--out", "run"),
    "tune": ("tune", "tuned.toml", "--threads", "1", "--out", "run"),
    "sample": ("sample", "fit", "--walkers", "16", "--steps", "300", "--threads", "1"),
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig of three motions at two commands, a study to be tuned, and a fit."""
    place = tmp_path_factory.mktemp("inputs")
    tuning_samples.small_files(place)
    (place / "rig").mkdir()
    for number, motion in enumerate(MOTIONS[:3]):
        for command in (0.0, 1.0):
            theta = (800.0, 200.0 + 480.0 * command, 2000.0, 20.0)
            test = sinusoidal_test(
                "viscous_dahl", theta, motion, noise=0.02, rng=number, cycles=5, command=command
            )
            write_test(place / "rig" / f"motion{number}_{command:g}A.csv", test)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        assert mrwork(*FIT, "--out", "fit", "--quiet").returncode == 0
    return place


@pytest.fixture
def folder(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = Path(shutil.copytree(inputs, tmp_path / "work"))
    monkeypatch.chdir(place)
    return place


def steps(folder: Path) -> int:
    """Steps that an unfinished run has recorded, wherever it keeps them."""
    return sum(n_steps(path) for pattern in ("*.jsonl", "*.jsonl.part") for path in folder.rglob(pattern))


def contents(folder: Path) -> dict[Path, bytes]:
    return {
        path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and ".lock" not in path.name
    }


@pytest.mark.machine
@pytest.mark.parametrize("name", ["identify", "models", "respond", "tune", "sample"])
def test_a_killed_run_is_resumed_by_leave_only_and_a_complete_one_has_nothing_to_resume(
    name: str, folder: Path
) -> None:
    line = LINES[name]
    before = steps(folder)
    with started(*COMMAND, *line) as process:
        wait_until(lambda: steps(folder) > before + 2, process)
        process.send_signal(signal.SIGKILL)
        process.communicate()
    kept = contents(folder)
    ended = mrwork(*line)
    assert (ended.returncode, ended.stdout) == (2, "")
    (sentence,) = ended.stderr.splitlines()[-1:]
    assert "--resume" in sentence
    assert "--replace" in sentence
    assert contents(folder) == kept
    assert mrwork(*line, "--resume").returncode == 0
    results = {path: content for path, content in contents(folder).items() if path.name == "journal.jsonl"}
    ended = mrwork(*line, "--resume", "--json")
    assert ended.returncode == 0
    assert "is complete; nothing to resume" in ended.stderr
    assert json.loads(ended.stdout)
    assert contents(folder).items() >= results.items()


@pytest.mark.machine
def test_an_interrupted_run_in_its_folder_is_kept_until_replaced(folder: Path) -> None:
    line = (*LINES["identify"], "--search", "genetic", "--population", "16", "--generations", "30")
    before = steps(folder)
    with started(*COMMAND, *line) as process:
        wait_until(lambda: steps(folder) > before + 5, process)
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert json.loads(Path("run/manifest.json").read_text())["status"] == "interrupted"
    command_refusal(*line, match="--replace")
    assert mrwork(*line, "--replace").returncode == 0
    assert json.loads(Path("run/manifest.json").read_text())["status"] != "interrupted"
    # A complete run of the same verb is replaced as before.
    assert mrwork(*line).returncode == 0


def test_a_complete_comparison_of_other_tests_is_not_taken_for_this_one(folder: Path) -> None:
    line = LINES["laws"]
    assert mrwork(*line).returncode == 0
    other = [word.replace("rig", "rig/motion0_0A.csv") for word in line]
    command_refusal(*other, "--resume", match="is of other tests")


def test_a_journal_in_python_is_continued_or_replaced_by_leave_only(tmp_path: Path) -> None:
    path, done = tmp_path / "steps.jsonl", []

    def run(journal: mr.Journal, n_steps: int) -> None:
        with closing(journal):
            journal.agree("run", {"seed": 1})
            for step in range(n_steps):
                digest = str(step)
                if journal.recall("step", digest, lambda record: record) is None:
                    done.append(step)
                    journal.record("step", digest, {"value": 1.0})

    run(mr.Journal(path), 0)
    # With its header alone it has nothing to lose.
    run(mr.Journal(path), 2)
    with pytest.raises(JournalError, match=r"2 steps .* resume=True, .* replace=True"):
        mr.Journal(path)
    run(mr.Journal(path, resume=True), 3)
    assert done == [0, 1, 2]
    run(mr.Journal(path, replace=True), 1)
    assert done == [0, 1, 2, 0]
    assert n_steps(path) == 1
