"""The page of a run directory, kept up with what verbs add to it."""

from __future__ import annotations

import sys
from pathlib import Path

from mrwork.errors import MrworkError


def renew_page(place: Path) -> None:
    """Write the page of a run anew; where its tests are gone, a note says why it is as it was."""
    # Matplotlib is slow to load.
    from mrwork.report.fit.rewrite_page import rewrite_page

    try:
        rewrite_page(place)
    except MrworkError as reason:
        print(f"mrwork: the page of {place} is as it was: {reason}", file=sys.stderr)
