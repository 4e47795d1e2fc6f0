"""Progress of a page while it is drawn, apart because the page, its sections and the figure files report it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PageProgress:
    """Parts of a page, or figure files, that are `done` of `total`, and the next `task` in words."""

    done: int
    total: int
    task: str


OnDrawn = Callable[[PageProgress], None]
"""Receives the progress of a page."""


def unobserved(_: PageProgress) -> None:
    """Ignore progress."""
