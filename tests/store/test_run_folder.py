"""A run is made in its folder: the manifest is the commit, what would be lost is refused, digests are trusted."""

import errno
import fcntl
import json
import math
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command_line import started
from refusals import refusal
from report_samples import fit, prediction
from run_folders import write_fit

import mrwork as mr
from mrwork.errors import JournalError, MrworkWarning, SettingError
from mrwork.identification.fit_file import read_fit
from mrwork.store import run_folder
from mrwork.store.output_file import Lock
from mrwork.store.run_folder import (
    ADDITIONS,
    CALIBRATION,
    CHAIN,
    FIT_RUN,
    HISTORIES,
    JOURNAL,
    MODELS,
    PLAN,
    PROFILES,
    RANKING,
    REDRAWN,
    REPORT,
    RESULTS,
    RUN_KINDS,
    STUDY_RUN,
    TUNING_RUN,
    RunFolder,
    RunKind,
)
from mrwork.store.run_folder import FIT as FIT_FILE
from mrwork.store.run_writer import RunAtWork, add_to_run, adding, addition_journal

FIT = fit(prediction())
MANIFEST = run_folder.MANIFEST
KINDS = pytest.mark.parametrize("kind", RUN_KINDS, ids=lambda kind: kind.verb)


WRITTEN = {
    FIT_RUN: {FIT_FILE, RANKING, "near_sets.json", MODELS},
    STUDY_RUN: {RESULTS, "study.toml", "criteria.csv", HISTORIES, "runs.nc"},
    TUNING_RUN: {RESULTS, "study.toml", "runs.nc", "chosen.toml", "tuned.json"},
}


def named(kind: RunKind) -> list[str]:
    """A name for each file and folder that a verb writes, without its manifest and its journal."""
    names = sorted(WRITTEN[kind] | REDRAWN)
    return [name if "." in name else f"{name}/a.npz" for name in names]


def written(place: Path, kind: RunKind, *, text: str = "first", allowed: bool = False) -> RunFolder:
    """A run folder with all files of a verb, of which the histories have grown."""
    with RunAtWork(place, kind, replace=allowed) as work:
        work.journal().agree("run", {"text": text})
        grown = [name for name in named(kind) if name.startswith(HISTORIES)]
        for name in grown:
            work.growing(name).write_text(text)
        contents = {name: text.encode() for name in named(kind) if name not in grown}
        work.commit(contents, {"status": "finished", "text": text}, grown=(JOURNAL, *grown))
    return RunFolder.open(place)


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.endswith(".lock")
    }


def is_whole(run: RunFolder) -> bool:
    """Whether every listed file is there, as it was written."""
    return all(run_folder.digest_at(name, run.file(name)) == digest for name, digest in run.files.items())


# What is written is read back


@pytest.mark.contract
def test_a_run_reads_back_as_the_same_fit_with_nothing_else_in_or_beside_its_folder(tmp_path: Path) -> None:
    described = fit(prediction(), prediction("second", synthetic=True))
    free = replace(described.estimates[0], lower=-math.inf, upper=math.inf)
    described = replace(described, estimates=(free, *described.estimates[1:]))
    assert math.isinf(described.trace.median[0])
    place = write_fit(tmp_path / "out" / "run", described)
    assert read_fit(place) == described
    assert [path.name for path in place.parent.iterdir()] == ["run"]
    assert set(contents(place)) == {FIT_FILE, MANIFEST}
    text = (place / FIT_FILE).read_text()
    json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))
    assert '"lower": "-inf"' in text


@pytest.mark.contract
@KINDS
def test_the_manifest_lists_every_file_and_a_text_may_have_other_ends_of_lines(
    tmp_path: Path, kind: RunKind
) -> None:
    place = tmp_path / "run"
    run = written(place, kind, text="one\ntwo\n")
    assert {*run.files, MANIFEST} == set(contents(place))
    path = place / (FIT_FILE if kind is FIT_RUN else RESULTS)
    path.write_bytes(b"one\r\ntwo\r\n")
    assert run.content(path.name) == b"one\r\ntwo\r\n"
    path.write_bytes(b"one\nthree\n")
    refusal(run.content, path.name, match=f"{path.name} is not as mrwork has written it.*--changed")
    path.unlink()
    assert run.content(path.name) is None


def test_a_file_that_was_changed_is_read_on_request_only(tmp_path: Path) -> None:
    place = write_fit(tmp_path / "run", FIT)
    text = (place / FIT_FILE).read_text()
    (place / FIT_FILE).write_text(text.replace('"converged"', '"stopped"'))
    refusal(mr.load, place, match=f"{FIT_FILE} is not as mrwork has written it")
    assert mr.load(place, changed=True).fit.status == "stopped"
    (place / FIT_FILE).write_text("{}")
    refusal(mr.load, place, changed=True, match=FIT_FILE)


