"""Run folders that are written whole or not at all, what would be lost there (`Destination`), and their locks.

A run is written to a hidden folder in the same directory, which is then renamed, so that an earlier run is replaced
only when the new one is complete on the disk.

A verb replaces without asking only a folder that it has written itself, unchanged since and with nothing added by later
verbs. The manifest names the verb and lists the files of the run with their SHA-256. A large file that is older than
the manifest counts as unchanged, so that the histories of a study need not be read; every other file is.

What replaces a folder excludes all else, what adds to it excludes the same addition. The lock of a folder stands beside
it, because the folder may be replaced; that of an addition stands in it.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mrwork.base.summary import list_names
from mrwork.errors import JournalError, OutputError
from mrwork.store.codec import json_document
from mrwork.store.input_file import (
    digest_of_content,
    digest_of_file,
    exists,
    is_file,
    is_folder,
    special_kind,
)
from mrwork.store.output_file import DISK_FULL, Lock, explain_failure, is_lock, refuse_special
from mrwork.store.run_folder import (
    CALIBRATION,
    CHAIN,
    HELD_OUT,
    HISTORIES,
    JOURNAL,
    MANIFEST,
    MODELS,
    PLAN,
    PROFILES,
    RUN_KINDS,
    RunKind,
    is_part,
    kind_of,
    part_of,
    read_manifest_if_whole,
    real_place,
)

_FILES: Final = "files"
# Bytes up to which a file is read, whatever its time says.
_SMALL: Final = 4 << 20
# Files that a message names.
_NAMED: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Destination:
    """The folder that a verb will write, with leave to lose what is there.

    `path`: as the user names it, perhaps a link. `replace`: whether a run of another verb, later additions and changed
    files may be lost. `continues`: whether the run there is resumed, which writes its changed files again.
    """

    path: Path
    kind: RunKind
    replace: bool = False
    continues: bool = False

    @classmethod
    def of(cls, path: Path, kind: RunKind, *, replace: bool, resume: bool) -> Destination:
        """The folder of a run that is begun, or resumed."""
        # What was begun beside a run is to replace it, and need not be the same run.
        begun = any((part_of(path) / name).exists() for name in (JOURNAL, MODELS))
        return cls(path=path, kind=kind, replace=replace, continues=resume and not begun)

    @property
    def place(self) -> Path:
        """The folder, without links."""
        return real_place(self.path)

    def check_losses(self) -> None:
        """Check that nothing is lost there without leave."""
        if (run := self.run()) is not None:
            if not self.replace:
                self._check_losses_of(run)
            run.refuse_special_files()

    def _check_losses_of(self, run: FolderOfRun) -> None:
        if run.kind != self.kind:
            lost = f"the results of `mrwork {run.kind.verb}`, {list_names(_entries_of(run.files()), _NAMED)}"
        else:
            added = run.additions()
            changed = [] if self.continues else run.changes()
            if not added and not changed:
                return
            parts = {
                ", which other verbs or you have added": _entries_of(added),
                ", changed since the run was written": changed,
            }
            lost = "; and ".join(f"{list_names(names, _NAMED)}{why}" for why, names in parts.items() if names)
        raise OutputError(
            f"{self.path} has a run; `mrwork {self.kind.verb}` in its place would lose {lost}; "
            "choose another folder, or give --replace"
        )

    def run(self) -> FolderOfRun | None:
        """The run at the destination, `None` for an absent or empty folder; anything else is refused."""
        place = self.place
        if "\0" in str(self.path):
            raise OutputError(
                f"{self.path} has a zero character, which no name can have; choose another name"
            )
        if any("\ud800" <= character <= "\udfff" for character in str(self.path)):
            raise OutputError(
                f"{self.path} has bytes that are not UTF-8, which the files of a run cannot state; choose another name"
            )
        refuse_place_in_run(self.path)
        if not place.is_dir():
            if exists(place):
                raise OutputError(f"{self.path} is a file, a run needs a folder; choose another name")
            return None
        if not (place / MANIFEST).is_file():
            if not any(place.iterdir()):
                return None
            raise OutputError(
                f"{self.path} holds files but no {MANIFEST}, so it is not a run folder and is left as it is; "
                "choose another folder"
            )
        manifest = read_manifest_if_whole(place / MANIFEST)
        kind = kind_of(manifest)
        if kind is None:
            raise OutputError(
                f"the {MANIFEST} of {self.path} is not that of a run of mrwork, so the folder is left as it is; "
                "choose another folder"
            )
        return FolderOfRun(place=place, kind=kind, manifest=manifest, taken=self.kind.entries)


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderOfRun:
    """A run folder with what its manifest states; `taken` are names in it that will be used."""

    place: Path
    kind: RunKind
    manifest: Mapping[str, Any]
    taken: frozenset[str] = frozenset()

    @classmethod
    def at(cls, place: Path) -> FolderOfRun | None:
        """The run in a folder, `None` where there is none; one with a damaged manifest may be of any kind."""
        if not is_file(place / MANIFEST):
            return None
        manifest = read_manifest_if_whole(place / MANIFEST)
        kind = kind_of(manifest)
        if kind is None and manifest:
            return None
        kinds = RUN_KINDS if kind is None else (kind,)
        return cls(
            place=place,
            kind=kinds[0],
            manifest=manifest,
            taken=frozenset().union(*(each.entries for each in kinds)),
        )

    def files(self) -> list[str]:
        """Paths of the files of the run and of later verbs, and of those of which the names are taken."""
        return sorted(
            name
            for entry in self.place.iterdir()
            if entry.name in self._entries()
            for name in _names_in(entry, entry.name)
        )

    def of_user(self) -> list[Path]:
        """Files and folders that no verb has written."""
        own = self._entries()
        return [entry for entry in self.place.iterdir() if entry.name not in own and not is_lock(entry.name)]

    def refuse_special_files(self) -> None:
        """Refuse a pipe, a device or a socket, which a new run could not keep."""
        for entry in self.place.iterdir():
            for path in map(Path, _names_in(entry, str(entry))):
                if what := special_kind(path.lstat().st_mode):
                    raise OutputError(
                        f"{path} {what}, which no new run can keep; move it out of the run folder"
                    )

    def owns(self, name: str) -> bool:
        """Whether a name in the folder is of the run, or one that later verbs use; some systems do not tell cases."""
        return name.casefold() in {each.casefold() for each in self._entries()}

    def additions(self) -> list[str]:
        """Files that were added to those of the verb."""
        written = {*self._read_digests(), MANIFEST}
        return [name for name in self.files() if name not in written and not self.kind.redraws(name)]

    def changes(self) -> list[str]:
        """Files of the verb that are not as it has written them."""
        listed = self._read_digests()
        of_manifest = listed.get(MANIFEST) != _digest_of_manifest(self.manifest)
        others = [name for name in self.files() if name in listed and name != MANIFEST]
        return [
            *([MANIFEST] if of_manifest else []),
            *(name for name in others if self._differs(name, listed[name])),
        ]

    def _read_digests(self) -> Mapping[str, Any]:
        """Digests of the files of the verb; none where the manifest has no list of them."""
        listed = self.manifest.get(_FILES)
        return listed if isinstance(listed, Mapping) else {}

    def _entries(self) -> frozenset[str]:
        listed = {name.partition("/")[0] for name in self._read_digests()}
        return self.kind.entries | self.taken | listed

    def _differs(self, name: str, digest: object) -> bool:
        path = self.place / name
        file, manifest = path.lstat(), (self.place / MANIFEST).stat()
        if not stat.S_ISREG(file.st_mode):
            return True
        if file.st_size > _SMALL and file.st_mtime_ns < manifest.st_mtime_ns:
            return False
        return digest_of_file(path) != digest


def refuse_place_in_run(path: Path) -> None:
    """Check that what is written at `path` is no part of a run that lies in a folder above it."""
    place = real_place(path.parent) / path.name
    for folder in place.parents:
        entry = place.relative_to(folder).parts[0]
        run = FolderOfRun.at(folder)
        unfinished = is_part(folder) and entry in (JOURNAL, MODELS, HISTORIES)
        if unfinished or (run is not None and run.owns(entry)):
            raise OutputError(f"{path} belongs to the run in {folder}; give a place of its own")


def check_output(place: Path, *, replace: bool, otherwise: str) -> None:
    """Check that the file that a user names can be written: none is there, or one of the user's that is to be replaced.

    `otherwise`: what else to do than to choose another name.
    """
    if is_folder(place):
        raise OutputError(f"{place} is a folder; give the name of a file")
    if not replace and (exists(place) or os.path.islink(place)):  # noqa: PTH114 - `Path.is_symlink` raises for some names
        raise OutputError(f"{place} is there already; choose another name, or {otherwise}")
    refuse_special(place)
    refuse_place_in_run(place)


def complete_manifest(manifest: Mapping[str, object], kind: RunKind, digests: Mapping[str, str]) -> bytes:
    """The manifest of a run folder with the verb that writes it and the digests of its files."""
    stated = {"kind": kind.kind, **manifest, "verb": kind.verb}
    listed = {name: digest for name, digest in digests.items() if not kind.redraws(name)}
    return json_document({**stated, _FILES: {MANIFEST: _digest_of_manifest(stated), **listed}}).encode()


def _digest_of_manifest(manifest: Mapping[str, object]) -> str:
    stated = json_document({name: value for name, value in manifest.items() if name != _FILES})
    return digest_of_content(stated.encode(errors="surrogatepass"))


def _names_in(entry: Path, name: str) -> Iterator[str]:
    """Paths of the files below an entry of the folder, itself where it is none; links are not followed."""
    if entry.is_symlink() or not entry.is_dir():
        yield name
        return
    for below in entry.iterdir():
        yield from _names_in(below, f"{name}/{below.name}")


def _entries_of(names: Sequence[str]) -> list[str]:
    """Files, and folders in the place of the files in them."""
    return list(dict.fromkeys(first + slash for first, slash, _ in (name.partition("/") for name in names)))


_ADDITIONS = (CHAIN, CALIBRATION, PROFILES, PLAN, HELD_OUT)
# An addition holds the lock of the folder for an instant, in which another may come.
_TRIES, _PAUSE = 20, 0.01
_NO_LEAVE = frozenset({errno.EACCES, errno.EPERM, errno.EROFS})


@contextmanager
def replacing_run(destination: Destination) -> Iterator[None]:
    """Lock a run folder that the block will replace."""
    place = destination.place
    with _of_folder(place):
        for name in _ADDITIONS if place.is_dir() else ():
            Lock(place / name).release()
        destination.check_losses()
        yield


@contextmanager
def adding(path: str | Path, name: str) -> Iterator[None]:
    """Lock the run folder at `path`, if any, against replacement, and the file `name` that is added."""
    place = real_place(path)
    if not (place / MANIFEST).is_file():
        yield
        return
    try:
        folder = _of_folder(place)
    except OutputError as reason:
        if getattr(reason.__cause__, "errno", None) not in _NO_LEAVE:
            raise
        # Nobody can replace a folder in a parent that cannot be written.
        addition = Lock(place / name)
    else:
        with folder:
            addition = Lock(place / name)
    with addition:
        yield


def _of_folder(place: Path) -> Lock:
    for _ in range(_TRIES):
        with suppress(JournalError):
            return Lock(place)
        time.sleep(_PAUSE)
    return Lock(place)


_BESIDE = ".mrwork-"
_PROBE = ".mrwork_probe-"
# In the folder of a writer: its lock, the run that it writes, and the earlier run by its name, set aside.
_WRITER, _NEW, _OLD = "writer", "new", "old"
# Age of the folder of a writer that may be one of a killed one [s].
_LEFT = 60.0


def check_destination(destination: Destination) -> None:
    """Check that a run can be written to its destination, before any computation."""
    parent = destination.place.parent
    with _explain_failure(destination):
        destination.run()
        parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=_PROBE, dir=parent):
            pass
        sweep(parent)


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

    By path inside the folder: `contents`, files to be `copied`, and `linked` ones that no longer change: hard links, or
    copies if the file system has none. `manifest`: facts about the run, to which the verb and digests are added.
    `folders` are created even if empty. `flush`: whether to wait until the folder is on the disk.
    """
    place = destination.place
    with _explain_failure(destination):
        destination.check_losses()
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=_BESIDE, dir=place.parent))
        try:
            with Lock(beside / _WRITER):
                fresh = beside / _NEW
                fresh.mkdir()
                digests = _fill(fresh, contents, copied, linked or {}, folders)
                run = destination.run()
                _keep(run.of_user() if run else [], fresh)
                # Last, so that no file of the run is newer.
                (fresh / MANIFEST).write_bytes(complete_manifest(manifest, destination.kind, digests))
                if flush:
                    _flush(fresh)
                (beside / _OLD).mkdir()
                _swap(fresh, place, beside / _OLD / place.name)
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
    """Flush a folder and its files to the disk, so that they survive a power cut; links of the user have nothing.

    Windows opens no folder, and flushes a file only for who may write it.
    """
    if sys.platform == "win32":
        return
    for path in (*folder.rglob("*"), folder):
        if path.is_symlink():
            continue
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        except OSError as reason:
            # Some systems cannot flush a folder, which is harmless; a full disk is an error.
            if path.is_file() or reason.errno in DISK_FULL:
                raise
        finally:
            os.close(descriptor)


def _explain_failure(destination: Destination) -> AbstractContextManager[None]:
    """Turn an error of the system in the block into an `OutputError` on the run."""
    what, kept = f"write the run to {destination.path}", "what was there is untouched"
    full = f"the disk is full; free some space, {kept}"
    return explain_failure(what, f"choose another folder, {kept}", full=full)
