"""`identify`, `respond` and `tune` say what would be lost in a folder, before they compute; `--replace` goes ahead."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import tuning_samples
from command_line import mrwork

import mrwork as mr

VERBS = ("identify", "respond", "tune")
FILES = {
    "identify": "data/, fit.json, journal.jsonl, manifest.json, report.html",
    "respond": "criteria.csv, data/, histories/, journal.jsonl, manifest.json, profiles.csv, report.html, "
    "results.json, study.toml",
    "tune": "chosen.toml, data/, journal.jsonl, manifest.json, report.html, results.json, scores.csv, study.toml",
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("inputs")
    tuning_samples.small_files(place)
    return place


def words(verb: str, inputs: Path, out: Path) -> list[object]:
    """A command that takes little time."""
    given: dict[str, list[object]] = {
        "identify": [
            "synthetic:spencer1997",
            "--model",
            "static_hysteretic",
            "--fix",
            "x_s=1e-4",
            "--every",
            "40",
        ],
        "respond": [inputs / "small.toml"],
        "tune": [inputs / "tuned.toml", "--quick"],
    }
    return [verb, *given[verb], "--threads", "1", "--quiet", "--out", out]


@pytest.fixture(scope="module")
def runs(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder of each verb, by its name."""
    place = tmp_path_factory.mktemp("runs")
    for verb in VERBS:
        assert mrwork(*words(verb, inputs, place / verb)).returncode == 0
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
    ended = mrwork(*command)
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert ended.stderr == (
        f"mrwork: {place} has a run; `mrwork {command[0]}` in its place would lose {lost}; "
        "choose another folder, or give --replace\n"
    )
    assert contents(place.parent) == before


@pytest.mark.parametrize(
    ("folder", "verb"),
    [(other, verb) for other in VERBS for verb in VERBS if other != verb],
    indirect=["folder"],
)
def test_the_run_of_another_verb_is_named(folder: Path, verb: str, inputs: Path, runs: Path) -> None:
    other = json.loads((folder / "manifest.json").read_text())["verb"]
    refused(*words(verb, inputs, folder), lost=f"the results of `mrwork {other}`, {FILES[other]}")
    assert json.loads((runs / other / "manifest.json").read_text())["verb"] == other


@pytest.mark.parametrize(
    ("folder", "verb"),
    [("respond", "identify"), ("identify", "respond"), ("respond", "tune")],
    indirect=["folder"],
)
def test_replace_puts_a_run_in_the_place_of_another_verbs(folder: Path, verb: str, inputs: Path) -> None:
    assert mrwork(*words(verb, inputs, folder), "--replace").returncode == 0
    found = sorted(path.name + "/" * path.is_dir() for path in folder.iterdir())
    assert found == sorted([*FILES[verb].split(", "), "notes.txt"])
    assert (folder / "notes.txt").read_text() == "oil was warm"
    read = {"identify": mr.load, "respond": mr.study.read_results, "tune": mr.tuning.read_tuning}
    repr(read[verb](folder))


@pytest.mark.parametrize("folder", VERBS, indirect=True)
def test_the_same_verb_replaces_its_run_without_asking(folder: Path, inputs: Path) -> None:
    verb = json.loads((folder / "manifest.json").read_text())["verb"]
    assert mrwork(*words(verb, inputs, folder), "--seed", 3).returncode == 0
    stated = json.loads((folder / "manifest.json").read_text())
    assert stated["rng" if verb == "identify" else "seed"] == 3
    assert (folder / "notes.txt").read_text() == "oil was warm"


@pytest.mark.parametrize("folder", ["identify"], indirect=True)
def test_what_verbs_have_added_to_a_fit_and_what_was_edited_is_named(folder: Path, inputs: Path) -> None:
    assert mrwork("profile", folder, "--quiet").returncode == 0
    assert mrwork("sample", folder, "--steps", 2, "--walkers", 16, "--quiet").returncode == 0
    assert mrwork("report", folder, "--figures", "--quiet").returncode == 0
    command = words("identify", inputs, folder)
    added = "figures/, posterior.jsonl, posterior.nc, profiles.json, which other verbs or you have added"
    # The profiles are also in the file of the fit.
    changed = "fit.json, changed since the run was written"
    refused(*command, lost=f"{added}; and {changed}")
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


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("more", [(), ("--replace",), ("--resume",)])
def test_the_folder_of_a_web_app_is_no_run_folder(
    verb: str, more: tuple[str, ...], inputs: Path, tmp_path: Path
) -> None:
    place = tmp_path / "app"
    (place / "models").mkdir(parents=True)
    (place / "manifest.json").write_text('{"name": "app", "start_url": "/"}')
    for name in ("models/weights.bin", "results.json", "plan.json"):
        (place / name).write_text("of the app")
    before = contents(tmp_path)
    ended = mrwork(*words(verb, inputs, place), *more)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert "is not that of a run of mrwork, so the folder is left as it is" in ended.stderr
    assert contents(tmp_path) == before
