"""Every reader of the package."""

from __future__ import annotations

from fuzzing.reader import Reader
from fuzzing.user_files import user_readers


def all_readers() -> list[Reader]:
    """Readers of what users bring."""
    return user_readers()
