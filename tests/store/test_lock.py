"""A file that grows has one writer; the lock of a process that was killed stands in nobody's way."""

from __future__ import annotations

import errno
import fcntl
import os
import sys
from contextlib import closing
from pathlib import Path

import pytest
from command_line import started
from sentences import Refused

from mrwork import Journal
from mrwork.errors import JournalError, MrworkWarning, OutputError, SettingError, WorkerError
from mrwork.store.output_file import Lock, is_lock
from mrwork.store.output_folder import Destination, adding, complete_manifest, replacing_run
from mrwork.store.run_folder import FIT_RUN
from mrwork.store.unfinished import (
    StepJournals,
    begin_addition,
    begin_journal,
    is_complete,
    keep_addition,
    resume_addition,
    run_journal,
)


def to(place: Path) -> Destination:
    return Destination(path=place, kind=FIT_RUN)


HOLDER = """
import sys, time
from pathlib import Path
from mrwork.store.output_file import Lock
Lock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(600)
"""


def test_a_second_writer_is_told_who_the_first_is_and_a_killed_one_leaves_no_lock(
    tmp_path: Path, refused: Refused
) -> None:
    path = tmp_path / "chain.jsonl"
    with started(sys.executable, "-c", HOLDER, path) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        refused(Lock, path)
        holder.kill()
        holder.wait()
    assert [is_lock(entry.name) for entry in tmp_path.iterdir()] == [True]
    Lock(path).release()
    assert list(tmp_path.iterdir()) == []


def test_a_lock_file_that_was_removed_meanwhile_is_not_taken_for_the_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    flock, removed = fcntl.flock, []

    def flock_after_removal(file: int, operation: int) -> None:
        if not removed:
            removed.append(tmp_path / ".chain.lock")
            removed[0].unlink()
        flock(file, operation)

    monkeypatch.setattr(fcntl, "flock", flock_after_removal)
    with Lock(tmp_path / "chain"):
        assert removed[0].read_text().startswith(f"process {os.getpid()} on ")
        refused(Lock, tmp_path / "chain")


