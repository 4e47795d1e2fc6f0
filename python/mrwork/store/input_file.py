"""The one gate for files that are read: ordinary files of a limited size, refused otherwise before they are opened.

Every reader of the package asks this module for the bytes of a file; `tests/store/test_input_file.py` checks it.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mrwork.errors import RecordError

LEAST: Final = 96 << 20
"""Bytes that the contents of any file may take, however small it is: columns that do not change shrink a thousandfold.

A test of so many samples takes less than 1 GiB to check.
"""


class Allowance:
    """Bytes that are left for the contents of the file at `path`: 10 times its `size`, from `least` to 1 GiB."""

    def __init__(self, path: Path, size: int, *, least: int = LEAST) -> None:
        self._path = path
        # Doubles of a rig shrink to a quarter or an eighth; the ratio decides for files above 10 MB only.
        self._whole = self._left = min(1 << 30, max(least, 10 * size))

    def take(self, count: int, what: str) -> None:
        """Subtract `count` bytes that `what` claims; refuse it where less is left."""
        self._left -= count
        if self._left < 0:
            raise RecordError(
                f"{self._path}: {what} claims {count / 1e6:,.0f} MB, where all that a file of its size holds may "
                f"take {self._whole / 1e6:,.0f} MB; save one test, without other data and less compressed"
            )


_MIB: Final = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class FileKind:
    """Kind of an input file: name, `largest` size [bytes], `remedy` for another kind, `smaller` for a larger file."""

    name: str
    largest: int
    remedy: str
    smaller: str = ""


RECORD: Final = FileKind(
    name="a record",
    largest=1024 * _MIB,
    remedy="name a record file",
    smaller="export one test, at a lower rate or with fewer channels",
)
"""Records of tests and of ground motions, and tables of tests."""

# The parser of TOML reads half a megabyte in a second.
TOML: Final = FileKind(
    name="a TOML file",
    largest=4 * _MIB,
    remedy="name a TOML file",
    smaller="keep matrices and motions in files of their own",
)
MATRIX: Final = FileKind(name="a matrix", largest=256 * _MIB, remedy="name a file with a matrix")


def make_stored_kind(verb: str, *, name: str = "a file of the run") -> FileKind:
    """The kind of the files that a verb of `mrwork` writes into a run folder."""
    return FileKind(name=name, largest=256 * _MIB, remedy=f"move it away, and run `mrwork {verb}` again")


def bytes_of(path: Path, kind: FileKind, most: int | None = None) -> bytes:
    """Content of a file, as long as it was when it was opened; or its first bytes, at `most` so many."""
    size = check_file(path, kind)
    with _explained(path), path.open("rb") as stream:
        return stream.read(size if most is None else min(size, most))


def text_of(path: Path, kind: FileKind) -> str:
    """Text of a UTF-8 file; a byte-order mark at its start is left out."""
    return text_in(bytes_of(path, kind), path, kind)


def text_in(content: bytes, path: Path, kind: FileKind) -> str:
    """Text of the content of a file, UTF-8 with or without a mark; other content is refused with the kind's remedy."""
    # A file with a hole, which has no size on the disk, has zeros there.
    if (zero := content.find(b"\0")) >= 0:
        raise RecordError(f"{path}: byte {zero} is 0x00, so this is no text; {kind.remedy}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise RecordError(
            f"{path}: byte {reason.start} is not UTF-8 text; save it as UTF-8, or {kind.remedy}"
        ) from None


def is_there(path: Path, kind: FileKind) -> bool:
    """Whether there is a file at `path`; a folder, a device or a file too large for its kind is refused."""
    return exists(path) and check_file(path, kind) >= 0


def check_file(path: Path, kind: FileKind) -> int:
    """Size of the ordinary file at `path`, which is not too large."""
    with _explained(path):
        status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        what = "a directory" if stat.S_ISDIR(status.st_mode) else "a pipe, a device or a socket"
        raise RecordError(f"{path}: is {what} where {kind.name} was expected; {kind.remedy}")
    if status.st_size > kind.largest:
        raise RecordError(
            f"{path}: has {status.st_size / 1e6:,.0f} MB where {kind.name} has {kind.largest / 1e6:,.0f} MB at most; "
            f"{kind.smaller or kind.remedy}"
        )
    return status.st_size


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except (FileNotFoundError, NotADirectoryError):
        raise RecordError(f"{path}: there is no such file; check the path") from None
    # The second is of a name that no file can have.
    except (OSError, ValueError) as reason:
        why = getattr(reason, "strerror", reason)
        raise RecordError(f"{path}: cannot be read ({why}); check its name and its permissions") from reason


# Unlike methods of `Path`, these raise no error for a name that nothing can have.
exists, is_file, is_folder = os.path.exists, os.path.isfile, os.path.isdir
