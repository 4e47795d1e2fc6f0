"""Files of users stay: no file grows through a link, and no regular file is replaced that the user did not name."""

import os
from contextlib import closing
from pathlib import Path

import pytest
from command_line import mrwork
from refusals import command_refusal, refusal

import mrwork as mr
from mrwork.errors import OutputError
from mrwork.store.output_file import Lock, write_file

FIT = ("identify", "synthetic:spencer1997", "--model", "bingham", "--every", 40, "--threads", 1, "--quiet")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    assert mrwork(*FIT, "--out", tmp_path / "run").returncode == 0
    return tmp_path / "run"


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("resume", [False, True])
def test_a_file_that_grows_is_not_written_through_a_link(tmp_path: Path, resume: bool) -> None:
    with closing(mr.Journal(tmp_path / "precious")) as journal:
        journal.agree("run", {"seed": 1})
    before = (tmp_path / "precious").read_bytes()
    for name in ("journal", ".chain.lock"):
        (tmp_path / name).symlink_to(tmp_path / "precious")

    def grow() -> None:
        with closing(mr.Journal(tmp_path / "journal", resume=resume)) as journal:
            journal.agree("run", {"seed": 1})
            journal.record("step", "", {})

    refusal(grow, match="link")
    refusal(Lock, tmp_path, "chain", match="link")
    assert (tmp_path / "precious").read_bytes() == before


@pytest.mark.parametrize(
    "words", [(*FIT, "--replace", "--out"), ("report",), ("intervals",)], ids=lambda words: words[0]
)
def test_what_links_in_a_run_lead_to_stays(run: Path, words: tuple[object, ...]) -> None:
    precious = run.parent / "precious"
    precious.mkdir()
    for number, path in enumerate(sorted(contents(run))):
        path.rename(precious / str(number))
        path.symlink_to(precious / str(number))
    before = contents(precious)
    assert mrwork(*words, run).returncode in (0, 2)
    assert contents(precious) == before


def test_a_file_of_a_run_is_not_replaced(run: Path) -> None:
    (run.parent / "study.toml").write_text("mine")
    before = contents(run.parent)
    command_refusal("init", "study", run.parent / "study.toml", match="is there already")
    for place in [*sorted(contents(run)), run]:
        for words in (
            ("export", run, "--to", "csv", "--replace", "--output", place),
            ("models", "bingham", "--figure", place),
            ("check", "synthetic:spencer1997", "--table", place),
        ):
            command_refusal(*words, match="mrwork")
        refusal(mr.Journal, place, match="journal|belongs|folder|directory")
    assert contents(run.parent) == before


def test_a_file_takes_the_place_of_no_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(OutputError, match="is a pipe"):
        write_file(tmp_path / "pipe.csv", b"")
    assert (tmp_path / "pipe.csv").is_fifo()