def test_where_locks_are_refused_the_file_is_written_after_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(file: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.warns(MrworkWarning, match="cannot be locked here .* do not start a second run"):
        Lock(tmp_path / "chain").release()


def test_a_folder_that_is_not_there_is_one_sentence(tmp_path: Path, refused: Refused) -> None:
    refused(Lock, tmp_path / "none" / "chain")


def test_a_link_in_the_place_of_a_lock_is_not_followed(tmp_path: Path, refused: Refused) -> None:
    target = tmp_path / "precious"
    target.write_text("kept")
    (tmp_path / ".chain.lock").symlink_to(target)
    refused(Lock, tmp_path / "chain")
    assert target.read_text() == "kept"


def test_a_run_that_begins_leaves_the_journal_of_another_alone(tmp_path: Path, refused: Refused) -> None:
    first = begin_journal(tmp_path / "run")
    first.agree("run", {"seed": 1})
    before = first.path.read_bytes()
    refused(begin_journal, tmp_path / "run")
    assert first.path.read_bytes() == before
    first.close()


def test_a_comparison_that_begins_leaves_the_journals_of_another_alone(
    tmp_path: Path, refused: Refused
) -> None:
    with closing(StepJournals(to(tmp_path / "run"), resume=False)) as journals:
        journal = journals("dahl/fit")
        journal.agree("run", {"seed": 1})
        journal.close()
        for resume in (False, True):
            refused(StepJournals, to(tmp_path / "run"), resume=resume)
        assert b'"seed": 1' in journal.path.read_bytes()
        journals.discard()
    assert list(tmp_path.iterdir()) == []


def test_an_addition_replaces_an_earlier_one_only_when_it_is_complete(
    tmp_path: Path, refused: Refused
) -> None:
    kept = tmp_path / "posterior.jsonl"
    for seed in (1, 2):
        journal = begin_addition(kept)
        journal.agree("run", {"seed": seed})
        assert kept.is_file() == (seed == 2)
        assert seed == 1 or b'"seed": 1' in kept.read_bytes()
        keep_addition(journal, kept)
        refused(begin_addition, kept)
        journal.close()
    assert b'"seed": 2' in kept.read_bytes()
    resumed = resume_addition(kept, note=pytest.fail)
    resumed.agree("run", {"seed": 2})
    resumed.close()
    assert {entry.name for entry in tmp_path.iterdir()} == {"posterior.jsonl", "posterior.jsonl.part"}


def test_an_addition_to_a_folder_that_was_replaced_is_one_sentence(tmp_path: Path, refused: Refused) -> None:
    journal = begin_addition(tmp_path / "posterior.jsonl")
    journal.agree("run", {})
    journal.path.unlink()
    refused(keep_addition, journal, tmp_path / "posterior.jsonl")
    journal.close()


def test_a_second_journal_of_the_same_process_is_told_to_close_the_first(
    tmp_path: Path, refused: Refused
) -> None:
    first = Journal(tmp_path / "chain.jsonl")
    first.agree("run", {"seed": 1})
    refused(Journal(tmp_path / "chain.jsonl").agree, "run", {"seed": 2})
    first.close()
    with closing(Journal(tmp_path / "chain.jsonl", resume=True)) as second:
        second.agree("run", {"seed": 1})


@pytest.fixture
def run(tmp_path: Path) -> Path:
    place = tmp_path / "run"
    place.mkdir()
    (place / "manifest.json").write_bytes(complete_manifest({"status": "converged"}, FIT_RUN, {}))
    return place


@pytest.mark.parametrize("name", ["posterior.jsonl", "plan.json"])
def test_a_run_is_not_replaced_while_something_is_added_nor_added_to_while_it_is_replaced(
    run: Path, name: str
) -> None:
    with adding(run, name), adding(run, "profiles.json"):
        with pytest.raises(JournalError, match=f"is writing {run}/p"), replacing_run(to(run)):
            pytest.fail("it was replaced")
        with pytest.raises(JournalError, match=f"is writing {run / name}"), adding(run, name):
            pytest.fail("it was added twice")
    with replacing_run(to(run)), pytest.raises(JournalError, match=f"is writing {run} "), adding(run, name):
        pytest.fail("it was added")
    assert [entry.name for entry in (*run.parent.iterdir(), *run.iterdir())] == ["run", "manifest.json"]


@pytest.mark.parametrize(
    ("error", "kept"),
    [
        (SettingError("no"), False),
        (OutputError("no room"), True),
        (OSError("no room"), True),
        (MemoryError(), True),
        (WorkerError("a worker is lost"), True),
        (KeyboardInterrupt(), True),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.parametrize("begun", [False, True])
def test_a_journal_outlives_what_can_be_resumed(
    tmp_path: Path, error: BaseException, kept: bool, begun: bool
) -> None:
    def fail() -> None:
        with run_journal(to(tmp_path / "run"), resume=False, note=pytest.fail) as journal:
            if begun:
                journal.agree("run", {"seed": 1})
            raise error

    with pytest.raises(type(error)):
        fail()
    assert [entry.name for entry in tmp_path.iterdir()] == (["run.part"] if kept and begun else [])
    told = "run the same command with --resume to continue" in getattr(error, "__notes__", ())
    assert told == (begun and isinstance(error, KeyboardInterrupt))
    if kept and begun:
        with run_journal(to(tmp_path / "run"), resume=True, note=pytest.fail) as journal:
            journal.agree("run", {"seed": 1})


@pytest.mark.parametrize(
    ("manifest", "complete"),
    [(None, False), ('{"status": "interrupted"}', False), ('{"status": "converged"}', True), ("{", True)],
)
def test_a_run_is_complete_unless_its_manifest_says_otherwise(
    tmp_path: Path, manifest: str | None, complete: bool
) -> None:
    if manifest is not None:
        (tmp_path / "manifest.json").write_text(manifest)
    assert is_complete(tmp_path) is complete
