"""Where measured records are, and what is said where they are not."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).parents[2]


def data() -> Path:
    """The folder of all measured data: that of `MRWORK_DATA`, else `shared/data` beside the project."""
    return Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))


def ground_motions() -> Path:
    """The folder of the measured ground motions."""
    return data() / "records"


def damper_tests() -> Path:
    """The folder of the UTFSM damper tests."""
    return data() / "dampers" / "utfsm"


def absent(what: str, place: Path) -> str:
    """A sentence on records that are not there, empty where they are."""
    return "" if place.exists() else f"{what} not at {place}; point MRWORK_DATA at the data"
