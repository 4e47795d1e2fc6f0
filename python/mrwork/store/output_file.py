"""Files that are written whole or not at all, through no link, onto no device, and the lock of a file that grows.

Only ordinary files are replaced: a pipe, a device or a socket, also one that a link leads to, is refused.

A link in a run folder, beside it or in the folder of its journal may lead to any file of the user, and have been put
there by somebody else. A file that is replaced takes the place of a link; a file that grows, and a folder on the way to
a file, are refused where they are links, and a file that grows where it has a second name. The folder that the user
names may be a link (`run_folder.real_place`).

A lock is a file `.NAME.lock` beside the file, or `.lock` in a folder, with the process and machine that hold it, on
which the kernel keeps an exclusive lock (`flock`). The kernel releases it when the process ends, however that happens;
a lock file that is left behind has no effect and is taken over.

On NFS the server keeps such locks for all machines (Linux since 2.6.12), but on a mount with `nolock` each machine has
its own: two machines are then not kept apart. A file system that refuses locks is used without one, after a warning.
Windows has no `flock`, and nothing is locked there.
"""

from __future__ import annotations

import errno
import os
import shutil
import socket
import stat
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path, PurePath
from typing import BinaryIO, Final

from mrwork.errors import JournalError, MrworkWarning, OutputError
from mrwork.store.input_file import exists, is_folder, special_kind

_NO_LINK: Final = getattr(os, "O_NOFOLLOW", 0)
DISK_FULL: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
_NEW: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK | getattr(os, "O_BINARY", 0)


def check_own(path: Path) -> None:
    """Check that there is no symbolic link at `path`, and no pipe, device or socket."""
    if os.path.islink(path):  # noqa: PTH114 - `Path.is_symlink` raises errors for some names
        raise OutputError(
            f"{path} is a symbolic link, and mrwork follows none within the folders that it writes; "
            "remove the link, or put what it leads to in its place"
        )
    refuse_special(path)


def check_own_folder(path: Path) -> None:
    """Check that there is nothing at `path`, or a folder that is no link."""
    check_own(path)
    if exists(path) and not is_folder(path):
        raise OutputError(f"{path} is no folder, and mrwork writes into one of that name; move it away")


def discard_folder(path: Path) -> None:
    """Remove a folder with what is in it, as far as that can be done; anything else of the name stays."""
    # What removes a tree opens a named pipe in its place, and waits.
    if is_folder(path):
        shutil.rmtree(path, ignore_errors=True)


def refuse_special(path: Path) -> None:
    """Check that there is no pipe, device or socket at `path`, or where a link at `path` leads to."""
    try:
        what = special_kind(os.stat(path).st_mode)  # noqa: PTH116 - `Path` refuses some names with other errors
    except (OSError, ValueError):
        return
    if what:
        raise OutputError(f"{path} {what}, and only ordinary files are replaced; give another name")


def open_to_write(path: Path, flags: int) -> int:
    """Descriptor of the file at `path`, which is an ordinary one with no other name."""
    check_own(path)
    descriptor = os.open(path, flags | _NO_LINK, 0o666)
    status = os.fstat(descriptor)
    if stat.S_ISREG(status.st_mode) and status.st_nlink <= 1:
        return descriptor
    os.close(descriptor)
    raise OutputError(
        f"{path} has another name (a hard link), under which it would change too; put a copy in its place, or remove it"
    )


def new_file(path: Path) -> BinaryIO:
    """A new file at `path`, open for writing; an earlier one, or a link, is removed first."""
    refuse_special(path)
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, _NEW, 0o666), "wb")


@contextmanager
def explain_failure(what: str, remedy: str, *, full: str = "") -> Iterator[None]:
    """Turn an error of the system in the block into an `OutputError`: cannot do `what`, the reason, the remedy.

    `full` says both on a full disk.
    """
    try:
        yield
    except OutputError:
        raise
    except OSError as reason:
        why = full if reason.errno in DISK_FULL else ""
        raise OutputError(f"cannot {what}: {why or f'{reason.strerror or reason}; {remedy}'}") from reason


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file open for writing under a temporary name, which is renamed to `path` at the end of the block."""
    if "\0" in str(path):
        raise OutputError(f"cannot write {str(path)!r}: no file has such a name; give another")
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    with explain_failure(f"write {path}", "make room, or give leave to write there"):
        refuse_special(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        stream = new_file(beside)
        try:
            with stream:
                yield stream
            beside.replace(path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise


def write_files(
    folder: Path, contents: Mapping[str, bytes], *, then: Callable[[], None] = lambda: None
) -> None:
    """Write files into a run folder, by path inside; when all are written, `then` is called, and they are renamed."""
    with ExitStack() as renamed:
        for name, content in contents.items():
            for above in PurePath(name).parents[:-1]:
                check_own_folder(folder / above)
            stream = renamed.enter_context(replacing(folder / name))
            stream.write(content)
            stream.flush()
        then()


_LONGEST = 300
_FLAGS = os.O_RDWR | os.O_CREAT


def is_lock(name: str) -> bool:
    """Whether it is the name of a lock file."""
    return name.startswith(".") and name.endswith(".lock")


class Lock:
    """Lock of a folder, or of the file `name` in it, which need not exist; taken at once and held until `release`."""

    def __init__(self, folder: Path, name: str = "") -> None:
        self._place = folder / (f".{name}.lock" if name else ".lock")
        self._file: int | None = None
        with explain_failure(f"write {folder / name}", "choose another folder"):
            self._file = self._take(folder / name)

    def release(self) -> None:
        """Let another writer have the file; without effect where that was done before."""
        if self._file is not None:
            # Removed while it is held, so that it cannot be the lock of another writer.
            with suppress(OSError):
                self._place.unlink()
            os.close(self._file)
            self._file = None

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def _take(self, path: Path) -> int:
        while True:
            file = open_to_write(self._place, _FLAGS)
            try:
                _flock(file, path)
                # Another writer may have removed the file between the two lines above.
                if self._place.exists() and os.path.samestat(os.fstat(file), self._place.stat()):
                    # Who holds the lock; on a full disk the holder stays unnamed.
                    with suppress(OSError):
                        os.ftruncate(file, 0)
                        os.write(file, f"{_signature()}\n".encode())
                    return file
            except BaseException:
                os.close(file)
                raise
            os.close(file)


def _flock(file: int, path: Path) -> None:
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(file, _LONGEST, 0).decode(errors="replace").strip() or "another process"
        if holder == _signature():
            raise JournalError(f"this process is writing {path} already; close that journal first") from None
        raise JournalError(
            f"{holder} is writing {path}; wait for its end, or end it, or choose another folder"
        ) from None
    except OSError as reason:
        warnings.warn(
            f"{path} cannot be locked here ({reason.strerror}); do not start a second run that writes it",
            MrworkWarning,
            stacklevel=2,
        )


def _signature() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"
