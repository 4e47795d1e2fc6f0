"""The journal of a run that is not finished: beside the place of the run, moved into it when it is."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from filecmp import cmp
from pathlib import Path

from mrwork.errors import JournalError, OutputError
from mrwork.report.run_directory import HISTORIES, JOURNAL, MODELS, real_place
from mrwork.store import Journal

_SUFFIX = ".part"
_COPYING = "copying"


def begin_journal(path: str | Path) -> Journal:
    """A fresh journal for the run directory at `path`; an earlier run there stays as it is.

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
    """Whether a journal holds no more than that of the run directory at `path`."""
    with suppress(OSError):
        return cmp(journal.path, real_place(path) / JOURNAL, shallow=False)
    return False


def part_of(path: str | Path) -> Path:
    """The folder beside the run directory at `path` that holds the journal until the run is finished."""
    place = real_place(path)
    return place.with_name(place.name + _SUFFIX)


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
