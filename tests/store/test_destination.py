"""A run replaces only what its verb has written itself, unchanged; a file that grows has one writer."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import sys
from contextlib import closing
from pathlib import Path

import pytest
from command_line import started
from refusals import refusal

from mrwork.errors import JournalError, MrworkWarning, OutputError, SettingError, WorkerError
from mrwork.store.output_file import Lock
from mrwork.store.output_folder import (
    Destination,
    adding,
    check_destination,
    complete_manifest,
    replacing_run,
    write_folder,
)
from mrwork.store.run_folder import (
    FIGURES,
    FIT_RUN,
    JOURNAL,
    MANIFEST,
    REPORT,
    RESULTS,
    RUN_KINDS,
    STUDY_RUN,
    RunKind,
)
from mrwork.store.unfinished import (
    begin_addition,
    keep_addition,
    resume_addition,
    run_journal,
)

KINDS = pytest.mark.parametrize("kind", RUN_KINDS, ids=lambda kind: kind.verb)


def named(kind: RunKind) -> list[str]:
    """A name for each pattern of what a verb writes, without its manifest and its journal."""
    return [name.replace("*", "a") for name in sorted(kind.written - {MANIFEST, JOURNAL})]


def written(place: Path, kind: RunKind, *, text: str = "first", replace: bool = False) -> Destination:
    """A run folder with all files of a verb, written as its destination permits."""
    destination = Destination(path=place, kind=kind, replace=replace)
    journal = place.parent / "steps"
    journal.write_text(text)
    contents = {name: text.encode() for name in named(kind)}
    facts = {"status": "finished", "numbers": [0.1, float("inf"), 3], "text": text}
    try:
        write_folder(destination, contents, manifest=facts, copied={JOURNAL: journal})
    finally:
        journal.unlink()
    return destination


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refused(place: Path, kind: RunKind, lost: str) -> None:
    """Nothing may be written, nothing changes, and what would be lost is named."""
    before = contents(place.parent)
    refusal(Destination(path=place, kind=kind).check_losses, match=f"would lose .*{lost}.* --replace")
    refusal(written, place, kind, text="second", match="would lose")
    assert contents(place.parent) == before


@KINDS
def test_a_verb_replaces_its_own_run_and_keeps_what_the_user_added(tmp_path: Path, kind: RunKind) -> None:
    place = tmp_path / "run"
    written(place, kind)
    # The page is drawn again by later verbs.
    (place / REPORT).write_text("with another section")
    (place / "photos").mkdir()
    (place / "photos" / "notes.txt").write_text("oil was warm")
    written(place, kind, text="second")
    assert (place / JOURNAL).read_text() == "second"
    assert (place / "photos" / "notes.txt").read_text() == "oil was warm"


@KINDS
@pytest.mark.parametrize("other", RUN_KINDS, ids=lambda kind: kind.verb)
def test_a_run_of_another_verb_is_replaced_on_request_only_and_then_whole(
    tmp_path: Path, kind: RunKind, other: RunKind
) -> None:
    place = tmp_path / "run"
    written(place, other)
    (place / "notes.txt").write_text("mine")
    if kind != other:
        refused(place, kind, f"the results of `mrwork {other.verb}`")
    written(place, kind, text="second", replace=True)
    found = {str(path.relative_to(place)) for path in place.rglob("*") if path.is_file()}
    assert found == {*named(kind), MANIFEST, JOURNAL, "notes.txt"}


@pytest.mark.parametrize("name", sorted(FIT_RUN.added))
def test_what_later_verbs_have_added_is_named(tmp_path: Path, name: str) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    path = place / name / "loops.svg" if name == FIGURES else place / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("hours")
    refused(place, FIT_RUN, name)
    written(place, FIT_RUN, text="second", replace=True)
    assert not path.exists()


@KINDS
def test_a_file_that_was_changed_is_named(tmp_path: Path, kind: RunKind) -> None:
    for name in (*named(kind), MANIFEST, JOURNAL):
        if kind.redraws(name):
            continue
        place = tmp_path / name.replace("/", "-") / "run"
        place.parent.mkdir()
        written(place, kind)
        # Of the same length, and no newer than before.
        times = (place / name).stat()
        (place / name).write_text((place / name).read_text().replace("first", "fIrst"))
        os.utime(place / name, ns=(times.st_atime_ns, times.st_mtime_ns))
        refused(place, kind, f"{name}, changed since")


@pytest.mark.parametrize(
    "manifest",
    ['{"name": "app", "start_url": "/"}', '{"kind": "webapp", "files": {}}', '{"kind": "study"}', "[]", "{"],
)
@pytest.mark.parametrize("replace", [False, True])
def test_a_folder_with_the_manifest_of_another_program_is_never_replaced(
    tmp_path: Path, manifest: str, replace: bool
) -> None:
    place = tmp_path / "app"
    place.mkdir()
    (place / MANIFEST).write_text(manifest)
    (place / RESULTS).write_text("not of mrwork")
    before = contents(place)
    destination = Destination(path=place, kind=STUDY_RUN, replace=replace)
    refusal(check_destination, destination, match="is not that of a run of mrwork")
    refusal(written, place, STUDY_RUN, replace=replace, match="is not that of a run of mrwork")
    assert contents(place) == before


def test_a_run_that_is_continued_loses_its_changed_files_but_no_additions(tmp_path: Path) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    stated = json.loads((place / MANIFEST).read_text())
    (place / MANIFEST).write_text(json.dumps(stated | {"text": "changed"}))
    Destination.of(place, FIT_RUN, replace=False, resume=True).check_losses()
    added = min(FIT_RUN.added)
    (place / added).write_text("hours")
    refusal(
        Destination.of(place, FIT_RUN, replace=False, resume=True).check_losses, match=f"would lose {added}"
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
