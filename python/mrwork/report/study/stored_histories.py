"""Histories of a study's runs, one compressed file of arrays for each."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import numpy as np

from mrwork.store.run_folder import HISTORIES, real_place, replacing
from mrwork.store.unfinished import part_of
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
        with replacing(target) as beside, beside.open("wb") as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type]

    def read(self, row: int, motion: int) -> History | None:
        """One of them, if there is."""
        path = self._path(row, motion)
        if path is None:
            return None
        with np.load(path) as arrays:
            return History(**{entry.name: arrays[entry.name].astype(np.float64) for entry in fields(History)})

    def paths(self) -> list[Path]:
        """Those that there are."""
        found = (self._path(row, motion) for row, motion in self._names)
        return [path for path in found if path is not None]

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