def test_an_addition_that_cannot_be_read_names_the_verb_that_writes_it(tmp_path: Path) -> None:
    place = write_fit(tmp_path / "run", FIT)
    add_to_run(place, {CALIBRATION: b"{}"})
    refusal(mr.load, place, match="cannot be read .*run `mrwork calibrate` again")


def test_an_addition_of_another_run_is_refused(tmp_path: Path) -> None:
    place = write_fit(tmp_path / "run", FIT)
    (place / PROFILES).write_text("{}")
    refusal(mr.load, place, match=f"{PROFILES} is not as mrwork has written it; run `mrwork intervals` again")


@pytest.mark.parametrize("to_be_read", [True, False])
def test_a_folder_of_another_format_is_refused_with_the_line_to_type(
    tmp_path: Path, to_be_read: bool
) -> None:
    place = write_fit(tmp_path / "run", FIT)
    stated = json.loads((place / MANIFEST).read_text())
    del stated["format"]
    (place / MANIFEST).write_text(json.dumps(stated))
    call = RunFolder.open if to_be_read else RunAtWork(place, FIT_RUN).check_losses
    refusal(call, *([place] if to_be_read else []), match=f"`mrwork identify ... --out {place} --replace`")
    written(place, FIT_RUN, allowed=True)


def test_a_manifest_leads_nowhere_outside_its_folder(tmp_path: Path) -> None:
    place = write_fit(tmp_path / "run", FIT)
    (tmp_path / "precious.new").write_text("mine")
    (tmp_path / "precious").write_text("mine")
    files = {"../precious": run_folder.file_digest("precious", b"mine")}
    for stated in ({"files": files, "replaced": {}}, {"files": {}, "replaced": files}):
        refusal(run_folder.end_commit, place, stated, match="outside that folder")
    assert contents(tmp_path).items() >= {"precious": b"mine", "precious.new": b"mine"}.items()


# What is replaced


@KINDS
def test_a_verb_replaces_its_own_run_and_keeps_what_the_user_added(tmp_path: Path, kind: RunKind) -> None:
    place = tmp_path / "run"
    written(place, kind)
    (place / "photos").mkdir()
    (place / "photos" / "notes.txt").write_text("oil was warm")
    # The page is drawn again by later verbs.
    (place / REPORT).write_text("with a remark of mine")
    run = written(place, kind, text="second")
    assert b'"second"' in (place / JOURNAL).read_bytes()
    assert set(contents(place)) == {*run.files, MANIFEST, "photos/notes.txt", f"{REPORT}~"}
    assert (place / f"{REPORT}~").read_text() == "with a remark of mine"


def refused(place: Path, kind: RunKind, lost: str) -> None:
    """Nothing may be written, nothing changes, and what would be lost is named."""
    before = contents(place.parent)
    for call in (RunAtWork(place, kind).check_losses, lambda: written(place, kind, text="second")):
        refusal(call, match=f"would lose .*{lost}.* --replace")
    assert contents(place.parent) == before


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
    written(place, kind, text="second", allowed=True)
    assert set(contents(place)) == {*named(kind), MANIFEST, JOURNAL, "notes.txt"}


@pytest.mark.parametrize("name", sorted(ADDITIONS))
def test_what_later_verbs_have_added_is_named(tmp_path: Path, name: str) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    path = name if "." in name else f"{name}/loops.svg"
    add_to_run(place, {path: b"hours"})
    refused(place, FIT_RUN, name)
    written(place, FIT_RUN, text="second", allowed=True)
    assert not (place / name).exists()


@KINDS
def test_a_file_that_was_changed_is_named_and_is_kept_beside_the_new_one(
    tmp_path: Path, kind: RunKind
) -> None:
    for name in (*named(kind), JOURNAL):
        if name.partition("/")[0] in REDRAWN:
            continue
        place = tmp_path / name.replace("/", "-") / "run"
        written(place, kind)
        # Of the same length, and no newer than before.
        times = (place / name).stat()
        (place / name).write_text(changed := (place / name).read_text().replace("first", "fIrst"))
        os.utime(place / name, ns=(times.st_atime_ns, times.st_mtime_ns))
        refused(place, kind, f"{name}, changed since")
        written(place, kind, text="second", allowed=True)
        assert (place / f"{name}~").read_text() == changed


