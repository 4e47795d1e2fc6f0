"""Run folders that are written whole or not at all.

A run is written to a hidden folder in the same directory, which is then renamed, so that an earlier run is replaced
only when the new one is complete on the disk.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

from mrwork.errors import JournalError, OutputError
from mrwork.store.destination import Destination, complete_manifest
from mrwork.store.input_file import digest_of_content, digest_of_file
from mrwork.store.lock import Lock
from mrwork.store.run_folder import MANIFEST

_BESIDE = ".mrwork-"
_PROBE = ".mrwork_probe-"
# In the folder of a writer: its lock, the run that it writes, and the earlier run by its name, set aside.
_WRITER, _NEW, _OLD = "writer", "new", "old"
# Age of the folder of a writer that may be one of a killed one [s].
_LEFT = 60.0
_DISK_FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})


def check_destination(destination: Destination) -> None:
    """Check that a run can be written to its destination, before any computation."""
    parent = destination.place.parent
    try:
        destination.check_owner()
        parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=_PROBE, dir=parent):
            pass
        sweep(parent)
    except OutputError:
        raise
    except OSError as reason:
        raise _cannot_write(destination, reason) from reason


def write_folder(
    destination: Destination,
    contents: Mapping[str, bytes],
    *,
    manifest: Mapping[str, object],
    copied: Mapping[str, Path],
    linked: Mapping[str, Path] | None = None,
    folders: Collection[str] = (),
    flush: bool = True,
) -> None:
    """Write a run folder atomically, replacing an earlier run; files of the user in it are kept.

    Parameters
    ----------
    contents
        Path inside the folder to content.
    manifest
        Facts about the run; the manifest also has the verb and the digests of the files.
    copied
        Path inside the folder to an existing file to copy.
    linked
        The same for files that no longer change: hard links, or copies if the file system has no links.
    folders
        Folders to create even if they stay empty.
    flush
        Whether to wait until the folder is on the disk.
    """
    place = destination.place
    try:
        destination.check_losses()
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=_BESIDE, dir=place.parent))
    except OutputError:
        raise
    except OSError as reason:
        raise _cannot_write(destination, reason) from reason
    try:
        with Lock(beside / _WRITER):
            fresh = beside / _NEW
            fresh.mkdir()
            digests = _fill(fresh, contents, copied, linked or {}, folders)
            _keep(destination.kept(), fresh)
            # Last, so that no file of the run is newer.
            (fresh / MANIFEST).write_bytes(complete_manifest(manifest, destination.kind, digests))
            if flush:
                _flush(fresh)
            (beside / _OLD).mkdir()
            _swap(fresh, place, beside / _OLD / place.name)
    except OSError as reason:
        raise _cannot_write(destination, reason) from reason
    finally:
        _discard(beside)


def sweep(folder: Path) -> None:
    """Remove what killed writers have left in a folder; an earlier run that one had set aside is put back."""
    for left in folder.glob(f"{_BESIDE}*"):
        with suppress(JournalError, OSError):
            if _is_own_folder(left) and time.time() - left.stat().st_mtime > _LEFT:
                with Lock(left / _WRITER):
                    _discard(left)


def _fill(
    folder: Path,
    contents: Mapping[str, bytes],
    copied: Mapping[str, Path],
    linked: Mapping[str, Path],
    folders: Collection[str],
) -> dict[str, str]:
    """Write the files of a run into a new folder; return their digests."""
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
    return {name: digest_of_content(content) for name, content in contents.items()} | {
        name: digest_of_file(folder / name) for name in (*copied, *linked)
    }


def _keep(entries: Collection[Path], fresh: Path) -> None:
    """Copy the user's files from the earlier run, which must stay complete until the swap."""
    for entry in entries:
        if _is_own_folder(entry):
            shutil.copytree(entry, fresh / entry.name, symlinks=True)
        else:
            shutil.copy2(entry, fresh / entry.name, follow_symlinks=False)


def _is_own_folder(path: Path) -> bool:
    """Whether there is a folder, and not a link to one."""
    return path.is_dir() and not path.is_symlink()


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
    for kept in filter(_is_own_folder, aside.iterdir() if _is_own_folder(aside) else ()):
        place = beside.parent / kept.name
        if not place.exists():
            try:
                kept.rename(place)
            except OSError:
                # The folder stays, with the run.
                return
    shutil.rmtree(beside, ignore_errors=True)


def _flush(folder: Path) -> None:
    """Flush a folder and its files to the disk, so that they survive a power cut; links of the user have nothing."""
    for path in (*folder.rglob("*"), folder):
        if path.is_symlink():
            continue
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as reason:
            # Some systems cannot flush a folder, which is harmless; a full disk is an error.
            if path.is_file() or reason.errno in _DISK_FULL:
                raise
        finally:
            os.close(descriptor)


def _cannot_write(destination: Destination, reason: OSError) -> OutputError:
    if reason.errno in _DISK_FULL:
        cause, remedy = "the disk is full", "free some space"
    else:
        cause, remedy = reason.strerror or str(reason), "choose another folder"
    return OutputError(
        f"cannot write the run to {destination.path}: {cause}; {remedy}, what was there is untouched"
    )
