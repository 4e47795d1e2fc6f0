"""Memory that the contents of a compressed file may take, counted before anything is allocated."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from mrwork.errors import RecordError

# Doubles of a rig shrink to a quarter or an eighth; columns of zeros shrink a thousandfold.
_RATIO: Final = 16
LEAST: Final = 128 << 20
_MOST: Final = 1 << 30


class Allowance:
    """Bytes that are left for the contents of the file at `path`, which has `size` bytes itself.

    It is 16 times the size, at least `least` and at most 1 GiB.
    """

    def __init__(self, path: Path, size: int, *, least: int = LEAST) -> None:
        self._path = path
        self._whole = self._left = min(_MOST, max(least, _RATIO * size))

    def take(self, count: int, what: str) -> None:
        """Count the bytes of `what`.

        Raises
        ------
        RecordError
            They are more than what is left.
        """
        self._left -= count
        if self._left < 0:
            raise RecordError(
                f"{self._path}: {what} claims {count / 1e6:,.0f} MB, where all that a file of its size holds may "
                f"take {self._whole / 1e6:,.0f} MB; save one test, without other data and less compressed"
            )
