"""The quick form of each chapter: its numbers are those expected, its tables are filled and its page stands alone."""

from __future__ import annotations

from importlib import import_module
from itertools import chain
from typing import Any

import measured_data
import numpy as np
import pytest

from studies.chapter_6 import tuning
from studies.chapter_6.loop_findings import TUNED_LAWS, found_by
from studies.chapter_6.tables import tables
from studies.chapter_6.thesis_tables import thesis_tables
from studies.chapter_6.tuning import control_law_of
from studies.chapter_7.controlled_tests import NO_DAMPER_NAME, OFF, QUANTITIES
from studies.chapter_7.predictions import ALL_TRUE
from studies.chapter_7.virtual_rig import SENSORS
from studies.controller_weights.study import found_by as weights_found
from studies.controller_weights.tables import tables as weight_tables
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


def a_true_rig_misses_by_its_sensors(chapter: Any) -> None:
    """Predictions of the true rig differ from its tests by the noise and the rounding of the sensors alone."""
    true = chapter.campaign.predictions[ALL_TRUE]
    wide = np.hypot(SENSORS.displacement.noise, SENSORS.displacement.resolution / np.sqrt(12.0))
    for case, runs in chapter.campaign.tests.items():
        for record, seen in runs.items():
            error = seen.displacement - SENSORS.displacement.gain * true[case][record].displacement
            assert np.std(error) == pytest.approx(wide, rel=0.05)
    ratios = chapter.found[chapter.kind]["tests"]["ratios"]
    assert ratios[OFF] == dict.fromkeys(QUANTITIES, 1.0)
    assert all(each > 1.5 for each in ratios[NO_DAMPER_NAME].values())


# Half a minute; chapter 6 and the designed weights stand for the others in every change.
@pytest.mark.long
def test_the_quick_form_of_chapter_7_finds_what_is_expected() -> None:
    findings, shown = (import_module(f"studies.chapter_7.{part}") for part in ("findings", "tables"))
    chapter = findings.chapter_of(Work(quick=True, threads=1))
    assert departures(chapter.found, STUDIES / "chapter_7/expected.toml") == []
    a_true_rig_misses_by_its_sensors(chapter)
    assert_filled(chain(*shown.tables(chapter.found).values()))


@measured
@pytest.mark.long
def test_the_quick_form_of_chapter_6_finds_what_is_expected() -> None:
    found = {**found_by(Work(quick=True, records=MEASURED)), "seconds": 0.0}
    assert departures(found, STUDIES / "chapter_6/expected.toml") == []
    of_thesis = thesis_tables(found, [level_name(level) for level in LEVELS])
    assert_filled(chain(tables(found), *of_thesis.values()))


def test_the_quick_form_of_designed_weights_finds_what_is_expected() -> None:
    found = weights_found(quick=True, records=MEASURED, threads=1, say=lambda what: None)
    assert departures(found, STUDIES / "controller_weights/expected.toml") == []
    assert_filled(weight_tables(found))


def test_every_tuned_law_has_a_setting_for_both_levels() -> None:
    kept = tuning.kept()
    assert set(TUNED_LAWS) <= set(kept)
    for at_level in kept.values():
        assert len(at_level) == len(LEVELS)
        assert all(
            control_law_of(each).name == each.law for each in at_level if each.law != "inverse_network"
        )
