"""Number of Python calls that a function makes, which says how its work grows, whatever the machine does meanwhile."""

from __future__ import annotations

import sys
from types import FrameType


class Calls:
    """Calls of Python functions, and items that generators yield, between `begin` and `end`."""

    def __init__(self) -> None:
        self.count = 0
        self._former = sys.getprofile()

    def begin(self) -> None:
        sys.setprofile(self._called)

    def end(self) -> int:
        sys.setprofile(self._former)
        return self.count

    def _called(self, frame: FrameType, event: str, argument: object) -> None:
        self.count += event == "call"
