"""Memory that the contents of a compressed file may take, counted before anything is allocated."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from mrwork.errors import RecordError

LEAST: Final = 96 << 20
"""Bytes that the contents of any file may take, however small it is: columns that do not change shrink a thousandfold.

A test of so many samples takes less than 1 GiB to check.
"""

# Doubles of a rig shrink to a quarter or an eighth; it decides for files above 10 MB only.
_RATIO: Final = 10
_MOST: Final = 1 << 30


def allowed(size: int, *, least: int = LEAST) -> int:
    """Bytes that the contents of a file of `size` bytes may take: 10 times its size, from `least` to 1 GiB."""
    return min(_MOST, max(least, _RATIO * size))


class Allowance:
    """Bytes that are left of those `allowed` for the contents of the file at `path`, which has `size` bytes itself."""

    def __init__(self, path: Path, size: int, *, least: int = LEAST) -> None:
        self._path = path
        self._whole = self._left = allowed(size, least=least)

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
