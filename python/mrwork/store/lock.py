"""Lock of a file that grows, held by one writer for as long as the file grows.

The lock is a file `.NAME.lock` beside the file, with the process and machine that hold it, on which the kernel keeps an
exclusive lock (`flock`). The kernel releases it when the process ends, however that happens; a lock file that is left
behind has no effect and is taken over.

On NFS the server keeps such locks for all machines (Linux since 2.6.12), but on a mount with `nolock` each machine has
its own: two machines are then not kept apart. A file system that refuses locks is used without one, after a warning.
Windows has no `flock`, and nothing is locked there.
"""

from __future__ import annotations

import os
import socket
import sys
import warnings
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from mrwork.errors import JournalError, MrworkWarning, OutputError
from mrwork.store.output_file import open_to_write

_LONGEST = 300
_FLAGS = os.O_RDWR | os.O_CREAT


class Lock:
    """Lock of the file or folder at `path`, which need not exist, taken at once and held until `release`."""

    def __init__(self, path: Path) -> None:
        self._place = path.with_name(f".{path.name}.lock")
        self._file: int | None = None
        try:
            self._file = self._taken(path)
        except OSError as reason:
            if isinstance(reason, OutputError):
                raise
            raise OutputError(f"cannot write {path}: {reason.strerror}; choose another folder") from reason

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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def _taken(self, path: Path) -> int:
        while True:
            file = open_to_write(self._place, _FLAGS)
            try:
                _flock(file, path)
                # Another writer may have removed the file between the two lines above.
                if self._place.exists() and os.path.samestat(os.fstat(file), self._place.stat()):
                    _sign(file)
                    return file
            except BaseException:
                os.close(file)
                raise
            os.close(file)


def is_lock(name: str) -> bool:
    """Whether it is the name of a lock file."""
    return name.startswith(".") and name.endswith(".lock")


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


def _sign(file: int) -> None:
    """Write who holds the lock; on a full disk the holder stays unnamed."""
    with suppress(OSError):
        os.ftruncate(file, 0)
        os.write(file, f"{_signature()}\n".encode())


def _signature() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"
