"""A repair removes its defect, is recorded, and does not change the original record."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.records import DamperTest, repair
from mrwork.records.reading import synthetic_test
from mrwork.records.repairs import REPAIR_KINDS


@pytest.fixture
def clean() -> DamperTest:
    return synthetic_test("spencer1997")


def test_a_known_offset_is_subtracted(clean: DamperTest) -> None:
    repaired, log = repair(replace(clean, force=clean.force + 200.0), ["offset"], amounts={"offset": 200.0})
    np.testing.assert_allclose(repaired.force, clean.force, atol=1e-9)
    assert [entry.code for entry in log] == ["repaired_offset"]


def test_an_offset_is_measured_where_none_is_given(clean: DamperTest) -> None:
    _, (before,) = repair(clean, ["offset"])
    _, (after,) = repair(replace(clean, force=clean.force + 200.0), ["offset"])
    assert before.measured is not None
    assert after.measured is not None
    assert after.measured.value - before.measured.value == pytest.approx(200.0, abs=1e-6)


def test_a_late_velocity_is_derived_anew(clean: DamperTest) -> None:
    late = replace(clean, velocity=np.roll(clean.velocity, 15), velocity_source="measured")
    repaired, _ = repair(late, ["velocity"])
    assert repaired.velocity_source == "derived"
    exact = 0.015 * 5.0 * np.pi * np.cos(5.0 * np.pi * clean.time)
    # 5 um of noise through a cubic filter over 59 samples of 1 ms; the recorded velocity has noise of 0.5 mm/s.
    assert np.std((repaired.velocity - exact)[60:-60]) < 5e-4


def test_rest_is_cut_off(clean: DamperTest) -> None:
    held = {
        name: np.concatenate([np.full(700, getattr(clean, name)[0]), getattr(clean, name)])
        for name in ("displacement", "velocity", "force")
    }
    repaired, (entry,) = repair(replace(clean, **held), ["rest"])
    assert entry.measured is not None
    # The motion reaches 1 % of its stroke after another 1.3 ms.
    assert entry.measured.value == pytest.approx(0.7, abs=0.003)
    assert repaired.n_time == pytest.approx(clean.n_time, abs=3)
    assert repaired.start_time == pytest.approx(0.7, abs=0.003)


def test_the_record_is_kept_beside_the_repaired_one(clean: DamperTest) -> None:
    once, _ = repair(clean, ["offset"])
    twice, _ = repair(once, ["velocity"])
    assert once.original is clean
    assert twice.original is clean
    assert clean.original is None
    assert [remark.severity for remark in twice.remarks] == ["repaired", "repaired"]


def test_a_cured_remark_gives_way_to_the_repair(clean: DamperTest) -> None:
    raised = mr.test_from_arrays(
        name="raised", time=clean.time, displacement=clean.displacement, force=clean.force + 300.0
    )
    assert "force_offset" in [remark.code for remark in raised.remarks]
    repaired, _ = repair(raised, ["offset"])
    assert [remark.code for remark in repaired.remarks] == ["velocity_derived", "repaired_offset"]


def test_a_repair_without_a_cause_changes_nothing_and_says_why(clean: DamperTest) -> None:
    same, (entry,) = repair(clean, ["rest"])
    assert entry.severity == "note"
    assert entry.message.startswith("no rest to repair: ")
    assert same.original is None
    np.testing.assert_array_equal(same.force, clean.force)


def test_every_repair_is_in_the_log_in_its_order(clean: DamperTest) -> None:
    _, log = repair(clean, reversed(REPAIR_KINDS))
    assert [entry.code.split("_", 1)[1] for entry in log] == list(REPAIR_KINDS)


def test_an_amount_of_another_repair_is_refused(clean: DamperTest) -> None:
    refusal(repair, clean, [], amounts={"rest": 1.0}, match="offset .* alone")
