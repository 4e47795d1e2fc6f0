"""Runs of the cells one after another, with their progress; finished ones are files, from which a study goes on."""

from __future__ import annotations

import hashlib
import re
import shutil
import sys
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import mrwork
from mrwork.search import GenerationEvent
from studies.chapter_4.search_cells import Cell, Replicates, run_cell


def fingerprint(cell: Cell) -> str:
    """Hash of all that a cell's outcome follows from: settings, test, box, and the package itself."""
    test = cell.test
    box = cell.model.box(test)
    digest = hashlib.sha256(_package().encode())
    for part in (cell.model, cell.optimiser, cell.seed, cell.replicates, box, test.dt, test.n_settle):
        digest.update(repr(part).encode())
    for channel in (test.displacement, test.velocity, test.force):
        digest.update(np.ascontiguousarray(channel).tobytes())
    return digest.hexdigest()


def keep(folder: Path, cell: Cell, found: Replicates) -> None:
    """Write a finished cell, whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    path = _path(folder, cell)
    unfinished = path.with_suffix(".part")
    with unfinished.open("wb") as file:
        np.savez_compressed(
            file,
            fingerprint=np.array(fingerprint(cell)),
            best=found.best,
            evaluations=found.evaluations,
            unit=found.unit,
            spared=np.array(found.spared),
            seconds=np.array(found.seconds),
        )
    unfinished.replace(path)


def recall(folder: Path, cell: Cell) -> Replicates | None:
    """Read the kept replicates of a cell; `None` if there are none, their settings differ or the file is damaged."""
    path = _path(folder, cell)
    if not path.exists():
        return None
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
            if str(kept["fingerprint"]) != fingerprint(cell):
                return None
            return Replicates(
                best=kept["best"],
                evaluations=kept["evaluations"],
                unit=kept["unit"],
                spared=float(kept["spared"]),
                seconds=float(kept["seconds"]),
            )
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return None


def _path(folder: Path, cell: Cell) -> Path:
    return folder / f"{re.sub(r'[^A-Za-z0-9.]+', '-', cell.name)}.npz"


@cache
def _package() -> str:
    """Hash of every source file of the package and of the compiled core."""
    root = Path(mrwork.__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*root.rglob("*.py"), *root.glob("_rust*.so"), *root.glob("_rust*.pyd")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


_EVERY = 0.3


@dataclass(slots=True, kw_only=True)
class CellProgress:
    """One line on a terminal: cell, generation, simulations per second, time left; elsewhere a line per cell.

    `ahead` is the work that is left when a cell begins, `done` what was done since this start: samples to be simulated,
    in units of the candidates of a cell.
    """

    cells: int
    ahead: float
    done: float = 0.0
    began: float = 0.0
    shown: float = 0.0

    def running(self, place: int, cell: Cell, event: GenerationEvent[Any]) -> None:
        now = time.perf_counter()
        if not sys.stderr.isatty() or now - self.shown < _EVERY:
            return
        self.shown = now
        done = self.done + cell.test.n_time * event.generation / cell.optimiser.stop.max_generations
        left = (now - self.began) * (self.ahead / done - 1.0)
        line = (
            f"{place}/{self.cells}: generation {event.generation}, "
            f"{event.evaluations / max(event.seconds, 1e-9):,.0f} simulations/s, {_clock(left)} left, {cell.name}"
        )
        # A line that wraps cannot be written over.
        fitting = line[: shutil.get_terminal_size().columns - 1]
        print(f"\r\033[K{fitting}", end="", file=sys.stderr, flush=True)

    def finished(self, place: int, cell: Cell, found: Replicates) -> None:
        self.done += cell.test.n_time
        clear = "\r\033[K" if sys.stderr.isatty() else ""
        left = (time.perf_counter() - self.began) * (self.ahead / self.done - 1.0)
        print(
            f"{clear}{place}/{self.cells} {cell.name}: {found.evaluations[:, -1].sum()} simulations in "
            f"{found.seconds:.1f} s, {_clock(left)} left",
            file=sys.stderr,
            flush=True,
        )


def run_cells(cells: Sequence[Cell], folder: Path, *, threads: int, fresh: bool) -> tuple[Replicates, ...]:
    """Run every cell and return the replicates in order; cells kept in `folder` are run again only if `fresh`.

    An interrupt by Ctrl-C is not caught; the cells finished by then are kept.
    """
    found = {} if fresh else _recalled(cells, folder)
    if found:
        print(f"{len(found)} of {len(cells)} cells are taken from {folder}", file=sys.stderr)
    missing = [place for place in range(len(cells)) if place not in found]
    progress = CellProgress(
        cells=len(cells),
        ahead=float(sum(cells[place].test.n_time for place in missing)),
        began=time.perf_counter(),
    )
    for place in missing:
        cell = cells[place]

        def on_generation(event: GenerationEvent[Any], place: int = place, cell: Cell = cell) -> None:
            progress.running(place + 1, cell, event)

        found[place] = run_cell(cell, threads=threads, on_generation=on_generation)
        keep(folder, cell, found[place])
        progress.finished(place + 1, cell, found[place])
    return tuple(found[place] for place in range(len(cells)))


def _recalled(cells: Sequence[Cell], folder: Path) -> dict[int, Replicates]:
    kept = ((place, recall(folder, cell)) for place, cell in enumerate(cells))
    return {place: found for place, found in kept if found is not None}


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
