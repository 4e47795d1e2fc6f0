"""A file that one process at a time may write."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from mrwork.errors import JournalError, OutputError


def locked(path: Path) -> int:
    """Open a file to append to, made if need be, for this process alone; a process that dies gives it free.

    Raises
    ------
    JournalError
        If another process has it.
    OutputError
        If it cannot be opened.
    """
    try:
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    except OSError as reason:
        raise OutputError(f"cannot write {path}: {reason.strerror}; choose another folder") from reason
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            raise JournalError(
                f"another run is writing {path}; wait for its end, or choose another folder"
            ) from None
    return file
