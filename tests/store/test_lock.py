"""A file that grows and a folder that is replaced have one writer; a process that was killed stands in nobody's way."""

from __future__ import annotations

import errno
import fcntl
import os
import sys
from contextlib import closing
from pathlib import Path

import pytest
from command_line import started
from refusals import refusal

from mrwork.errors import JournalError, MrworkWarning, OutputError, SettingError, WorkerError
from mrwork.store.output_file import Lock
from mrwork.store.output_folder import Destination, adding, complete_manifest, replacing_run
from mrwork.store.run_folder import FIT_RUN
from mrwork.store.unfinished import (
    begin_addition,
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


def test_a_second_writer_is_told_who_the_first_is_and_a_killed_one_leaves_no_lock(tmp_path: Path) -> None:
    path = tmp_path / "chain.jsonl"
    with started(sys.executable, "-c", HOLDER, path) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        refusal(Lock, path, match=f"process {holder.pid} on .* is writing")
        holder.kill()
        holder.wait()
    Lock(path).release()
    assert list(tmp_path.iterdir()) == []


def test_where_locks_are_refused_the_file_is_written_after_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(file: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.warns(MrworkWarning, match="do not start a second run"):
        Lock(tmp_path / "chain").release()


def test_an_addition_replaces_an_earlier_one_only_when_it_is_complete(tmp_path: Path) -> None:
    kept = tmp_path / "chain.jsonl"
    for seed in (1, 2):
        with closing(begin_addition(kept)) as journal:
            journal.agree("run", {"seed": seed})
            assert kept.is_file() == (seed == 2)
            assert seed == 1 or b'"seed": 1' in kept.read_bytes()
            keep_addition(journal, kept)
            refusal(begin_addition, kept, match="is writing")
    assert b'"seed": 2' in kept.read_bytes()
    with closing(resume_addition(kept, note=pytest.fail)) as resumed:
        resumed.agree("run", {"seed": 2})


def test_a_run_is_not_replaced_while_something_is_added_nor_added_to_while_it_is_replaced(
    tmp_path: Path,
) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "manifest.json").write_bytes(complete_manifest({"status": "converged"}, FIT_RUN, {}))
    with adding(run, "plan.json"), adding(run, "profiles.json"):
        for second in (replacing_run(to(run)), adding(run, "plan.json")):
            with pytest.raises(JournalError, match=f"is writing {run}/p"), second:
                pytest.fail("two at once")
    with replacing_run(to(run)), pytest.raises(JournalError, match="is writing"), adding(run, "plan.json"):
        pytest.fail("two at once")
    assert [entry.name for entry in (*tmp_path.iterdir(), *run.iterdir())] == ["run", "manifest.json"]


@pytest.mark.parametrize(
    ("error", "kept"),
    [
        (SettingError("no"), False),
        (OutputError("no room"), True),
        (MemoryError(), True),
        (WorkerError("a worker is lost"), True),
        (KeyboardInterrupt(), True),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_journal_outlives_what_can_be_resumed(tmp_path: Path, error: BaseException, kept: bool) -> None:
    def fail() -> None:
        with run_journal(to(tmp_path / "run"), resume=False, note=pytest.fail) as journal:
            journal.agree("run", {"seed": 1})
            raise error

    with pytest.raises(type(error)):
        fail()
    assert bool(list(tmp_path.iterdir())) == kept
    if kept:
        with run_journal(to(tmp_path / "run"), resume=True, note=pytest.fail) as journal:
            journal.agree("run", {"seed": 1})
