"""Where a run folder will be written, and what would be lost there.

A verb replaces without asking only a folder that it has written itself, unchanged since and with nothing added by later
verbs. The manifest names the verb and lists the files of the run with their SHA-256. A large file that is older than
the manifest counts as unchanged, so that the histories of a study need not be read; every other file is.
"""

from __future__ import annotations

import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mrwork.errors import OutputError, RecordError
from mrwork.store.codec import json_document
from mrwork.store.input_file import digest_of_content, digest_of_file, stored, text_of
from mrwork.store.lock import is_lock
from mrwork.store.parse import json_value
from mrwork.store.run_folder import JOURNAL, MANIFEST, MODELS, RunKind, kind_of, part_of, real_place

_FILES: Final = "files"
# Bytes up to which a file is read, whatever its time says.
_SMALL: Final = 4 << 20
# Files that a message names.
_NAMED: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Destination:
    """The folder that a verb will write, with leave to lose what is there.

    Parameters
    ----------
    path
        The folder as the user names it, which may be a link to the folder.
    kind
        What is written.
    replace
        Whether a run of another verb, later additions and changed files may be lost.
    continues
        Whether the run that is there is resumed: its changed files are written again.
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

    def check_owner(self) -> None:
        """Check that a run can be put there: nothing, an empty folder or a run folder."""
        self._run()

    def check_losses(self) -> None:
        """Check that nothing is lost there without leave."""
        run = self._run()
        if run is None or self.replace:
            return
        if run.kind != self.kind:
            lost = f"the results of `mrwork {run.kind.verb}`, {_in_words(_entries_of(run.files()))}"
        else:
            added = run.additions()
            changed = [] if self.continues else run.changes()
            if not added and not changed:
                return
            parts = [f"{_in_words(_entries_of(added))}, which other verbs or you have added"] if added else []
            parts += [f"{_in_words(changed)}, changed since the run was written"] if changed else []
            lost = "; and ".join(parts)
        raise OutputError(
            f"{self.path} has a run; `mrwork {self.kind.verb}` in its place would lose {lost}; "
            "choose another folder, or give --replace"
        )

    def kept(self) -> list[Path]:
        """Files and folders of the user there, which stay."""
        run = self._run()
        return [] if run is None else run.of_user()

    def _run(self) -> _FolderOfRun | None:
        place = self.place
        if "\0" in str(self.path):
            raise OutputError(
                f"{self.path} has a zero character, which no name can have; choose another name"
            )
        if not place.is_dir():
            if place.exists():
                raise OutputError(f"{self.path} is a file, a run needs a folder; choose another name")
            return None
        if not (place / MANIFEST).is_file():
            if not any(place.iterdir()):
                return None
            raise OutputError(
                f"{self.path} holds files but no {MANIFEST}, so it is not a run folder and is left as it is; "
                "choose another folder"
            )
        manifest = _read(place / MANIFEST)
        kind = kind_of(manifest)
        if kind is None:
            raise OutputError(
                f"the {MANIFEST} of {self.path} is not that of a run of mrwork, so the folder is left as it is; "
                "choose another folder"
            )
        return _FolderOfRun(place=place, kind=kind, manifest=manifest, taken=self.kind.entries)


@dataclass(frozen=True, slots=True, kw_only=True)
class _FolderOfRun:
    """A run folder with what its manifest states; `taken` are names in it that will be used."""

    place: Path
    kind: RunKind
    manifest: Mapping[str, Any]
    taken: frozenset[str]

    def files(self) -> list[str]:
        """Paths of the files of the run and of later verbs, and of those of which the names are taken."""
        return sorted(
            name
            for entry in self.place.iterdir()
            if entry.name in self._entries()
            for name in _names_in(entry, entry.name)
        )

    def of_user(self) -> list[Path]:
        """All other files and folders."""
        own = self._entries()
        return [entry for entry in self.place.iterdir() if entry.name not in own and not is_lock(entry.name)]

    def additions(self) -> list[str]:
        """Files that were added to those of the verb."""
        return [name for name in self.files() if not self._is_written(name)]

    def changes(self) -> list[str]:
        """Files of the verb that are not as it has written them; none where the manifest lists none."""
        listed = self._listed()
        if listed is None:
            return []
        of_manifest = listed.get(MANIFEST) != _digest_of_manifest(self.manifest)
        others = [name for name in self.files() if name in listed and name != MANIFEST]
        return [
            *([MANIFEST] if of_manifest else []),
            *(name for name in others if self._differs(name, listed[name])),
        ]

    def _is_written(self, name: str) -> bool:
        listed = self._listed()
        if listed is None:
            return self.kind.writes(name)
        return name in listed or name in self.kind.redrawn or name == MANIFEST

    def _listed(self) -> Mapping[str, Any] | None:
        """Digests of the files of the verb; `None` in folders of earlier versions."""
        listed = self.manifest.get(_FILES)
        return listed if isinstance(listed, Mapping) else None

    def _entries(self) -> frozenset[str]:
        listed = {name.partition("/")[0] for name in self._listed() or ()}
        return self.kind.entries | self.taken | listed

    def _differs(self, name: str, digest: object) -> bool:
        path = self.place / name
        found, manifest = path.lstat(), (self.place / MANIFEST).stat()
        if not stat.S_ISREG(found.st_mode):
            return True
        if found.st_size > _SMALL and found.st_mtime_ns < manifest.st_mtime_ns:
            return False
        return digest_of_file(path) != digest


def complete_manifest(manifest: Mapping[str, object], kind: RunKind, digests: Mapping[str, str]) -> bytes:
    """The manifest of a run folder with the verb that writes it and the digests of its files."""
    stated = {"kind": kind.kind, **manifest, "verb": kind.verb}
    listed = {name: digest for name, digest in digests.items() if name not in kind.redrawn}
    return json_document({**stated, _FILES: {MANIFEST: _digest_of_manifest(stated), **listed}}).encode()


def _digest_of_manifest(manifest: Mapping[str, object]) -> str:
    """Digest of all that a manifest states besides the files."""
    stated = json_document({name: value for name, value in manifest.items() if name != _FILES})
    return digest_of_content(stated.encode(errors="surrogatepass"))


def _read(path: Path) -> Mapping[str, Any]:
    """What a manifest states; nothing where it is damaged."""
    try:
        found = json_value(text_of(path, stored("identify", name="the manifest")))
    except (RecordError, ValueError):
        return {}
    return found if isinstance(found, Mapping) else {}


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


def _in_words(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
