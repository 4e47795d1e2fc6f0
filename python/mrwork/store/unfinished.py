"""Journals of unfinished runs, in a folder `RUN.part` beside the run folder until the run is written."""

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
    """Begin a journal for the run folder at `path`; an earlier run there does not change.

    Raises
    ------
    OutputError
        If the folder for the journal cannot be created, or holds other files.
    """
    return Journal(_folder(path) / JOURNAL)


def resume_journal(path: str | Path, *, note: Callable[[str], None]) -> Journal:
    """Resume the journal of an unfinished run to `path`, or that of the run at `path`, which may have been interrupted.

    Parameters
    ----------
    path
        The run folder.
    note
        Called with a sentence if the end of the journal is damaged and ignored.

    Raises
    ------
    JournalError
        If there is no journal, if it is damaged before its end, or if another process is writing it.
    OutputError
        If the journal cannot be written.
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
            # Copied under another name first, so that an incomplete copy is not taken for a journal.
            shutil.copyfile(kept, copy)
            copy.rename(begun)
        except OSError as reason:
            raise OutputError(f"cannot write {begun}: {reason.strerror}; choose another folder") from reason
    return Journal(begun, resume=True, note=note)


def discard_journal(journal: Journal) -> None:
    """Remove a journal that is no longer needed, and its folder."""
    with suppress(OSError):
        if journal.is_own:
            journal.path.unlink()
        # Fails, and keeps the folder, if it holds another journal.
        journal.path.parent.rmdir()


def is_copy(path: str | Path, journal: Journal) -> bool:
    """Whether a journal equals that of the run folder at `path`."""
    with suppress(OSError):
        return cmp(journal.path, real_place(path) / JOURNAL, shallow=False)
    return False


def part_of(path: str | Path) -> Path:
    """Folder for the journal of an unfinished run to `path`."""
    place = real_place(path)
    return place.with_name(place.name + _SUFFIX)


def is_part(path: Path) -> bool:
    """Whether it is the folder of the journal of an unfinished run."""
    return path.name.endswith(_SUFFIX) and path.is_dir()


class StepJournals:
    """Journals of the steps of a comparison of models, such as `dahl/fit`.

    Parameters
    ----------
    path
        The run folder.
    resume
        Whether to continue existing journals; otherwise they are removed.
    note
        Called with a sentence if the end of a journal is damaged and ignored.

    Raises
    ------
    JournalError
        On resuming, if there are no journals.
    OutputError
        If the folder for the journals cannot be written.
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
        """Journal of a step: resumed if there is one, else begun."""
        path = self.path(step)
        path.parent.mkdir(exist_ok=True)
        return Journal(path, resume=self._resume and path.is_file(), note=self._note)

    def path(self, step: str) -> Path:
        """Path of the journal of a step."""
        return self._folder / f"{step}{_STEP_SUFFIX}"

    def discard(self) -> None:
        """Remove the journals, which are no longer needed."""
        with suppress(OSError):
            shutil.rmtree(self._folder)
            # Fails, and keeps the folder, if it holds another journal.
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
