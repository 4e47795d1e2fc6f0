"""The frame of a verb that computes a run folder: its place, its run with progress, and what Ctrl-C leaves of it."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from mrwork.base.progress import ProgressLine
from mrwork.cli.output import progress_line
from mrwork.cli.terminal import note
from mrwork.errors import Interrupted
from mrwork.store.run_folder import RunKind
from mrwork.store.run_writer import RunAtWork, is_complete, nothing_to_resume

Result = TypeVar("Result")


def command_line() -> str:
    """The command line as text for a shell: `mrwork` and the given words, quoted where needed."""
    return shlex.join(["mrwork", *sys.argv[1:]])


def work_of(options: argparse.Namespace, kind: RunKind, default: str) -> RunAtWork:
    """The run in the folder of the command line, or `default` in `out`; a folder of another verb is refused."""
    folder = options.out or Path("out") / default
    work = RunAtWork(folder, kind, replace=options.replace, resume=options.resume, note=note)
    work.run()
    return work


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """The options of a verb, the run folder that it writes, and what that has after Ctrl-C, in words."""

    options: argparse.Namespace
    work: RunAtWork
    kept: str

    @property
    def folder(self) -> Path:
        """The run folder that the verb writes."""
        return self.work.path

    def compute(
        self, compute: Callable[[ProgressLine], Result], *, patience: float = 0.0, before: str = ""
    ) -> tuple[Result | None, int]:
        """The result with a progress line, after Ctrl-C what there is of it; and the exit status, 0 or 130.

        `before` says what has not happened where there is nothing.
        """
        try:
            with progress_line(self.options, patience=patience) as line:
                return compute(line), 0
        except Interrupted as interrupt:
            if interrupt.result is None:
                note(f"interrupted before {before}; run the same command with --resume to continue")
            return interrupt.result, 130

    def note_complete(self) -> None:
        """Say where a run that was resumed has done nothing, since it was complete."""
        if self.work.is_as_before:
            note(nothing_to_resume(self.folder))

    def is_to_write(self, status: int) -> bool:
        """Whether the folder is written: after Ctrl-C not in place of a complete run."""
        return status == 0 or not is_complete(self.folder)

    def note_stop(self, *, written: bool) -> None:
        """Say what is saved after Ctrl-C, and how to continue."""
        where = f"{self.kept} so far is in {self.folder}"
        if not written:
            where = f"{self.folder} keeps the complete run that it has"
        note(f"interrupted; {where}; run the same command with --resume to continue")