@pytest.mark.parametrize(
    "manifest",
    ['{"name": "app", "start_url": "/"}', '{"kind": "webapp", "files": {}}', '{"kind": "study"}', "[]", "{"],
)
@pytest.mark.parametrize("allowed", [False, True])
def test_a_folder_of_another_program_is_never_replaced(tmp_path: Path, manifest: str, allowed: bool) -> None:
    place = tmp_path / "app"
    place.mkdir()
    (place / RESULTS).write_text("not of mrwork")
    destination = RunAtWork(place, STUDY_RUN, replace=allowed)
    refusal(destination.run, match=f"holds files but no {MANIFEST}")
    (place / MANIFEST).write_text(manifest)
    before = contents(place)
    for call in (destination.run, lambda: written(place, STUDY_RUN, allowed=allowed)):
        refusal(call, match="is not that of a run of mrwork|is not JSON")
    assert contents(place) == before


def test_a_run_that_is_continued_loses_its_changed_files_but_no_additions(tmp_path: Path) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    (place / FIT_FILE).write_text("changed")
    RunAtWork(place, FIT_RUN, resume=True).check_losses()
    add_to_run(place, {PLAN: b"hours"})
    refusal(RunAtWork(place, FIT_RUN, resume=True).check_losses, match=f"would lose {PLAN}")


def test_an_empty_folder_and_a_link_may_be_written_to_and_others_may_read_it(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "latest").symlink_to("empty")
    earlier = os.umask(0o022)
    try:
        write_fit(tmp_path / "latest", FIT)
    finally:
        os.umask(earlier)
    assert read_fit(tmp_path / "empty") == FIT
    assert (tmp_path / "empty" / FIT_FILE).stat().st_mode & 0o777 == 0o644


# What is cut off


@pytest.mark.parametrize("resume", [True, False])
def test_a_folder_of_empty_folders_was_left_by_a_run_that_had_not_begun(tmp_path: Path, resume: bool) -> None:
    (tmp_path / "run" / MODELS / "dahl").mkdir(parents=True)
    (tmp_path / "run" / ".lock").touch()
    with RunAtWork(tmp_path / "run", FIT_RUN, resume=resume) as work:
        assert work.run() is None
    (tmp_path / "run" / MODELS).mkdir(parents=True, exist_ok=True)
    (tmp_path / "run" / MODELS / "notes.txt").touch()
    refusal(RunAtWork(tmp_path / "run", FIT_RUN, resume=resume).run, match="not a run folder")


def again(place: Path) -> object:
    return written(place, STUDY_RUN, text="second")


def by_another_verb(place: Path) -> object:
    return written(place, FIT_RUN, text="second", allowed=True)


def added(place: Path) -> object:
    return add_to_run(place, {REPORT: b"second", "data/b.csv": b"second"})


@pytest.mark.parametrize("change", [again, by_another_verb, added])
def test_wherever_a_writer_is_killed_the_folder_has_the_run_before_or_the_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], object]
) -> None:
    whole = tmp_path / "whole"
    written(whole, STUDY_RUN)
    (whole / "notes.txt").write_text("mine")
    calls = left = 0

    def killing(call: Callable[..., Any]) -> Callable[..., Any]:
        def killed(*arguments: Any, **named: Any) -> Any:
            nonlocal calls
            # The system releases the locks of a process that is killed.
            calls += not arguments[0].name.endswith(".lock")
            if calls > left and not arguments[0].name.endswith(".lock"):
                raise SystemExit
            return call(*arguments, **named)

        return killed

    texts = set()
    for left in range(1000):
        place, calls = Path(shutil.copytree(whole, tmp_path / str(left))), 0
        with monkeypatch.context() as patch:
            patch.setattr(run_folder, "new_file", killing(run_folder.new_file))
            for name in ("replace", "rename", "unlink"):
                patch.setattr(Path, name, killing(getattr(Path, name)))
            try:
                change(place)
            except SystemExit:
                ended = False
            else:
                ended = True
        run = RunFolder.open(place)
        assert is_whole(run)
        assert (place / "notes.txt").read_text() == "mine"
        texts.add((run.kind.verb, run.content(REPORT)))
        if ended:
            break
        change(place)
        assert is_whole(RunFolder.open(place))
        assert not [*place.rglob("*.new")]
        assert not [*place.rglob("*~")]
    assert ended
    assert left > 10
    assert len(texts) == 2


