"""A run that is killed at any file that it makes, from the first on, goes on with --resume, and not with other files.

Each form of run is written by a process that is killed at every file, folder, name or line of a journal in turn.
"""

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from command_line import mrwork, ran
from refusals import refusal
from report_samples import fit, prediction

import mrwork as mr
from mrwork.errors import JournalError
from mrwork.store.journal import Journal
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import (
    CHAIN,
    FIT,
    FIT_RUN,
    HISTORIES,
    JOURNAL,
    MANIFEST,
    MODELS,
    RANKING,
    RESULTS,
    RUNS,
    STUDY_RUN,
    RunKind,
    chunks_beside,
)
from mrwork.store.run_writer import RunAtWork, addition_journal, is_complete

TEXT = '{"of": "another program"}\n'
HISTORY = f"{HISTORIES}/a.nc"
FACTS = {"status": "finished"}


def take_steps(journal: Journal, text: str) -> None:
    with closing(journal):
        journal.agree("run", {"text": text})
        for number in range(2):
            if journal.recall("step", str(number), dict) is None:
                journal.record("step", str(number), {"number": number})


def write_one_fit(work: RunAtWork, text: str) -> None:
    take_steps(work.journal(), text)
    work.commit({FIT: text.encode()}, FACTS)


def write_a_choice(work: RunAtWork, text: str) -> None:
    for step in ("screening", "dahl/fit"):
        take_steps(work.journal(f"{MODELS}/{step}.jsonl"), text)
    work.commit({FIT: text.encode(), RANKING: text.encode()}, FACTS, grown=())


def write_a_study(work: RunAtWork, text: str) -> None:
    journal = work.journal()
    take_steps(journal, text)
    write_file(chunks_beside(journal.path) / "0.npz", text.encode())
    if not work.grown(HISTORY).is_file():
        write_file(work.growing(HISTORY), text.encode())
    work.commit({RESULTS: text.encode(), RUNS: text.encode()}, FACTS, grown=(JOURNAL, HISTORY))


def save_a_fit(work: RunAtWork, text: str) -> None:
    work.commit({FIT: text.encode()}, FACTS)


Write = Callable[[RunAtWork, str], None]
FORMS: dict[str, tuple[Write, RunKind]] = {
    "fit": (write_one_fit, FIT_RUN),
    "choice": (write_a_choice, FIT_RUN),
    "study": (write_a_study, STUDY_RUN),
    "saved": (save_a_fit, FIT_RUN),
}


def write(form: str, place: Path, text: str, *, resume: bool = False, replace: bool = False) -> None:
    call, kind = FORMS[form]
    with RunAtWork(place, kind, resume=resume, replace=replace) as work:
        call(work, text)


def kill_at(point: int, here: str) -> None:
    """Kill this process at the change of that number to what lies in a folder."""
    events = 0

    def step() -> None:
        nonlocal events
        events += 1
        if events == point:
            os.kill(os.getpid(), signal.SIGKILL)

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        changes = event in ("os.mkdir", "os.rename", "os.remove", "os.rmdir") or (
            event == "open"
            and isinstance(arguments[2], int)
            and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        )
        # A file that is open already has a number.
        if changes and not isinstance(arguments[0], int) and os.fspath(arguments[0]).startswith(here):
            step()

    written = Journal._write

    def write_line(journal: Journal, lines: bytes) -> None:
        step()
        written(journal, lines)

    setattr(Journal, "_write", write_line)  # noqa: B010
    sys.addaudithook(watch)


def kill_everywhere(form: str, before: str, folder: Path) -> None:
    """Write the run of a form into `folder`/POINT/run once for each point at which its writer is killed."""
    setattr(os, "fsync", lambda _: None)  # noqa: B010 - a kill loses nothing that was written
    for point in range(1, 1000):
        place = folder / str(point) / "run"
        place.parent.mkdir(parents=True)
        BEFORE[before](form, place)
        if (child := forked()) == 0:
            kill_at(point, str(place))
            write(form, place, "new", replace=before == "killed")
            sys.exit()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if status != -signal.SIGKILL:
            sys.exit(status)


