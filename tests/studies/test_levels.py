"""Studies of laws at two levels, robust control and the predictive rollout, on small studies of their own."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import measured_data
import pytest
import tuning_samples
from blank_pictures import blank
from test_chapters import assert_filled

import mrwork as mr
from mrwork.control import settings_of
from studies.robust_control.findings import level_found as robust_found
from studies.robust_control.page import score_figure
from studies.robust_control.tables import ANY
from studies.robust_control.tables import tables as robust_tables
from studies.rollout.findings import cost_found, kept_in, level_found
from studies.rollout.loop import SIXTEEN, TRAINING, Bench, bench_of
from studies.rollout.page import write_page
from studies.rollout.tables import tables

STUDIES = measured_data.ROOT / "studies"
LAWS = """
[[controller]]
law = "predictive_rollout"
settings = { base = 0.47, drift = 0.002, acceleration = 2.8 }

[[controller]]
law = "best_passive"
"""
UNCERTAIN = """
[uncertainty]
realisations = 3
stiffness = 0.1
"""


def quiet(_: object) -> None:
    pass


def test_laws_and_references_of_robust_control_stand_beside_each_other(tmp_path: Path) -> None:
    study = mr.read_study(tuning_samples.study_file(tmp_path, tune="", more=UNCERTAIN))
    results = mr.tune(study, laws=["clipped_optimal"], budget=24, threads=1)
    found = robust_found(study, results, clairvoyants=0, threads=1, say=quiet)
    laws = found["laws"]
    assert laws["Passive-off"]["test"] == 1.0
    assert set(laws["Passive-off"]["motions"]) == {"B", "C"}
    band = laws["Clipped-optimal, tuned"]["bands"]["peak_drift"]
    assert 0.0 < band["lower"] < band["median"] < band["upper"]
    made = list(robust_tables({"0.1 g": found}))
    assert_filled(made)
    table = next(each for each in made if each.title.startswith("Peaks below"))
    # The best law of each motion is no worse than any.
    assert table.rows[-1][0] == ANY
    larger = [float(row[-1]) for row in table.rows]
    assert larger[-1] == min(larger)
    (axes,) = score_figure(laws).axes
    assert len(axes.get_yticks()) == len(laws)


@pytest.mark.parametrize("name", ["robust_control", "rollout"])
def test_the_levels_differ_in_their_peaks_and_the_chosen_settings_are_those_of_laws(name: str) -> None:
    def text(kind: str, level: str) -> str:
        return (STUDIES / name / f"{kind}_{level}.toml").read_text(encoding="utf-8")

    strong = text("level", "01").replace("0.17 g", "0.5 g").replace("0.1 g", "0.3 g")
    assert strong == text("level", "03")
    for level in ("01", "03"):
        chosen = [each for each in tomllib.loads(text("chosen", level))["controller"] if "settings" in each]
        assert len(chosen) > 1
        for each in chosen:
            settings_of(each["law"], each["settings"])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    file = tuning_samples.study_file(tmp_path_factory.mktemp("rollout"), tune="", more=LAWS)
    return bench_of(mr.read_study(file), threads=1)


def test_rows_of_a_level_are_found_once(bench: Bench, tmp_path: Path) -> None:
    kept = kept_in(tmp_path / "runs.json", resume=False)
    settings: dict[str, Any] = {"quick": True, "clairvoyants": (), "say": quiet}
    level = level_found("0.1 g", bench, kept, **settings)
    assert level_found("0.1 g", bench, kept_in(tmp_path / "runs.json", resume=True), **settings) == level
    # The constant command of a row is chosen on training motions, that of the reference by itself.
    figures = bench.constant(SIXTEEN)
    assert (figures["larger"], figures["both"], figures["clearly"]) == (1.0, 0, 0)
    row = level["laws"]["Optimal passive"]
    assert row[TRAINING]["larger"] == 1.0
    assert row[SIXTEEN]["score"] >= figures["score"]
    found = {"levels": {"0.1 g": level}, "cost": cost_found(bench)}
    assert_filled(tables(found))
    with blank():
        write_page(found, tmp_path / "report.html")
    assert "<svg" in (tmp_path / "report.html").read_text(encoding="utf-8")
