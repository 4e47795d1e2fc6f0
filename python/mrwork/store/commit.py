"""A commit of files to a folder: they are written as NAME.new, a manifest lists them, then each gets its name.

Until the manifest is replaced the folder has what was there before, afterwards the new files: `end_commit` gives a
folder whose commit was cut off the rest of its names. A file that is replaced, and is not as it was written, was
changed by its owner, and becomes NAME~.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path, PurePath
from typing import Any, Final

from mrwork.errors import OutputError
from mrwork.store.codec import json_document
from mrwork.store.input_file import exists
from mrwork.store.output_file import new_file

MANIFEST: Final = "manifest.json"
NEW: Final = ".new"
"""Ending of a file that is written beside a manifest, until a manifest lists it."""
FILES, REPLACED, OWN = "files", "replaced", "digest"
"""Keys of a manifest: digests of the files by name; of those before, until each file has its name; its own digest."""

_TEXTS: Final = frozenset({".json", ".jsonl", ".toml", ".csv", ".html", ".svg"})


def digest_of(name: str, content: bytes) -> str:
    """Digest of the content of a file; of a text it does not depend on how lines end, which some programs change."""
    whole = content.replace(b"\r\n", b"\n") if PurePath(name).suffix in _TEXTS else content
    return f"sha256:{hashlib.sha256(whole).hexdigest()}"


def digest_at(name: str, path: Path) -> str:
    """Digest of a file that has, or will have, a name; histories are not read whole."""
    if PurePath(name).suffix in _TEXTS:
        return digest_of(name, path.read_bytes())
    with path.open("rb") as stream:
        return f"sha256:{hashlib.file_digest(stream, 'sha256').hexdigest()}"


def digest_of_manifest(stated: Mapping[str, object]) -> str:
    """Digest of what a manifest states, without itself."""
    facts = {key: value for key, value in stated.items() if key != OWN}
    return digest_of(MANIFEST, json_document(facts).encode(errors="surrogatepass"))


def manifest_document(stated: Mapping[str, object]) -> bytes:
    """The content of a manifest that states this, and its own digest."""
    return json_document({**stated, OWN: digest_of_manifest(stated)}).encode()


def make_folders(folder: Path, name: str) -> Path:
    """Make the folders of the file `name` in `folder`, none of which is a link; return its path."""
    if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
        # A manifest that somebody else has written leads nowhere else.
        raise OutputError(f"the {MANIFEST} of {folder} lists {name}, which is outside that folder")
    path = folder / name
    for above in reversed([parent for parent in path.parents if folder in parent.parents]):
        if above.is_symlink():
            raise OutputError(
                f"{above} is a symbolic link, which mrwork does not follow; put a folder in its place"
            )
        above.mkdir(exist_ok=True)
    return path


def commit(
    folder: Path,
    stated: Mapping[str, object],
    contents: Mapping[str, bytes],
    *,
    grown: Mapping[str, str],
    replaced: Mapping[str, str | None],
    flush: bool,
) -> None:
    """Write files into a folder with a manifest, in place of those before.

    `stated`: facts of the manifest. By name: `contents`; digests of files that have `grown` there, which NAME.new or
    NAME has; digests of the files that are `replaced`, of which those that are not written go. `flush`: whether to wait
    until the contents are on the disk.
    """
    files = dict(grown)
    for name, content in contents.items():
        files[name] = digest_of(name, content)
        _write(folder, name + NEW, content, flush=flush)
    manifest = {**stated, FILES: files, REPLACED: replaced}
    _replace_manifest(folder, manifest)
    end_commit(folder, manifest)


def end_commit(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Give the files of a manifest their names, and remove those before; return the manifest that says so."""
    files, replaced = manifest[FILES], manifest[REPLACED]
    for name, digest in files.items():
        path, beside = make_folders(folder, name), make_folders(folder, name + NEW)
        if beside.is_file() and digest_at(name, beside) == digest:
            _keep_changed(path, name, replaced)
            beside.replace(path)
    for name in replaced:
        if name not in files:
            _keep_changed(path := make_folders(folder, name), name, replaced)
            path.unlink(missing_ok=True)
            with suppress(OSError):
                # A folder that is empty now; the folder of the run has a manifest.
                path.parent.rmdir()
    ended = {key: value for key, value in manifest.items() if key not in (REPLACED, OWN)}
    _replace_manifest(folder, ended)
    return {**ended, OWN: digest_of_manifest(ended)}


def _keep_changed(path: Path, name: str, replaced: Mapping[str, str | None]) -> None:
    """Keep a file that its owner has changed as NAME~."""
    if path.is_symlink() or (path.is_file() and digest_at(name, path) != replaced.get(name)):
        backup = path.with_name(f"{path.name}~")
        while exists(backup):
            backup = backup.with_name(f"{backup.name}~")
        path.rename(backup)


def _replace_manifest(folder: Path, stated: Mapping[str, object]) -> None:
    _write(folder, MANIFEST + NEW, manifest_document(stated), flush=True)
    (folder / (MANIFEST + NEW)).replace(folder / MANIFEST)


def _write(folder: Path, name: str, content: bytes, *, flush: bool) -> None:
    with new_file(make_folders(folder, name)) as stream:
        stream.write(content)
        if flush:
            stream.flush()
            os.fsync(stream.fileno())