def test_a_cut_off_commit_is_read_where_it_cannot_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "run"
    written(place, STUDY_RUN)
    with monkeypatch.context() as patch:
        patch.setattr(run_folder, "end_commit", lambda *_: sys.exit())
        with pytest.raises(SystemExit):
            written(place, STUDY_RUN, text="second")
    before = contents(place)
    with Lock(place):
        run = RunFolder.open(place)
        assert is_whole(run)
        assert run.content(RESULTS) == b"second"
    assert contents(place) == before
    assert RunFolder.open(place).content(RESULTS) == b"second"
    assert (place / RESULTS).read_bytes() == b"second"


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.parametrize(
    "error", [SettingError("no"), MemoryError(), KeyboardInterrupt()], ids=lambda value: type(value).__name__
)
def test_a_journal_with_steps_outlives_every_error(
    tmp_path: Path, error: BaseException, kept: bool, there: bool
) -> None:
    place = tmp_path / "run"
    if there:
        written(place, FIT_RUN)
    before = contents(tmp_path)

    def fail() -> None:
        with RunAtWork(place, FIT_RUN) as work:
            journal = work.journal()
            journal.agree("run", {"seed": 1})
            if kept:
                journal.record("step", "", {})
            raise error

    with pytest.raises(type(error)):
        fail()
    if not isinstance(error, KeyboardInterrupt):
        assert (contents(tmp_path) != before) == kept
        assert place.exists() == (kept or there)
    if kept:
        refusal(lambda: written(place, FIT_RUN), match="unfinished run of 1 step; .*--resume .*--replace")
        with RunAtWork(place, FIT_RUN, resume=True, note=pytest.fail) as work:
            journal = work.journal()
            journal.agree("run", {"seed": 1})
            assert journal.recall("step", "", dict) == {}
            work.commit({}, {"status": "finished"})
        assert b'"seed": 1' in (place / JOURNAL).read_bytes()
        assert not [*place.rglob("*.new")]


# Two at once

HOLDER = """
import sys, time
from pathlib import Path
from mrwork.store.output_file import Lock
Lock(Path(sys.argv[1]), "chain")
print("held", flush=True)
time.sleep(600)
"""


def test_a_second_writer_is_told_who_the_first_is_and_a_killed_one_leaves_no_lock(tmp_path: Path) -> None:
    with started(sys.executable, "-c", HOLDER, tmp_path) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        refusal(Lock, tmp_path, "chain", match=f"process {holder.pid} on .* is writing")
        holder.kill()
        holder.wait()
    Lock(tmp_path, "chain").release()
    assert list(tmp_path.iterdir()) == []


def test_where_locks_are_refused_the_file_is_written_after_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(file: int, operation: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.warns(MrworkWarning, match="do not start a second run"):
        Lock(tmp_path, "chain").release()


def chain(place: Path, seed: int, *, resume: bool = False) -> None:
    with addition_journal(place, CHAIN, resume=resume, replace=False, note=pytest.fail) as journal:
        journal.agree("run", {"seed": seed})
        refusal(
            lambda: addition_journal(place, CHAIN, resume=True, replace=False, note=print).__enter__(),
            match="is writing",
        )
        journal.close()
        add_to_run(place, {}, grown=[CHAIN])


def interrupted_chain(place: Path) -> None:
    with addition_journal(place, CHAIN, resume=False, replace=False, note=pytest.fail) as journal:
        journal.agree("run", {"seed": 3})
        journal.record("step", "", {})
        raise KeyboardInterrupt


def test_a_chain_replaces_an_earlier_one_only_when_it_is_complete(tmp_path: Path) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    for seed in (1, 2):
        chain(place, seed)
        assert b'"seed": %d' % seed in (place / CHAIN).read_bytes()
    before = contents(place)
    chain(place, 2, resume=True)
    assert contents(place) == before
    with pytest.raises(KeyboardInterrupt):
        interrupted_chain(place)
    assert contents(place).items() >= before.items()
    refusal(lambda: chain(place, 3), match="unfinished run of 1 step")
    # Another verb adds its file beside it.
    add_to_run(place, {RANKING: b"{}"})
    assert (place / f"{CHAIN}.new").is_file()


def test_a_run_is_not_replaced_while_something_is_added_nor_added_to_while_it_is_replaced(
    tmp_path: Path,
) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    at_work = RunAtWork(place, FIT_RUN)
    with adding(place, PLAN), adding(place, PROFILES):
        (place / f".{CHAIN}.lock").write_text("of a verb that was killed")
        add_to_run(place, {PLAN: b"{}"})
        for second in (RunAtWork(place, FIT_RUN, replace=True), adding(place, PLAN)):
            with pytest.raises(JournalError, match=f"is writing {place}/p"), second:
                pytest.fail("two at once")
    written(place, FIT_RUN, allowed=True)
    with at_work:
        for second in (adding(place, PLAN), RunAtWork(place, FIT_RUN)):
            with pytest.raises(JournalError, match=f"is writing {place}"), second:
                pytest.fail("two at once")
    assert not [*tmp_path.rglob("*.lock")]
