"""Histories of a study's runs, one compressed file of arrays for each."""

from __future__ import annotations

import os
import re
from dataclasses import fields
from pathlib import Path

import numpy as np

from mrwork.errors import OutputError
from mrwork.report.run_directory import HISTORIES, real_place
from mrwork.report.unfinished import part_of
from mrwork.study.run_result import History
from mrwork.study.study import Study


class Histories:
    """Those of the study to be written to `path`: beside it while it runs; also in an earlier run, if it is resumed.

    They are kept in single precision; time in double.
    """

    def __init__(self, path: Path, study: Study, *, resume: bool) -> None:
        self._begun = part_of(path) / HISTORIES
        self._folders = (self._begun, real_place(path) / HISTORIES) if resume else (self._begun,)
        if not resume:
            self.discard()
        self._names = {
            (
                row,
                motion,
            ): f"{row + 1:02d}-{motion + 1:02d}-{stem_of(each.row.label)}-{stem_of(ground.name)}.npz"
            for row, each in enumerate(study.arrangements)
            for motion, ground in enumerate(study.motions)
        }

    def kept(self, row: int, motion: int) -> bool:
        """Whether there is one."""
        return self._path(row, motion) is not None

    def keep(self, row: int, motion: int, history: History) -> None:
        """Write one, whole or not at all.

        Raises
        ------
        OutputError
            Where it cannot be written.
        """
        arrays = {
            entry.name: np.asarray(
                getattr(history, entry.name), dtype=np.float64 if entry.name == "time" else np.float32
            )
            for entry in fields(History)
        }
        target = self._begun / self._names[row, motion]
        try:
            self._begun.mkdir(parents=True, exist_ok=True)
            beside = target.with_suffix(f".{os.getpid()}.part")
            with beside.open("wb") as stream:
                np.savez(stream, **arrays)  # type: ignore[arg-type]
            beside.replace(target)
        except OSError as reason:
            raise OutputError(
                f"cannot write {target}: {reason.strerror}; make room or choose another folder"
            ) from reason

    def read(self, row: int, motion: int) -> History | None:
        """One of them, if there is."""
        path = self._path(row, motion)
        if path is None:
            return None
        with np.load(path) as arrays:
            return History(**{entry.name: arrays[entry.name].astype(np.float64) for entry in fields(History)})

    def move_into(self, folder: Path) -> None:
        """Put all that there are into the folder of the finished study."""
        (folder / HISTORIES).mkdir()
        for (row, motion), name in self._names.items():
            path = self._path(row, motion)
            if path is not None:
                # A second name for the same file, so that what is here stays if the rest fails.
                _linked(path, folder / HISTORIES / name)

    def discard(self) -> None:
        """Remove those beside the place of the study, which has them now."""
        if self._begun.is_dir():
            for path in self._begun.iterdir():
                path.unlink(missing_ok=True)
            self._begun.rmdir()

    def _path(self, row: int, motion: int) -> Path | None:
        name = self._names[row, motion]
        return next((folder / name for folder in self._folders if (folder / name).is_file()), None)


def stem_of(name: str) -> str:
    """A label as part of a file's name."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("._") or "run"


def _linked(path: Path, target: Path) -> None:
    try:
        os.link(path, target)
    except OSError:
        target.write_bytes(path.read_bytes())
