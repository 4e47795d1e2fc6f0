"""Studies of laws at two levels, robust control and the predictive rollout, on small studies of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tuning_samples
from blank_pictures import blank
from test_chapters import assert_filled

import mrwork as mr
from studies.rollout.findings import cost_found, kept_in, level_found
from studies.rollout.loop import SIXTEEN, TRAINING, Bench, bench_of
from studies.rollout.page import write_page
from studies.rollout.tables import tables

LAWS = """
[[controller]]
law = "predictive_rollout"
settings = { base = 0.47, drift = 0.002, acceleration = 2.8 }

[[controller]]
law = "best_passive"
"""


def quiet(_: object) -> None:
    pass


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    file = tuning_samples.study_file(tmp_path_factory.mktemp("rollout"), tune="", more=LAWS)
    return bench_of(mr.read_study(file), threads=1)


@pytest.mark.long
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
