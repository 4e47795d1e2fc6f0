"""What would be lost is said before a verb computes: a killed run, a run of another verb, and what was added to one."""

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
from verb_folders import words

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
    return sum(n_steps(path) for pattern in ("*.jsonl", "*.jsonl.new") for path in folder.rglob(pattern))


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


VERBS = ("identify", "respond", "tune")
# What a verb writes beside its manifest, journal and page, of which a sentence names the first files.
OWN_FILE = {"identify": "fit.json", "respond": "results.json", "tune": "chosen.toml"}


@pytest.fixture(scope="module")
def small_inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("inputs")
    tuning_samples.small_files(place)
    return place


@pytest.fixture(scope="module")
def runs(small_inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder of each verb, by its name."""
    place = tmp_path_factory.mktemp("runs")
    for verb in VERBS:
        assert mrwork(*words(verb, small_inputs), "--out", place / verb).returncode == 0
    return place


@pytest.fixture
def run_folder(request: pytest.FixtureRequest, runs: Path, tmp_path: Path) -> Path:
    """A copy of the run folder of a verb, with notes of the user."""
    place = Path(shutil.copytree(runs / request.param, tmp_path / "run"))
    (place / "notes.txt").write_text("oil was warm")
    return place


def everything(run_folder: Path) -> dict[str, object]:
    """Everything below a folder, hidden files too."""
    return {
        str(path): path.read_bytes() if path.is_file() else None for path in sorted(run_folder.rglob("*"))
    }


def refused(*command: object, lost: str) -> None:
    """The command ends with a sentence that names what would be lost, and leaves all as it is."""
    place = Path(str(command[command.index("--out") + 1]))
    before = everything(place.parent)
    assert "--replace" in command_refusal(*command, match=f"would lose .*{lost}")
    assert everything(place.parent) == before


@pytest.mark.long
@pytest.mark.parametrize(
    ("run_folder", "verb"),
    [("respond", "identify"), ("identify", "respond"), ("respond", "tune")],
    indirect=["run_folder"],
)
def test_the_run_of_another_verb_is_replaced_by_leave_only(
    run_folder: Path, verb: str, small_inputs: Path
) -> None:
    other = json.loads((run_folder / "manifest.json").read_text())["verb"]
    refused(
        *words(verb, small_inputs),
        "--out",
        run_folder,
        lost=f"{OWN_FILE[other]}.*the results of `mrwork {other}`",
    )
    assert mrwork(*words(verb, small_inputs), "--out", run_folder, "--replace").returncode == 0
    assert (run_folder / OWN_FILE[verb]).exists()
    assert (run_folder / "notes.txt").read_text() == "oil was warm"
    read = {"identify": mr.load, "respond": mr.study.read_results, "tune": mr.tuning.read_tuning}
    repr(read[verb](run_folder))


@pytest.mark.long
@pytest.mark.parametrize("run_folder", ["identify"], indirect=True)
def test_what_verbs_have_added_to_a_fit_and_what_was_edited_is_named(
    run_folder: Path, small_inputs: Path
) -> None:
    assert mrwork("profile", run_folder, "--quiet", "--parameter", "c").returncode == 0
    assert mrwork("sample", run_folder, "--steps", 2, "--walkers", 16, "--quiet").returncode == 0
    assert mrwork("report", run_folder, "--figures", "--quiet").returncode == 0
    command = [*words("identify", small_inputs), "--out", run_folder]
    added = "figures/, posterior.jsonl, posterior.nc, profiles.json, which other verbs or you have added"
    changed = "fit.json, changed since the run was written"
    refused(*command, lost=added)
    refused(*command, "--resume", lost=added)
    assert mrwork(*command, "--replace").returncode == 0
    assert mr.load(run_folder).draws is mr.load(run_folder).profiles is None
    assert not (run_folder / "figures").exists()
    with (run_folder / "fit.json").open("a") as file:
        file.write("\n")
    refused(*command, lost=changed)
    # What is resumed is written again.
    assert mrwork(*command, "--resume").returncode == 0
    assert mrwork(*command).returncode == 0
