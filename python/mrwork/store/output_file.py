"""Files that are written whole or not at all, and through no symbolic link.

A link in a run folder, beside it or in the folder of its journal may lead to any file of the user, and have been put
there by somebody else. A file that is replaced takes the place of a link; a file that grows, and a folder on the way to
a file, are refused where they are links. The folder that the user names may be one (`run_folder.real_place`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePath
from typing import BinaryIO, Final

from mrwork.errors import OutputError

_NO_LINK: Final = getattr(os, "O_NOFOLLOW", 0)
_NEW: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK | getattr(os, "O_BINARY", 0)


def refuse_link(path: Path) -> None:
    """Check that there is no symbolic link at `path`."""
    if os.path.islink(path):  # noqa: PTH114 - `Path.is_symlink` raises errors for some names
        raise OutputError(
            f"{path} is a symbolic link, and mrwork follows none within the folders that it writes; "
            "remove the link, or put what it leads to in its place"
        )


def open_to_write(path: Path, flags: int) -> int:
    """Descriptor of the file at `path`, which is not a link."""
    refuse_link(path)
    return os.open(path, flags | _NO_LINK, 0o666)


def new_file(path: Path) -> BinaryIO:
    """A new file at `path`, open for writing; an earlier one, or a link, is removed first."""
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, _NEW, 0o666), "wb")


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file open for writing under a temporary name, which is renamed to `path` at the end of the block."""
    if "\0" in str(path):
        raise OutputError(f"cannot write {str(path)!r}: no file has such a name; give another")
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with new_file(beside) as stream:
                yield stream
            beside.replace(path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except OutputError:
        raise
    except OSError as reason:
        raise OutputError(
            f"cannot write {path}: {reason.strerror or reason}; make room, or give leave to write there"
        ) from reason


def write_files(
    folder: Path, contents: Mapping[str, bytes], *, then: Callable[[], None] = lambda: None
) -> None:
    """Write files into a run folder; keys are paths inside the folder.

    When all are written, under temporary names, `then` is called; after that none can lack space, and they are renamed.
    """
    with ExitStack() as renamed:
        for name, content in contents.items():
            for above in PurePath(name).parents[:-1]:
                refuse_link(folder / above)
            stream = renamed.enter_context(replacing(folder / name))
            stream.write(content)
            stream.flush()
        then()
