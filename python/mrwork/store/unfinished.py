"""Journals of runs that are not finished: in a folder beside the place of the run, until the run is written."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from filecmp import cmp
from pathlib import Path

from mrwork.errors import JournalError, OutputError
from mrwork.store.journal import Journal
from mrwork.store.run_folder import HISTORIES, JOURNAL, MODELS, real_place

_SUFFIX = ".part"
_STEP_SUFFIX = ".jsonl"
_COPYING = "copying"


def begin_journal(path: str | Path) -> Journal:
    """A fresh journal for the run folder at `path`; an earlier run there stays as it is.

    Raises
    ------
    OutputError
        If no folder can be made for it, or there is one with something else in it.
    """
    return Journal(_folder(path) / JOURNAL)


def resume_journal(path: str | Path, *, note: Callable[[str], None]) -> Journal:
    """The journal of a run to `path` that was killed, or else of the run that is there: it may have been interrupted.

    Parameters
    ----------
    note
        Told in a sentence if the end of the journal is damaged and does not count.

    Raises
    ------
    JournalError
        If there is none, it is damaged before its end, or in use.
    OutputError
        If it cannot be written.
    """
    kept = real_place(path) / JOURNAL
    begun = part_of(path) / JOURNAL
    if not begun.is_file():
        if not kept.is_file():
            raise JournalError(
                f"there is no journal to resume, neither {part_of(path).name}/{JOURNAL} nor {JOURNAL} in {path}; "
                "run without --resume"
            )
        copy = _folder(path) / _COPYING
        try:
            # By way of a name that nothing looks for, so that a copy cut short is not taken for a journal.
            shutil.copyfile(kept, copy)
            copy.rename(begun)
        except OSError as reason:
            raise OutputError(f"cannot write {begun}: {reason.strerror}; choose another folder") from reason
    return Journal(begun, resume=True, note=note)


def discard_journal(journal: Journal) -> None:
    """Remove a journal and its folder beside the run: that is written, or not worth resuming."""
    with suppress(OSError):
        if journal.is_own:
            journal.path.unlink()
        # Where another run has a journal in there, it stays.
        journal.path.parent.rmdir()


def is_copy(path: str | Path, journal: Journal) -> bool:
    """Whether a journal holds no more than that of the run folder at `path`."""
    with suppress(OSError):
        return cmp(journal.path, real_place(path) / JOURNAL, shallow=False)
    return False


def part_of(path: str | Path) -> Path:
    """The folder beside the run folder at `path` that holds the journal until the run is finished."""
    place = real_place(path)
    return place.with_name(place.name + _SUFFIX)


class StepJournals:
    """A journal for each step of a comparison, such as `dahl/fit`, in `models` of the folder beside the run.

    Parameters
    ----------
    path
        Where the run will be written.
    resume
        Keep what is there and go on from it; else what an earlier comparison left there goes.
    note
        Told in a sentence if the end of a journal is damaged and does not count.

    Raises
    ------
    JournalError
        On resuming, if there is nothing to go on from.
    OutputError
        If the folder cannot be written.
    """

    def __init__(self, path: str | Path, *, resume: bool, note: Callable[[str], None] | None = None) -> None:
        self._folder = part_of(path) / MODELS
        self._resume = resume
        self._note = note
        if resume:
            if not self._folder.is_dir():
                raise JournalError(
                    f"there is no comparison to resume in {self._folder.parent.name}/{MODELS}; run without --resume"
                )
            return
        try:
            if self._folder.exists():
                shutil.rmtree(self._folder)
            self._folder.mkdir(parents=True)
        except OSError as reason:
            raise OutputError(
                f"cannot make {self._folder}: {reason.strerror}; choose another folder"
            ) from reason

    def __call__(self, step: str) -> Journal:
        """The journal of a step: fresh, or resumed where there is one."""
        path = self.path(step)
        path.parent.mkdir(exist_ok=True)
        return Journal(path, resume=self._resume and path.is_file(), note=self._note)

    def path(self, step: str) -> Path:
        """Where the journal of a step lies."""
        return self._folder / f"{step}{_STEP_SUFFIX}"

    def discard(self) -> None:
        """Remove them: the run is written, or not worth resuming."""
        with suppress(OSError):
            shutil.rmtree(self._folder)
            # Where a run has a journal in there, it stays.
            self._folder.parent.rmdir()


def _folder(path: str | Path) -> Path:
    folder = part_of(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        foreign = sorted({entry.name for entry in folder.iterdir()} - {JOURNAL, _COPYING, MODELS, HISTORIES})
    except OSError as reason:
        raise OutputError(f"cannot make {folder}: {reason.strerror}; choose another folder") from reason
    if foreign:
        raise OutputError(
            f"{folder} is where the journal of the run belongs, but it holds {foreign[0]}; choose another folder"
        )
    return folder
