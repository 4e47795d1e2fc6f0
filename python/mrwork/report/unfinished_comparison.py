"""The journals of a comparison of models that is not finished: one for each step, beside the place of its run."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from mrwork.errors import JournalError, OutputError
from mrwork.report.run_directory import MODELS
from mrwork.report.unfinished import part_of
from mrwork.store import Journal

_SUFFIX = ".jsonl"


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
        return self._folder / f"{step}{_SUFFIX}"

    def discard(self) -> None:
        """Remove them: the run is written, or not worth resuming."""
        with suppress(OSError):
            shutil.rmtree(self._folder)
            # Where a run has a journal in there, it stays.
            self._folder.parent.rmdir()
