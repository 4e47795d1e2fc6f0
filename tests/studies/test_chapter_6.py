"""The study of chapter 6 in its quick form, on the measured records; and its arithmetic."""

from __future__ import annotations

import os
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from result_tables import assert_filled

from mrwork.control import ControlLaw
from studies.chapter_6 import tuning
from studies.chapter_6.loop_findings import TUNED_LAWS, found_by
from studies.chapter_6.tables import tables
from studies.chapter_6.thesis_tables import thesis_tables
from studies.chapter_6.tuning import Found, Tuned, about, control_law_of, grid
from studies.common.command import Work
from studies.common.expected import departures
from studies.common.frame import LEVELS, bench, figures, level_name

RECORDS = Path(os.environ.get("MRWORK_DATA", "../shared/data")) / "records"
measured = pytest.mark.skipif(
    not (RECORDS / "el_centro_1940_ns.csv").is_file(),
    reason=f"no measured records in {RECORDS}; set MRWORK_DATA",
)


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return {**found_by(Work(quick=True, records=RECORDS)), "seconds": 0.0}


@measured
def test_the_quick_form_finds_what_is_expected(found: dict[str, Any]) -> None:
    assert departures(found, Path("studies/chapter_6/expected.toml")) == []


@measured
def test_every_table_names_its_rows_and_fills_them(found: dict[str, Any]) -> None:
    of_thesis = thesis_tables(found, [level_name(level) for level in LEVELS])
    assert_filled(chain(tables(found), *of_thesis.values()))


def test_every_law_has_a_setting_for_both_levels() -> None:
    kept = tuning.kept()
    assert set(TUNED_LAWS) <= set(kept)
    for at_level in kept.values():
        for tuned in at_level:
            if tuned.law != "inverse_network":
                assert control_law_of(tuned).name == tuned.law


@measured
def test_no_command_scores_one_and_a_failed_run_infinity() -> None:
    over = bench(RECORDS, names=("Hachinohe",), threads=1)
    none = figures(over, ControlLaw(name="passive", gains={"command": [0.0]}))
    np.testing.assert_array_equal(none.score, 1.0)
    unstable = figures(over, ControlLaw(name="active", gains={"gain": np.full((1, 10), -1e9)}))
    np.testing.assert_array_equal(unstable.score, np.inf)


def test_settings_are_kept_as_they_were_found(tmp_path: Path) -> None:
    at_level = (
        Tuned(law="lyapunov", settings={"state_weight": (1.0, 2.5)}, largest_current=1.2),
        Tuned(law="lyapunov", settings={}, largest_current=1.88),
    )
    found = Found(at_level=at_level, scores=(0.5, 0.6), both=at_level[0], both_score=(0.5, 0.7), tried=2)
    tuning.keep({"lyapunov": found}, tmp_path / "tuned.toml")
    assert tuning.kept(tmp_path / "tuned.toml") == {"lyapunov": at_level}


def test_steps_about_settings_leave_the_network_as_it_is() -> None:
    first = grid("inverse_network")[0]
    for moved in about(first, 5, np.random.default_rng(1)):
        assert moved["amplitude"] == first["amplitude"]
        assert moved["control_weight"] != first["control_weight"]
