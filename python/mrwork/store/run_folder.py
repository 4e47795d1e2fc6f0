"""The folder of a run: its file names, and how it is written whole or not at all.

A run is written into a hidden folder beside its place and then renamed into it, so that an earlier run there stays as
it was until the new one is complete on the disk. A file that is added later is written beside its place and renamed.
What a file holds is known to the module of its type.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from mrwork.errors import OutputError

MANIFEST = "manifest.json"
JOURNAL = "journal.jsonl"
REPORT = "report.html"
FIGURES = "figures"
FIT = "fit.json"
# Added to the folder of a fit by later verbs; they belong to that fit and go when another takes its place.
CHAIN = "posterior.h5"
DRAWS = "posterior.nc"
PROFILES = "profiles.json"
PLAN = "plan.json"
CALIBRATION = "calibration.json"
FOLDS = "left_out"
PREDICTIONS = "predictions.npz"
# Added by a comparison of models: the ranking, and the fit of every model in a folder of its own.
RANKING = "ranking.json"
MODELS = "models"
# Written by a study of buildings.
RESULTS = "results.json"
STUDY = "study.toml"
HISTORIES = "histories"

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
    """Write a folder at `path`, whole or not at all, in place of an earlier one.

    Parameters
    ----------
    contents
        Files by their paths inside the folder, a manifest among them.
    copied
        Existing files to be copied, by their paths inside the folder.
    linked
        The same for files that do not change any more: they get a second name where the file system can do that.
    folders
        Folders to be made even if nothing lies in them.
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
        _fill(fresh, contents, copied, linked or {}, folders)
        _keep_additions(place, fresh, written)
        if flush:
            _flush(fresh)
        _swap(fresh, place, beside / "old")
    except OSError as reason:
        raise _cannot_write(path, reason) from reason
    finally:
        _discard(beside, place)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path beside `path`, for the block to write a file to, which is renamed to `path` at the end of the block.

    Raises
    ------
    OutputError
        Where the file cannot be written; what was at `path` is then as it was.
    """
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
    """Write files into a run folder, each whole or not at all, in place of earlier ones; keys are paths inside it.

    Raises
    ------
    OutputError
        Where one cannot be written.
    """
    for name, content in contents.items():
        with replacing(folder / name) as beside:
            beside.write_bytes(content)


def real_place(path: str | Path) -> Path:
    """Where the run folder at `path` really lies: a link to one stays a link."""
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
