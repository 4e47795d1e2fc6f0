"""Places that a user may name for what is written: odd ones end in one sentence, and what was there stays."""

from __future__ import annotations

import os
from contextlib import chdir
from pathlib import Path

import pytest
from command_line import mrwork
from sentences import Refused
from test_links import FIT, SPECIAL, done, listed, make_special

import mrwork as mr
from mrwork.cli.door import verbs
from tools.faults.options import arguments_of, options_of, written_record

pytestmark = pytest.mark.usefixtures("blank_pictures")
WITH_OUT = [verb for verb in verbs() if any("--out" in each.option_strings for each in options_of(verb))]
# What is written, to a file that the user names.
FILES = {
    "export": "export run --to csv --replace --output",
    "models": "models bingham --figure",
    "check": "check one.csv --table",
    "fragility": "fragility out --replace --output",
    "init study": "init study",
}
SUFFIX = {"models": ".svg", "init study": ".toml", "fragility": ".csv"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a run, a record, and files that are none."""
    written_record(tmp_path / "one.csv")
    assert done(FIT, tmp_path).returncode == 0
    odd = tmp_path / "odd"
    odd.mkdir()
    for kind in SPECIAL[:3]:
        for suffix in ("", ".svg", ".toml", ".csv"):
            try:
                make_special(odd / f"{kind}{suffix}", kind)
            except OSError:
                continue
            (odd / f"to {kind}{suffix}").symlink_to(odd / f"{kind}{suffix}")
    return tmp_path


def as_it_is(folder: Path) -> dict[str, tuple[object, ...]]:
    """Every file and what it is, whatever is written into it."""
    contents = listed(folder)
    stats = {name: (folder / name).lstat() for name in contents}
    return {name: (stats[name].st_mode, stats[name].st_ino, contents[name]) for name in contents}


def test_verbs_with_a_folder_are_found() -> None:
    assert {"identify", "respond", "tune", "demo"} <= set(WITH_OUT)


@pytest.mark.parametrize("verb", WITH_OUT)
def test_a_folder_that_cannot_be_written_is_refused_in_one_sentence(verb: str, folder: Path) -> None:
    locked = folder / "locked"
    locked.mkdir(mode=0o500)
    names = ["/", "one.csv", "one.csv/x", "run/models", "run/figures/x", "run/fit.json", "nul\0", "\udcff"]
    names += ["x" * 300, "d/" * 2500 + "x", "/proc/x", "/dev/null/x", *map(str, (folder / "odd").iterdir())]
    names += [str(locked / "run")] if os.geteuid() else []
    given = [str(each) for each in arguments_of(verb, folder / "one.csv", Path("run"), folder)]
    before = as_it_is(folder)
    for name in names:
        with chdir(folder):
            ended = mrwork(verb, *given, "--quiet", "--out", name)
        said = [
            line for line in ended.stderr.splitlines() if "warning: " not in line and "note: " not in line
        ]
        assert (ended.returncode, ended.stdout, len(said)) == (2, "", 1), (name, ended)
        assert said[0].startswith("mrwork"), (name, ended)
        assert as_it_is(folder) == before, name


@pytest.mark.parametrize("what", FILES)
def test_only_ordinary_files_that_are_of_no_run_are_replaced(what: str, folder: Path) -> None:
    suffix = SUFFIX.get(what, "")
    odd = [f"odd/{path.name}" for path in (folder / "odd").iterdir() if path.suffix == suffix]
    assert len(odd) >= 4
    of_run = [f"run/{path.name}" for path in (folder / "run").iterdir() if not suffix]
    of_run += [f"run/figures/loops{suffix}", f"run/models/bingham/fit{suffix}"]
    before = as_it_is(folder)
    for name in [*odd, *of_run, "run", *(["/"] if what != "init study" else [])]:
        with chdir(folder):
            ended = mrwork(*FILES[what].split(), name)
        if what == "init study" and name == "run":
            # A folder for a study of the user's own.
            assert ended.returncode == 0
            (folder / "run" / "study.toml").unlink()
            continue
        assert (ended.returncode, ended.stdout) == (2, ""), (name, ended)
        assert as_it_is(folder) == before, name


def test_a_link_or_a_further_name_of_a_file_of_a_run_is_replaced_and_the_run_stays(folder: Path) -> None:
    before = as_it_is(folder / "run")
    (folder / "link").symlink_to("run/fit.json")
    (folder / "name").hardlink_to(folder / "run" / "fit.json")
    for name in ("link", "name"):
        with chdir(folder):
            mr.export("run", "csv", name, replace=True)
        assert "force" in (folder / name).read_text()
        assert not (folder / name).is_symlink()
    assert as_it_is(folder / "run") == before


def test_a_file_of_a_run_is_told_in_a_sentence(folder: Path, refused: Refused) -> None:
    (folder / "latest").symlink_to("run")
    (folder / "next.part" / "models").mkdir(parents=True)
    with chdir(folder):
        for name in ("run/fit.json", "latest/journal.jsonl", "run/FIT.JSON", "next.part/models/x"):
            refused(mr.export, "run", "csv", name, replace=True)
        refused(mr.export, "run", "csv", "odd/pipe", replace=True)
        (folder / "run" / "manifest.json").write_text("{")
        refused(mr.export, "run", "csv", "run/fit.json", replace=True)


def test_a_journal_begins_in_the_place_of_nothing_but_a_journal(folder: Path, refused: Refused) -> None:
    mine = folder / "mine.txt"
    mine.write_text("mine")
    before = as_it_is(folder)
    for path in (
        mine,
        folder / "run" / "fit.json",
        folder / "run" / "journal.jsonl",
        folder / "odd" / "pipe",
    ):
        refused(mr.Journal, path)
    assert as_it_is(folder) == before
    kept = folder / "other.jsonl"
    for number in (1, 2):
        journal = mr.Journal(kept)
        journal.agree("run", {"seed": number})
        journal.close()
    assert '"seed": 2' in kept.read_text()


def test_a_pipe_in_a_run_is_told_before_the_run_is_made_anew(folder: Path, refused: Refused) -> None:
    (folder / "run" / "notes").mkdir()
    os.mkfifo(folder / "run" / "notes" / "pipe")
    with chdir(folder):
        refused.command(*FIT.split(), "--quiet")
    assert not (folder / "run.part").exists()


def test_every_option_that_names_a_file_to_write_is_tried() -> None:
    written = {"--output", "--figure", "--table"}
    found = {
        (verb, name)
        for verb in verbs()
        for each in options_of(verb)
        for name in each.option_strings
        if name in written
    }
    assert {verb for verb, _ in found} == FILES.keys() - {"init study"}
