"""Folder of a run: names of its files, and atomic writing.

A run is written to a hidden folder in the same directory, which is then renamed, so that an earlier run is replaced
only when the new one is complete on the disk. Files added later are written to a temporary name and renamed. The
contents of each file are defined in the module of its type.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from mrwork.errors import JournalError, OutputError
from mrwork.store.lock import Lock

MANIFEST = "manifest.json"
JOURNAL = "journal.jsonl"
REPORT = "report.html"
FIGURES = "figures"
FIT = "fit.json"
# Added to the folder of a fit by later verbs; removed when another fit replaces it.
CHAIN = "posterior.jsonl"
DRAWS = "posterior.nc"
PROFILES = "profiles.json"
PLAN = "plan.json"
CALIBRATION = "calibration.json"
FOLDS = "left_out"
PREDICTIONS = "predictions.npz"
# The chain in folders of earlier versions.
FORMER_CHAIN = "posterior.h5"
ADDITIONS = frozenset(
    {CHAIN, f"{CHAIN}.part", FORMER_CHAIN, DRAWS, PROFILES, PLAN, CALIBRATION, FOLDS, PREDICTIONS}
)
# Added by a comparison of models: the ranking, and a folder with the fit of each model.
RANKING = "ranking.json"
MODELS = "models"
# Added by a choice of current laws: the laws that were tried.
LAWS = "laws.json"
# Written by a study of buildings.
RESULTS = "results.json"
STUDY = "study.toml"
HISTORIES = "histories"

_BESIDE = ".mrwork-"
_PROBE = ".mrwork_probe-"
# In the folder of a writer: its lock, the run that it writes, and the earlier run by its name, set aside.
_WRITER, _NEW, _OLD = "writer", "new", "old"
# Age of the folder of a writer that may be one of a killed one [s].
_LEFT = 60.0
_DISK_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def check_destination(path: str | Path) -> None:
    """Check that a run can be written to `path`, before any computation.

    Raises
    ------
    OutputError
        If `path` is a file or a folder that is not a run folder, or if nothing can be written there.
    """
    place = real_place(path)
    try:
        _refuse_foreign(place, path)
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=_PROBE, dir=place.parent):
            pass
        sweep(place.parent)
    except OutputError:
        raise
    except OSError as reason:
        raise _cannot_write(path, reason) from reason


def write_folder(
    path: str | Path,
    contents: Mapping[str, bytes],
    *,
    copied: Mapping[str, Path],
    linked: Mapping[str, Path] | None = None,
    folders: Collection[str] = (),
    written: Collection[str],
    flush: bool = True,
) -> None:
    """Write a folder to `path` atomically, replacing an earlier run.

    Parameters
    ----------
    contents
        Path inside the folder to content; one file is the manifest.
    copied
        Path inside the folder to an existing file to copy.
    linked
        The same for files that no longer change: hard links, or copies if the file system has no links.
    folders
        Folders to create even if they stay empty.
    written
        Names that runs of this kind write. Other files in the earlier folder are the user's and are kept.
    flush
        Whether to wait until the folder is on the disk.

    Raises
    ------
    OutputError
        If `path` is a file or a folder that is not a run folder, or if writing fails; the earlier run is unchanged.
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
        with Lock(beside / _WRITER):
            fresh = beside / _NEW
            fresh.mkdir()
            _fill(fresh, contents, copied, linked or {}, folders)
            _keep_additions(place, fresh, written)
            if flush:
                _flush(fresh)
            (beside / _OLD).mkdir()
            _swap(fresh, place, beside / _OLD / place.name)
    except OSError as reason:
        raise _cannot_write(path, reason) from reason
    finally:
        _discard(beside)


def sweep(folder: Path) -> None:
    """Remove what killed writers have left in a folder; an earlier run that one had set aside is put back."""
    for left in folder.glob(f"{_BESIDE}*"):
        with suppress(JournalError, OSError):
            if time.time() - left.stat().st_mtime > _LEFT:
                with Lock(left / _WRITER):
                    _discard(left)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Temporary path to which the block writes a file; it is renamed to `path` at the end of the block.

    Raises
    ------
    OutputError
        If the file cannot be written; an earlier file at `path` is then unchanged.
    """
    if "\0" in str(path):
        raise OutputError(f"cannot write {str(path)!r}: no file has such a name; give another")
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        beside.replace(path)
    except OSError as reason:
        raise OutputError(
            f"cannot write {path}: {reason.strerror or reason}; make room, or give leave to write there"
        ) from reason
    finally:
        beside.unlink(missing_ok=True)


def write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files into a run folder, each atomically; keys are paths inside the folder.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    for name, content in contents.items():
        with replacing(folder / name) as beside:
            beside.write_bytes(content)


def real_place(path: str | Path) -> Path:
    """Path with symbolic links resolved, so that writing to a link replaces its target and not the link."""
    return Path(os.path.realpath(path))


def _refuse_foreign(place: Path, path: str | Path) -> None:
    if place.is_dir():
        if not (place / MANIFEST).is_file() and any(place.iterdir()):
            raise OutputError(
                f"{path} holds files but no {MANIFEST}, so it is not a run folder and is left as it is; "
                "choose another folder"
            )
    elif place.exists():
        raise OutputError(f"{path} is a file, a run needs a folder; choose another name")


def _fill(
    folder: Path,
    contents: Mapping[str, bytes],
    copied: Mapping[str, Path],
    linked: Mapping[str, Path],
    folders: Collection[str],
) -> None:
    for name in {*folders, *(str(Path(name).parent) for name in (*contents, *copied, *linked))}:
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    for name, source in copied.items():
        shutil.copyfile(source, folder / name)
    for name, source in linked.items():
        try:
            os.link(source, folder / name)
        except OSError:
            shutil.copyfile(source, folder / name)


def _keep_additions(place: Path, fresh: Path, written: Collection[str]) -> None:
    """Copy the user's files from the earlier run, which must stay complete until the swap."""
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
    """Move `place` to `aside` and `fresh` to `place`; undo the first move if the second fails."""
    try:
        if place.exists():
            place.rename(aside)
        fresh.rename(place)
    except BaseException:
        if aside.exists() and not place.exists():
            aside.rename(place)
        raise


def _discard(beside: Path) -> None:
    """Remove the folder of a writer; an earlier run of which it has the only copy is put back first."""
    aside = beside / _OLD
    for kept in aside.iterdir() if aside.is_dir() else ():
        place = beside.parent / kept.name
        if not place.exists():
            try:
                kept.rename(place)
            except OSError:
                # The folder stays, with the run.
                return
    shutil.rmtree(beside, ignore_errors=True)


def _flush(folder: Path) -> None:
    """Flush a folder and its files to the disk, so that they survive a power cut."""
    for path in (*folder.rglob("*"), folder):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as reason:
            # Some systems cannot flush a folder, which is harmless; a full disk is an error.
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
