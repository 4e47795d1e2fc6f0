"""Files that are written whole or not at all; and locks.

A file that is replaced takes the place of a link; one that grows is refused where it is a link, and so is a folder
within a run that is a link. The folder that the user names may be a link (`run_folder.real_path`).

A lock is a file `.NAME.lock` beside the file, or `.lock` in a folder, with the process and machine that hold it, on
which the kernel keeps an exclusive lock (`flock`) until the process ends, however that happens; a lock file that is
left behind is taken over. A file system that refuses locks is used without one, after a warning, Windows without.
"""

from __future__ import annotations

import os
import socket
import sys
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final

from mrwork.errors import JournalError, MrworkWarning, OutputError
from mrwork.store.input_file import exists

_NO_LINK: Final = getattr(os, "O_NOFOLLOW", 0)
_NEW: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _NO_LINK | getattr(os, "O_BINARY", 0)


def open_to_write(path: Path, flags: int) -> int:
    """Descriptor of the file at `path`, which is no symbolic link."""
    return os.open(path, flags | _NO_LINK, 0o666)


def new_file(path: Path) -> BinaryIO:
    """A new file at `path`, open for writing; an earlier one, or a link, is removed first."""
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, _NEW, 0o666), "wb")


@contextmanager
def explain_failure(what: str, remedy: str) -> Iterator[None]:
    """Turn an error of the system in the block into an `OutputError`: cannot do `what`, the reason, the remedy."""
    try:
        yield
    except OutputError:
        raise
    except OSError as reason:
        raise OutputError(f"cannot {what}: {reason.strerror or reason}; {remedy}") from reason


def write_file(path: Path, content: bytes) -> None:
    """Write a file, which has its name when it is whole; a pipe, a device or a socket is not replaced."""
    if exists(path) and not (path.is_file() or path.is_dir()):
        raise OutputError(f"{path} is a pipe, a device or a socket; give the name of an ordinary file")
    beside = path.with_name(f".{path.name}.{os.getpid()}.new")
    with explain_failure(f"write {path}", "make room, or give leave to write there"):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with new_file(beside) as stream:
                stream.write(content)
            beside.replace(path)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise


class Lock(AbstractContextManager["Lock"]):
    """Lock of a folder, or of the file `name` in it, which need not exist; taken at once and held until `release`."""

    def __init__(self, folder: Path, name: str = "") -> None:
        self._path = folder / (f".{name}.lock" if name else ".lock")
        with explain_failure(f"write {folder / name}", "choose another folder"):
            self._file: int | None = self._take(folder / name)

    def release(self) -> None:
        """Let another writer have the file; without effect where that was done before."""
        if self._file is not None:
            # Removed while it is held, so that it cannot be the lock of another writer.
            with suppress(OSError):
                self._path.unlink()
            os.close(self._file)
            self._file = None

    def __exit__(self, *_: object) -> None:
        self.release()

    def _take(self, path: Path) -> int:
        while True:
            file = open_to_write(self._path, os.O_RDWR | os.O_CREAT)
            try:
                _flock(file, path)
                # Another writer may have removed the file between the two lines above.
                if self._path.exists() and os.path.samestat(os.fstat(file), self._path.stat()):
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
        holder = os.pread(file, 300, 0).decode(errors="replace").strip() or "another process"
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