def forked() -> int:
    """The child of a fork, or zero in it: libraries with threads warn of one, and the child writes files alone."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return os.fork()


def leave_unfinished(form: str, place: Path, text: str) -> None:
    """A run of a form that was killed before it was committed, with a file of its user."""
    if forked() == 0:
        setattr(RunAtWork, "commit", lambda *_, **__: os._exit(0))  # noqa: B010
        write(form, place, text)
    os.wait()
    (place / "notes.txt").write_text("mine")


BEFORE: dict[str, Callable[[str, Path], None]] = {
    "absent": lambda form, place: None,
    "complete": lambda form, place: write(form, place, "old"),
    "killed": lambda form, place: leave_unfinished(form, place, "old"),
}


def contents(folder: Path) -> dict[str, bytes]:
    """Files by name, with the content of those that do not tell the time."""
    paths = (path for path in folder.rglob("*") if path.is_file() and not path.match(".*lock"))
    names = {path: path.relative_to(folder).as_posix() for path in paths}
    timed = (JOURNAL, MANIFEST)
    return {name: b"" if name in timed else path.read_bytes() for path, name in names.items()}


def killed(form: str, before: str, folder: Path) -> Iterator[Path]:
    ended = ran(
        sys.executable,
        __file__,
        form,
        before,
        folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert ended.returncode == 0, ended.stderr
    yield from (path / "run" for path in sorted(folder.iterdir(), key=lambda path: int(path.name)))


@pytest.mark.parametrize("before", BEFORE)
@pytest.mark.parametrize("form", FORMS)
def test_a_run_that_is_killed_at_any_file_goes_on(
    form: str, before: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: None)
    write(form, tmp_path / "whole", "new")
    whole, count = contents(tmp_path / "whole"), 0
    earlier = tmp_path / "earlier"
    earlier.mkdir()
    BEFORE[before](form, earlier / "run")
    kept = {name for name in ("notes.txt",) if (earlier / "run" / name).exists()}
    for place in killed(form, before, tmp_path / "killed"):
        count += 1
        # What is complete is not resumed: the run itself, and one of other settings in whose place none has begun.
        work = RunAtWork(place, FORMS[form][1], resume=True)
        resume = form != "saved" and not (work.continues and is_complete(place))
        try:
            write(form, place, "new", resume=resume, replace=before == "killed")
        except JournalError:
            # Killed before it had begun in place of an unfinished one.
            assert before == "killed"
            write(form, place, "new", replace=True)
        assert {name: text for name, text in contents(place).items() if name not in kept} == whole
        assert all((place / name).read_text() == "mine" for name in kept)
    assert count > 8


def test_files_of_others_are_neither_resumed_nor_replaced(tmp_path: Path) -> None:
    for name in ("fit.json.new", f"{MODELS}/notes.txt", "journal.jsonl", f"{MODELS}/a/b.jsonl"):
        place = tmp_path / name.replace("/", "-")
        (place / name).parent.mkdir(parents=True)
        (place / name).write_text(TEXT)
        (place / ".lock").write_text("mine")
        for resume, replace in ((False, False), (True, False), (False, True)):
            refusal(write, "fit", place, "new", resume=resume, replace=replace, match="is left as it is")
        assert {path.read_text() for path in place.rglob("*") if path.is_file()} == {TEXT, "mine"}


def test_a_fit_does_not_go_on_with_a_choice_nor_a_choice_with_a_fit(tmp_path: Path) -> None:
    for form, other in (("fit", "choice"), ("choice", "fit")):
        place = tmp_path / form
        ended = ran(
            sys.executable,
            "-c",
            f"import test_beginnings as t, pathlib; t.leave_unfinished({form!r}, pathlib.Path({str(place)!r}), 'a')",
            env=os.environ
            | {"PYTHONPATH": os.pathsep.join((str(Path(__file__).parent), *filter(None, sys.path)))},
        )
        assert ended.returncode == 0, ended.stderr
        before = contents(place)
        refusal(write, other, place, "a", resume=True, match="unfinished run of .* the same command")
        assert contents(place).items() >= before.items()
        write(form, place, "a", resume=True)


def test_what_was_killed_before_it_had_begun_begins(tmp_path: Path) -> None:
    words = ("identify", "synthetic:spencer1997", "--model", "bingham", "--every", 40, "--threads", 1)
    ended = mrwork(*words, "--quiet", "--resume", "--out", tmp_path / "run")
    assert (ended.returncode, "there is nothing to resume" in ended.stderr) == (0, True)
    assert mr.load(tmp_path / "run", mr.StoredRun).fit.model == "bingham"
    said: list[str] = []
    mr.save(fit(prediction()), tmp_path / "saved")
    with addition_journal(tmp_path / "saved", CHAIN, resume=True, replace=False, note=said.append) as journal:
        journal.agree("run", {})
    assert len(said) == 1


if __name__ == "__main__":
    kill_everywhere(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
