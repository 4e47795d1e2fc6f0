"""The folder of a run: written whole or not at all, and read back as a `Fit`.

A run is written into a hidden folder beside its place and then renamed into it, so that an earlier run
there stays as it was until the new one is complete on the disk.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.errors import OutputError, RecordError
from mrwork.identification.fit import Fit
from mrwork.report.fit_json import fit_from_json, json_document

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MANIFEST = "manifest.json"
FIT = "fit.json"
JOURNAL = "journal.jsonl"
REPORT = "report.html"
FIGURES = "figures"
# What later verbs add: the chain and the draws made of it, profiles, a plan, calibrated bands and the predictions they
# are calibrated on. They go with the fit they were made of.
CHAIN = "posterior.h5"
DRAWS = "posterior.nc"
PROFILES = "profiles.json"
PLAN = "plan.json"
CALIBRATION = "calibration.json"
FOLDS = "left_out"
PREDICTIONS = "predictions.npz"
# What a comparison of models adds: the ranking, and in a folder for each the fit of every model.
RANKING = "ranking.json"
MODELS = "models"
# What a study of buildings writes: the histories of its runs.
HISTORIES = "histories"

_ADDED = frozenset({CHAIN, DRAWS, PROFILES, PLAN, CALIBRATION, FOLDS, PREDICTIONS, RANKING, MODELS})
_WRITTEN = _ADDED | {MANIFEST, FIT, JOURNAL, REPORT, FIGURES}
_BESIDE = ".mrwork-"
_DISK_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def check_destination(path: str | Path) -> None:
    """Refuse a place where a run must not or cannot be written, before any work is done for it.

    Raises
    ------
    OutputError
        If `path` is a file, a folder with something else in it, or lies where nothing can be written.
    """
    place = real_place(path)
    try:
        _refuse_foreign(place, path)
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=_BESIDE, dir=place.parent):
            pass
    except OutputError:
        raise
    except OSError as reason:
        raise _cannot_write(path, reason) from reason


def write_run(
    path: str | Path,
    *,
    fit: Fit,
    report_html: str,
    figures: Mapping[str, Figure],
    manifest: Mapping[str, Any],
    journal: str | Path,
    documents: Mapping[str, object] | None = None,
    flush: bool = True,
) -> Path:
    """Write a run directory, in place of an earlier run if there is one.

    Holds `manifest.json`, `fit.json`, `journal.jsonl`, `report.html` and every figure as
    `figures/<name>.svg` and `.png`. Files that a person has added to the earlier run are kept.

    Parameters
    ----------
    path
        The folder; its parents are made.
    manifest
        Facts about the run. Like all that is written here it may hold numpy numbers and paths;
        numbers that are not finite become `null`.
    journal
        File with the steps of the run, which is copied.
    documents
        More to be written as JSON, by the path inside the folder.
    flush
        Wait until it is on the disk, but for a fit that was interrupted.

    Raises
    ------
    OutputError
        If `path` is a file or somebody else's folder, or if anything cannot be written. The place is
        then as it was before.
    """

    def fill(fresh: Path) -> None:
        (fresh / FIGURES).mkdir()
        _write(fresh / MANIFEST, json_document(manifest).encode())
        _write(fresh / FIT, json_document(fit.as_dict()).encode())
        shutil.copyfile(journal, fresh / JOURNAL)
        _write(fresh / REPORT, report_html.encode())
        _write_figures(fresh / FIGURES, figures)
        for name, document in (documents or {}).items():
            (fresh / name).parent.mkdir(parents=True, exist_ok=True)
            _write(fresh / name, json_document(document).encode())

    # Whoever pressed Ctrl-C waits for the prompt; the system flushes that run when it gets to it.
    write_folder(path, fill, written=_WRITTEN, flush=flush and fit.status != "interrupted")
    return Path(path)


def write_folder(
    path: str | Path, fill: Callable[[Path], None], *, written: Collection[str], flush: bool = True
) -> None:
    """Put a folder that `fill` fills at `path`, whole or not at all, in place of an earlier one.

    Parameters
    ----------
    fill
        Writes into an empty folder; it may raise an OSError. A manifest must be among what it writes.
    written
        Names that runs of this kind write; whatever else lies in the earlier one is a person's, and kept.
    flush
        Wait until it is on the disk.

    Raises
    ------
    OutputError
        If `path` is a file or somebody else's folder, or if anything cannot be written. The place is then as it was.
    """
    place = real_place(path)
    try:
        _refuse_foreign(place, path)
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=_BESIDE, dir=place.parent))
    except OutputError:
        raise
    except OSError as reason:
        raise _cannot_write(path, reason) from reason
    try:
        fresh = beside / "new"
        fresh.mkdir()
        fill(fresh)
        _keep_additions(place, fresh, written)
        if flush:
            _flush(fresh)
        _swap(fresh, place, beside / "old")
    except OSError as reason:
        raise _cannot_write(path, reason) from reason
    finally:
        _discard(beside, place)


def read_fit(path: str | Path) -> Fit:
    """The `Fit` of the run directory at `path`.

    Raises
    ------
    RecordError
        If there is no such folder, it is not a run directory, or its fit cannot be understood.
    """
    place = Path(path)
    if not place.is_dir():
        what = "is a file" if place.exists() else "does not exist"
        raise RecordError(f"{path} {what}; give the run directory that `mrwork identify --out` wrote")
    if not (place / MANIFEST).is_file():
        raise RecordError(
            f"{path} is not a run directory, it has no {MANIFEST}; "
            "give the folder that `mrwork identify --out` wrote"
        )
    origin = place / FIT
    try:
        text = origin.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise RecordError(f"{origin} is not UTF-8 text; run `mrwork identify` again") from None
    except OSError as reason:
        cause = reason.strerror
        raise RecordError(f"{origin} cannot be read ({cause}); run `mrwork identify` again") from reason
    return fit_from_json(text, origin=str(origin))


def real_place(path: str | Path) -> Path:
    """Where the run directory at `path` really lies: a link to one stays a link."""
    return Path(os.path.realpath(path))


def _refuse_foreign(place: Path, path: str | Path) -> None:
    if place.is_dir():
        if not (place / MANIFEST).is_file() and any(place.iterdir()):
            raise OutputError(
                f"{path} holds files but no {MANIFEST}, so it is not a run directory and is left as it is; "
                "choose another folder"
            )
    elif place.exists():
        raise OutputError(f"{path} is a file, a run needs a folder; choose another name")


def _write_figures(folder: Path, figures: Mapping[str, Figure]) -> None:
    if not figures:
        return
    # Loaded here, for whoever reads or interrupts a run must not wait for matplotlib.
    from mrwork.report.svg import png_bytes, svg_bytes

    for name, figure in figures.items():
        _write(folder / f"{name}.svg", svg_bytes(figure))
        _write(folder / f"{name}.png", png_bytes(figure))


def _keep_additions(place: Path, fresh: Path, written: Collection[str]) -> None:
    """Copy what a person has put into the earlier run, which must stay whole until the swap."""
    if not place.exists():
        return
    for entry in place.iterdir():
        if entry.name in written:
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.copytree(entry, fresh / entry.name, symlinks=True)
        else:
            shutil.copy2(entry, fresh / entry.name, follow_symlinks=False)


def _swap(fresh: Path, place: Path, aside: Path) -> None:
    """Put `fresh` at `place`; what was there goes `aside`, or back if anything fails."""
    try:
        if place.exists():
            place.rename(aside)
        fresh.rename(place)
    except BaseException:
        if aside.exists() and not place.exists():
            aside.rename(place)
        raise


def _discard(beside: Path, place: Path) -> None:
    # While nothing stands at `place`, the earlier run in here is the only one there is.
    if place.exists() or not (beside / "old").exists():
        shutil.rmtree(beside, ignore_errors=True)


def _write(target: Path, content: bytes) -> None:
    with target.open("xb") as stream:
        stream.write(content)


def _flush(folder: Path) -> None:
    """Make a folder and all in it last through a power cut, before it takes the place of an earlier run."""
    for path in (*folder.rglob("*"), folder):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as reason:
            # Some systems cannot flush a folder; a full disk is another matter.
            if path.is_file() or reason.errno in _DISK_FULL:
                raise
        finally:
            os.close(descriptor)


def _cannot_write(path: str | Path, reason: OSError) -> OutputError:
    if reason.errno in _DISK_FULL:
        cause, remedy = "the disk is full", "free some space"
    else:
        cause, remedy = reason.strerror or str(reason), "choose another folder"
    return OutputError(f"cannot write the run to {path}: {cause}; {remedy}, what was there is untouched")
