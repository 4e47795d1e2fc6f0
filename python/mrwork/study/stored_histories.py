"""Histories of the runs of a study, a file of arrays for each."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from mrwork.closed_loop.responses import history_signals
from mrwork.errors import RecordError
from mrwork.store.input_file import finite_numbers, is_there, read_arrays, stored
from mrwork.store.output_file import refuse_link, replacing
from mrwork.store.run_folder import HISTORIES, part_of, real_place
from mrwork.study.run_result import RunHistory
from mrwork.study.study import Study
from mrwork.values import Floats

# Hours of a tall building.
_KIND = replace(stored("respond", name="the history of a run"), largest=4 << 30)
# Input, kinetic, strain, damping and devices.
_ENERGIES = 5


class Histories:
    """Histories of the study to be written to `path`, in single precision except for time.

    While the study runs, they are stored in a folder beside `path`; a resumed study also reads those in `path`.
    """

    def __init__(self, path: Path, study: Study, *, resume: bool) -> None:
        self._study = study
        self._begun = part_of(path) / HISTORIES
        self._folders = (self._begun, real_place(path) / HISTORIES) if resume else (self._begun,)
        for folder in (self._begun.parent, *self._folders):
            refuse_link(folder)
        self._damaged: set[Path] = set()
        if not resume:
            self.discard()
        self._names = {
            (
                row,
                motion,
            ): f"{row + 1:02d}-{motion + 1:02d}-{stem_of(each.label)}-{stem_of(of_study.name)}.npz"
            for row, each in enumerate(study.rows)
            for motion, of_study in enumerate(study.motions)
        }

    def kept(self, row: int, motion: int) -> bool:
        """Whether the history of a run is stored and whole; a damaged file is left out from now on."""
        while (path := self._path(row, motion)) is not None:
            try:
                self._read(path, row, motion)
            except RecordError:
                self._damaged.add(path)
            else:
                return True
        return False

    def keep(self, row: int, motion: int, history: RunHistory) -> None:
        """Store the history of a run, whole or not at all."""
        arrays = {
            entry.name: np.asarray(
                getattr(history, entry.name), dtype=np.float64 if entry.name == "time" else np.float32
            )
            for entry in fields(RunHistory)
        }
        target = self._begun / self._names[row, motion]
        with replacing(target) as stream:
            np.savez(stream, **arrays)  # type: ignore[arg-type] # no array is called allow_pickle
        self._damaged.discard(target)

    def read(self, row: int, motion: int) -> RunHistory | None:
        """The history of a run, if it is stored."""
        path = self._path(row, motion)
        return None if path is None else self._read(path, row, motion)

    def paths(self) -> list[Path]:
        """Files of all stored histories."""
        found = (self._path(row, motion) for row, motion in self._names)
        return [path for path in found if path is not None]

    def discard(self) -> None:
        """Remove the folder beside the study, which has the histories now."""
        if self._begun.is_dir():
            for path in self._begun.iterdir():
                path.unlink(missing_ok=True)
            self._begun.rmdir()

    def _path(self, row: int, motion: int) -> Path | None:
        name = self._names[row, motion]
        found = [folder / name for folder in self._folders]
        for path in found:
            # It is linked or copied into the folder of the study.
            refuse_link(path)
        return next((path for path in found if path not in self._damaged and is_there(path, _KIND)), None)

    def _read(self, path: Path, row: int, motion: int) -> RunHistory:
        study, arrays = self._study, read_arrays(path, _KIND)
        try:
            history = RunHistory(
                **{each.name: finite_numbers(arrays, each.name) for each in fields(RunHistory)}
            )
            _check_time(history.time, study.grounds[motion].duration, study.hardware.sample_time)
            for name, shape in _shapes(study, row).items():
                found, expected = getattr(history, name).shape, (history.time.size, *shape)
                if found != expected:
                    raise ValueError(f"{name} has the shape {found} where {expected} was expected")
        except ValueError as reason:
            raise RecordError(f"{path} is not the history of this run ({reason}); {_KIND.remedy}") from None
        return history


def _check_time(time: Floats, duration: float, sample_time: float) -> None:
    """Check that there is a sample at every step, from the start of a motion to its end [s]."""
    expected = np.arange(time.size) * sample_time
    if time.ndim != 1 or not np.array_equal(time, expected):
        raise ValueError(f"its times are not those of samples every {sample_time:g} s")
    # A motion need not end at a sample.
    if not abs(duration / sample_time - time.size) < 2.0:
        raise ValueError(f"it has {time.size} samples every {sample_time:g} s of a motion of {duration:g} s")


def _shapes(study: Study, row: int) -> dict[str, tuple[int, ...]]:
    """Shape of one sample of each signal in the histories of a row."""
    arrangement = study.arrangements[row] if row < len(study.arrangements) else study.at_zero
    sizes = {
        "run": (),
        "floor": (len(arrangement.floors),),
        "storey": (len(arrangement.storeys),),
        "device": (len(arrangement.devices),),
    }
    known = {each.name for each in fields(RunHistory)}
    return {"energy": (_ENERGIES,)} | {
        signal.name: sizes[signal.axis] for signal in history_signals() if signal.name in known
    }


def stem_of(name: str) -> str:
    """A label as part of the name of a file."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("._") or "run"
