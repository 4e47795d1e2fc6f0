"""Files are written whole or not at all, and through no symbolic link."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path

import pytest

import mrwork as mr
from mrwork import Journal
from mrwork.errors import OutputError
from mrwork.store.output_file import replacing, write_files
from mrwork.store.unfinished import begin_addition, resume_addition

TARGETS = ("file", "folder", "nowhere")


@pytest.fixture
def precious(tmp_path: Path) -> Path:
    """A file and a folder of the user, to which links may lead."""
    place = tmp_path / "precious"
    (place / "folder").mkdir(parents=True)
    for path in (place / "file", place / "folder" / "file"):
        path.write_text("mine")
    return place


def is_untouched(precious: Path) -> bool:
    found = {str(path.relative_to(precious)) for path in precious.rglob("*")}
    texts = {(precious / name).read_text() for name in ("file", "folder/file")}
    return found == {"file", "folder", "folder/file"} and texts == {"mine"}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(
    "place", ["plan.json", f".plan.json.{os.getpid()}.new"], ids=["file", "its temporary name"]
)
def test_a_file_takes_the_place_of_a_link(tmp_path: Path, precious: Path, place: str, target: str) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / place).symlink_to(precious / target)
    write_files(run, {"plan.json": b"new"})
    assert [path.name for path in run.iterdir()] == ["plan.json"]
    assert not (run / "plan.json").is_symlink()
    assert (run / "plan.json").read_bytes() == b"new"
    assert is_untouched(precious)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("above", ["figures", "figures/loops"])
def test_a_link_on_the_way_to_a_file_is_refused_by_its_name(
    tmp_path: Path, precious: Path, above: str, target: str
) -> None:
    run = tmp_path / "run"
    (run / above).parent.mkdir(parents=True)
    (run / above).symlink_to(precious / target)
    with pytest.raises(OutputError, match=f"{run / above} is a symbolic link, .* remove the link"):
        write_files(run, {"plan.json": b"new", "figures/loops/a.svg": b"<svg/>"})
    assert is_untouched(precious)
    assert not (run / "plan.json").exists()


def test_the_folder_that_the_user_names_may_be_a_link(tmp_path: Path, precious: Path) -> None:
    link = tmp_path / "latest"
    link.symlink_to(precious / "folder")
    write_files(link, {"figures/a.svg": b"<svg/>"})
    assert (precious / "folder" / "figures" / "a.svg").read_bytes() == b"<svg/>"


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("resume", [False, True])
def test_a_journal_does_not_grow_through_a_link(
    tmp_path: Path, precious: Path, target: str, resume: bool
) -> None:
    path = tmp_path / "journal.jsonl"
    path.symlink_to(precious / target)
    with (
        pytest.raises(OutputError, match=r"journal\.jsonl is a symbolic link"),
        closing(mr.Journal(path, resume=resume)) as journal,
    ):
        journal.agree("run", {"seed": 1})
    assert is_untouched(precious)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(
    "place",
    ["posterior.jsonl", "posterior.jsonl.part", ".posterior.jsonl.copying", ".posterior.jsonl.part.lock"],
)
def test_an_addition_is_not_resumed_through_a_link(
    tmp_path: Path, precious: Path, place: str, target: str
) -> None:
    kept = tmp_path / "run" / "posterior.jsonl"
    kept.parent.mkdir()
    with closing(Journal(kept)) as journal:
        journal.agree("run", {"seed": 1})
    (tmp_path / "run" / place).unlink(missing_ok=True)
    (tmp_path / "run" / place).symlink_to(precious / target)
    if place.endswith(".copying"):
        resume_addition(kept, note=pytest.fail).close()
        assert not (tmp_path / "run" / place).exists()
    else:
        with pytest.raises(OutputError, match=f"{place} is a symbolic link"):
            resume_addition(kept, note=pytest.fail)
    assert is_untouched(precious)


def test_a_journal_that_is_begun_does_not_grow_through_a_link(tmp_path: Path, precious: Path) -> None:
    kept = tmp_path / "posterior.jsonl"
    (tmp_path / "posterior.jsonl.part").symlink_to(precious / "file")
    with closing(begin_addition(kept)) as journal, pytest.raises(OutputError, match="is a symbolic link"):
        journal.agree("run", {"seed": 1})
    assert is_untouched(precious)


def test_a_block_that_fails_leaves_the_earlier_file_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("earlier")

    def fail() -> None:
        with replacing(path) as stream:
            stream.write(b"half")
            raise ValueError("half")

    with pytest.raises(ValueError, match="half"):
        fail()
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]
