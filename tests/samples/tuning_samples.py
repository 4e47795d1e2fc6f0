"""A small study with training and test motions, for tests of tuning."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from study_texts import study_text

import mrwork as mr
from mrwork.tuning import tune
from mrwork.tuning.results import LawResult, TuningResults, chosen_study

FIVE_STOREYS = 'published = "uts"'
# Weights of fewer states are designed in half the time, where the building is not what matters.
TWO_STOREYS = "masses = [120, 120]\nstiffnesses = [250e3, 250e3]\nmodal_damping = { ratios = [0.02] }"
STUDY = """title = "Small"

[building]
{building}

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


def study_file(
    folder: Path, *, tune: str = TUNE, motions: str = "", more: str = "", building: str = FIVE_STOREYS
) -> Path:
    """A study file with one training and two test motions, unless others are given."""
    given = motions or motion("A", 1, "training") + motion("B", 2, "test") + motion("C", 3)
    path = folder / "study.toml"
    path.write_text(STUDY.format(building=building) + more + given + tune, encoding="utf-8")
    return path


def small_files(place: Path) -> None:
    """Write studies that take little time: tuned.toml to be tuned, small.toml to be simulated."""
    study_file(place, building=TWO_STOREYS).rename(place / "tuned.toml")
    small = study_text("control_weight = 1e-13").replace("duration = 2", "duration = 0.4")
    (place / "small.toml").write_text(small)


@cache
def small_study() -> mr.Study:
    """The study file above. Its plant keeps the designs of the references, which are most of the time of a tuning."""
    with TemporaryDirectory() as folder:
        return mr.read_study(study_file(Path(folder)))


def tuned(folder: Path, table: str) -> TuningResults:
    """Results of the small study with what another table tunes."""
    return tune(small_study(), mr.read_study(study_file(folder, tune=table)).tunes, threads=1)


def tuned_law_with_its_score(folder: Path, table: str) -> LawResult:
    """The law that a table tunes, which has the score of its test in the chosen study, too."""
    source = study_file(folder, tune=table)
    results = tune(small_study(), mr.read_study(source).tunes, threads=1)
    law = results.laws[0]
    chosen = folder / "chosen" / "chosen.toml"
    chosen.parent.mkdir()
    chosen.write_text(chosen_study(results, mr.read_study(source).file), encoding="utf-8")
    found = mr.run_study(mr.read_study(chosen), threads=1)
    row = [each.label for each in found.rows].index(law.label)
    assert law.test is not None
    assert found.score(row) == pytest.approx(law.test.score, rel=1e-12)
    return law
