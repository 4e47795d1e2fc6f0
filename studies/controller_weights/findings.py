"""Every finding of the study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from studies.controller_weights.designs import extensions, inverses, sizes, unreachable
from studies.controller_weights.loop import LEVELS, scanned


def found_by(*, quick: bool, records: Path, threads: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Every figure, as nested dictionaries; the true loop where the records are at hand."""
    say("program and Riccati equations")
    found: dict[str, Any] = {"sizes": dict(sizes(quick=quick))}
    say("extensions")
    found["extensions"] = dict(extensions(quick=quick))
    say("inverse")
    found["inverses"] = dict(inverses(quick=quick))
    found["unreachable"] = unreachable()
    if records.is_dir():
        # The quick form scans less, under one record: its scores are others.
        loop = found["quick_loop" if quick else "true_loop"] = {}
        for level in LEVELS[:1] if quick else LEVELS:
            say(f"true loop, {level:g} g")
            loop[f"{level:g}"] = scanned(level, records, quick=quick, threads=threads)
    return found
