"""`identify`, `respond` and `tune` say what would be lost in a folder, before they compute; `--replace` goes ahead."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import tuning_samples
from command_line import mrwork
from refusals import command_refusal
from verb_folders import words

import mrwork as mr

VERBS = ("identify", "respond", "tune")
# What a verb writes beside its manifest, journal and page, of which a sentence names the first files.
OWN_FILE = {"identify": "fit.json", "respond": "results.json", "tune": "chosen.toml"}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("inputs")
    tuning_samples.small_files(place)
    return place


@pytest.fixture(scope="module")
def runs(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder of each verb, by its name."""
    place = tmp_path_factory.mktemp("runs")
    for verb in VERBS:
        assert mrwork(*words(verb, inputs), "--out", place / verb).returncode == 0
    return place


@pytest.fixture
def folder(request: pytest.FixtureRequest, runs: Path, tmp_path: Path) -> Path:
    """A copy of the run folder of a verb, with notes of the user."""
    place = Path(shutil.copytree(runs / request.param, tmp_path / "run"))
    (place / "notes.txt").write_text("oil was warm")
    return place


def contents(folder: Path) -> dict[str, object]:
    """Everything below a folder, hidden files too."""
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


def refused(*command: object, lost: str) -> None:
    """The command ends with a sentence that names what would be lost, and leaves all as it is."""
    place = Path(str(command[command.index("--out") + 1]))
    before = contents(place.parent)
    assert "--replace" in command_refusal(*command, match=f"would lose .*{lost}")
    assert contents(place.parent) == before


@pytest.mark.parametrize(
    ("folder", "verb"),
    [("respond", "identify"), ("identify", "respond"), ("respond", "tune")],
    indirect=["folder"],
)
def test_the_run_of_another_verb_is_replaced_by_leave_only(folder: Path, verb: str, inputs: Path) -> None:
    other = json.loads((folder / "manifest.json").read_text())["verb"]
    refused(
        *words(verb, inputs), "--out", folder, lost=f"the results of `mrwork {other}`, .*{OWN_FILE[other]}"
    )
    assert mrwork(*words(verb, inputs), "--out", folder, "--replace").returncode == 0
    assert (folder / OWN_FILE[verb]).exists()
    assert (folder / "notes.txt").read_text() == "oil was warm"
    read = {"identify": mr.load, "respond": mr.study.read_results, "tune": mr.tuning.read_tuning}
    repr(read[verb](folder))


@pytest.mark.parametrize("folder", ["identify"], indirect=True)
def test_what_verbs_have_added_to_a_fit_and_what_was_edited_is_named(folder: Path, inputs: Path) -> None:
    assert mrwork("profile", folder, "--quiet", "--parameter", "c").returncode == 0
    assert mrwork("sample", folder, "--steps", 2, "--walkers", 16, "--quiet").returncode == 0
    assert mrwork("report", folder, "--figures", "--quiet").returncode == 0
    command = [*words("identify", inputs), "--out", folder]
    added = "figures/, posterior.jsonl, posterior.nc, profiles.json, which other verbs or you have added"
    changed = "fit.json, changed since the run was written"
    refused(*command, lost=added)
    refused(*command, "--resume", lost=added)
    assert mrwork(*command, "--replace").returncode == 0
    assert mr.load(folder).draws is mr.load(folder).profiles is None
    assert not (folder / "figures").exists()
    with (folder / "fit.json").open("a") as file:
        file.write("\n")
    refused(*command, lost=changed)
    # What is resumed is written again.
    assert mrwork(*command, "--resume").returncode == 0
    assert mrwork(*command).returncode == 0
