"""Locks of a run folder: what replaces it excludes all else, what adds to it excludes the same addition.

The lock of the folder stands beside it, because the folder may be replaced; that of an addition stands in it.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mrwork.errors import JournalError, OutputError
from mrwork.store.destination import Destination
from mrwork.store.lock import Lock
from mrwork.store.run_folder import CALIBRATION, CHAIN, MANIFEST, PLAN, PROFILES, real_place

_ADDITIONS = (CHAIN, CALIBRATION, PROFILES, PLAN)
# An addition holds the lock of the folder for an instant, in which another may come.
_TRIES, _PAUSE = 20, 0.01
_NO_LEAVE = frozenset({errno.EACCES, errno.EPERM, errno.EROFS})


@contextmanager
def replacing_run(destination: Destination) -> Iterator[None]:
    """Keep others from a run folder, which the block will replace."""
    place = destination.place
    with _of_folder(place):
        for name in _ADDITIONS if place.is_dir() else ():
            Lock(place / name).release()
        destination.check_losses()
        yield


@contextmanager
def adding(path: str | Path, name: str) -> Iterator[None]:
    """Keep others from replacing the run folder at `path`, and from the file `name` that the block adds to it.

    Where there is no run folder, nothing is locked.
    """
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
