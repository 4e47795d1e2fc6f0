"""Runs of the cells one after another, with their progress; finished ones are files, from which a study goes on."""

from __future__ import annotations

import hashlib
import re
import time
import zipfile
from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np

import mrwork
from studies.chapter_4.search_cells import Cell, Replicates, run_cell
from studies.former.command import Say


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
        parts = {field.name: np.asarray(getattr(found, field.name)) for field in fields(found)}
        np.savez_compressed(file, fingerprint=np.array(fingerprint(cell)), **parts)
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
            parts = {field.name: kept[field.name] for field in fields(Replicates)}
            return Replicates(**parts | {name: float(parts[name]) for name in ("spared", "seconds")})
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


def run_cells(
    cells: Sequence[Cell], folder: Path, *, threads: int, fresh: bool, say: Say
) -> tuple[Replicates, ...]:
    """Run every cell and return the replicates in order; cells kept in `folder` are run again only if `fresh`.

    An interrupt by Ctrl-C is not caught; the cells finished by then are kept.
    """
    found = {} if fresh else _recalled(cells, folder)
    if found:
        say(f"{len(found)} of {len(cells)} cells are taken from {folder}")
    missing = [place for place in range(len(cells)) if place not in found]
    left, began = sum(cells[place].test.n_time for place in missing), time.perf_counter()
    done = 0
    for place in missing:
        cell = cells[place]
        found[place] = run_cell(cell, threads=threads)
        keep(folder, cell, found[place])
        done += cell.test.n_time
        seconds = (time.perf_counter() - began) * (left / done - 1.0)
        simulations = found[place].evaluations[:, -1].sum()
        say(f"{place + 1}/{len(cells)} {cell.name}: {simulations} simulations, {seconds / 60.0:.1f} min left")
    return tuple(found[place] for place in range(len(cells)))


def _recalled(cells: Sequence[Cell], folder: Path) -> dict[int, Replicates]:
    kept = ((place, recall(folder, cell)) for place, cell in enumerate(cells))
    return {place: found for place, found in kept if found is not None}
