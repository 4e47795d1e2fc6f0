"""What would be lost is said before a verb computes: an unfinished run, one of another verb, what was added to one."""

import json
import shutil
import signal
from contextlib import closing
from pathlib import Path

import pytest
import tuning_samples
from command_line import COMMAND, mrwork, started, wait_until
from refusals import command_refusal
from verb_folders import words

import mrwork as mr
from mrwork.errors import JournalError
from mrwork.store.journal import n_steps


def steps(folder: Path) -> int:
    """Steps that an unfinished run has recorded, wherever it keeps them."""
    return sum(n_steps(path) for pattern in ("*.jsonl", "*.jsonl.new") for path in folder.rglob(pattern))


@pytest.mark.machine
def test_an_interrupted_run_in_its_folder_is_kept_until_replaced(tmp_path: Path) -> None:
    line = (
        "identify",
        "synthetic:spencer1997",
        "--model",
        "bouc_wen",
        "--threads",
        "1",
        "--out",
        tmp_path / "run",
    )
    line += ("--search", "genetic", "--population", "16", "--generations", "30")

    def status() -> str:
        return str(json.loads((tmp_path / "run" / "manifest.json").read_text())["status"])

    with started(*COMMAND, *line) as process:
        wait_until(lambda: steps(tmp_path) > 5, process)
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert status() == "interrupted"
    command_refusal(*line, match="--replace")
    assert mrwork(*line, "--replace").returncode == 0
    assert status() != "interrupted"
    # A complete run of the same verb is replaced as before.
    assert mrwork(*line).returncode == 0


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
    command = [*words(verb, small_inputs), "--out", run_folder]
    refused(*command, lost=f"{OWN_FILE[other]}.*the results of `mrwork {other}`")
    assert mrwork(*command, "--replace").returncode == 0
    assert (run_folder / OWN_FILE[verb]).exists()
    assert (run_folder / "notes.txt").read_text() == "oil was warm"
    read = {"identify": mr.load, "respond": mr.study.read_results, "tune": mr.tuning.read_tuning}
    repr(read[verb](run_folder))


@pytest.mark.long
@pytest.mark.parametrize("run_folder", ["identify"], indirect=True)
def test_what_verbs_have_added_to_a_fit_and_what_was_edited_is_named(
    run_folder: Path, small_inputs: Path
) -> None:
    assert mrwork("intervals", run_folder, "--quiet", "--parameter", "c").returncode == 0
    assert (
        mrwork("intervals", run_folder, "--posterior", "--steps", 2, "--walkers", 16, "--quiet").returncode
        == 0
    )
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
