"""A small study with training and test motions, for tests of tuning."""

from __future__ import annotations

from pathlib import Path

STUDY = """title = "Small"

[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
lag = 190
differential = true

[hardware]
step = "1 ms"
"""
TUNE = """
[[tune]]
laws = ["clipped_optimal"]
budget = 16
population = 8
"""


def motion(name: str, seed: int, use: str = "") -> str:
    """A short synthetic motion."""
    lines = [
        "[[motion]]",
        'synthetic = "kanai_tajimi"',
        f'name = "{name}"',
        "duration = 3",
        f"seed = {seed}",
        'pga = "0.1 g"',
        *([f'use = "{use}"'] if use else []),
    ]
    return "\n" + "\n".join(lines) + "\n"


def study_file(folder: Path, *, tune: str = TUNE, motions: str = "", more: str = "") -> Path:
    """A study file with one training and two test motions, unless others are given."""
    given = motions or motion("A", 1, "training") + motion("B", 2, "test") + motion("C", 3)
    path = folder / "study.toml"
    path.write_text(STUDY + more + given + tune, encoding="utf-8")
    return path
