"""The quick form of each chapter: its numbers are those expected, its tables are filled and its page stands alone."""

from __future__ import annotations

from itertools import chain
from typing import Any

import measured_data
import pytest

from studies.chapter_6 import tuning
from studies.chapter_6.loop_findings import TUNED_LAWS, found_by
from studies.chapter_6.tables import tables
from studies.chapter_6.thesis_tables import thesis_tables
from studies.chapter_6.tuning import control_law_of
from studies.former.command import Work
from studies.former.expected import departures
from studies.former.frame import LEVELS, level_name

STUDIES = measured_data.ROOT / "studies"
MEASURED = measured_data.DATA / "records"
measured = pytest.mark.skipif(
    not (MEASURED / "el_centro_1940_ns.csv").is_file(),
    reason=f"no measured records in {MEASURED}; set MRWORK_DATA",
)


def assert_filled(shown: Any) -> None:
    """Each row has a name, and a text below each heading."""
    for table in shown:
        assert table.rows, table.title
        assert {len(row) for row in table.rows} == {len(table.columns)}, table.title
        assert all(row[0] for row in table.rows), table.title


@measured
@pytest.mark.long
def test_the_quick_form_of_chapter_6_finds_what_is_expected() -> None:
    found = {**found_by(Work(quick=True, records=MEASURED)), "seconds": 0.0}
    assert departures(found, STUDIES / "chapter_6/expected.toml") == []
    of_thesis = thesis_tables(found, [level_name(level) for level in LEVELS])
    assert_filled(chain(tables(found), *of_thesis.values()))


def test_every_tuned_law_has_a_setting_for_both_levels() -> None:
    kept = tuning.kept()
    assert set(TUNED_LAWS) <= set(kept)
    for at_level in kept.values():
        assert len(at_level) == len(LEVELS)
        assert all(
            control_law_of(each).name == each.law for each in at_level if each.law != "inverse_network"
        )
