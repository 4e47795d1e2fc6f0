"""Every reader of the package."""

from __future__ import annotations

from tools.fuzzing.reader import Reader
from tools.fuzzing.run_files import run_readers
from tools.fuzzing.user_files import user_readers


def all_readers() -> list[Reader]:
    """Readers of what users bring and of what the verbs write."""
    return [*user_readers(), *run_readers()]
