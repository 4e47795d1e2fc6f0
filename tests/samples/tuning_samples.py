"""A small study with training and test motions, for tests of tuning."""

from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from study_texts import study_text

import mrwork as mr
from mrwork.store.codec import plain
from mrwork.tuning import tune
from mrwork.tuning.judging import Judgement, judge
from mrwork.tuning.tuned_laws import TunedLaw, TuningResults
from mrwork.tuning.tuning_folder import chosen_study

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
def study_with(**options: str) -> mr.Study:
    """The study file with these parts, once for each of them."""
    with TemporaryDirectory() as folder:
        return mr.read_study(study_file(Path(folder), **options))


def small_study(tune: str = TUNE) -> mr.Study:
    """The study file on two storeys. Equal ones are one study, whose plant keeps the designs of the references."""
    return study_with(tune=tune, building=TWO_STOREYS)


def tuned(table: str) -> TuningResults:
    """Results of the small study with what another table tunes."""
    return tune(small_study(), small_study(table).tunes, threads=1)


def judgement(results: TuningResults, study: mr.Study) -> Judgement:
    """What the first law is worth on the test motions."""
    judged = judge(study, results, threads=1)
    found = judged.judgement(results.laws[0], "test")
    assert found is not None
    return found


def tuned_law_with_its_score(folder: Path, table: str) -> TunedLaw:
    """The law that a table tunes, which has the score of its test in the chosen study, too."""
    results = tuned(table)
    assert_its_score(results, small_study(table), folder)
    return results.laws[0]


def assert_its_score(results: TuningResults, study: mr.Study, folder: Path) -> None:
    """The first law of the chosen study has the score of the tuning."""
    law = results.laws[0]
    chosen = folder / "chosen.toml"
    chosen.write_text(chosen_study(results, study.origin.file), encoding="utf-8")
    found = mr.run_study(mr.read_study(chosen), threads=1)
    row = [each.label for each in found.rows].index(law.label)
    assert found.score(row).mean == pytest.approx(judgement(results, study).score.mean, rel=1e-12)


def without_times(results: TuningResults) -> Any:
    """The document of a tuning without what a clock says."""
    still = replace(results, seconds=0.0)
    laws = tuple(replace(each, seconds=0.0) for each in still.laws)
    references = tuple(replace(each, seconds=0.0) for each in still.references)
    return plain(asdict(replace(still, laws=laws, references=references)))
