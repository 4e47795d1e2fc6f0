"""Measured records: all are read, their known defects are detected, and clean ones have no remark."""

from pathlib import Path

import measured_data
import numpy as np
import pytest
from record_files import codes

import mrwork as mr
from mrwork.records import DamperTest, read_damper_tests
from mrwork.records.checks import detect_smoothing
from mrwork.records.likeness import RecordedMotion, alike_groups
from mrwork.records.remarks import find_mislabelled

DATA = measured_data.DATA / "dampers"

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason=f"measured damper records are not at {DATA} (set MRWORK_DATA)"
)


@pytest.fixture(scope="module")
def utfsm() -> tuple[DamperTest, ...]:
    return read_damper_tests(DATA / "utfsm" / "*.csv")


@pytest.fixture(scope="module")
def labcontrol() -> tuple[DamperTest, ...]:
    return read_damper_tests(DATA / "labcontrol" / "*.csv")


def test_each_remark_is_where_its_cause_is(utfsm: tuple[DamperTest, ...]) -> None:
    assert len(utfsm) >= 45
    names = {test.name for test in utfsm}
    told = {
        code: {test.name for test in utfsm if code in codes(test)}
        for code in ("velocity_difference", "velocity_noisy", "moving_average", "loop_drift")
    }
    # The smoothed files contain backward differences.
    smoothed = {name for name in names if not name.startswith("unfiltered")}
    assert told["velocity_difference"] == smoothed
    # The velocity of the original files is a derivative over five samples; of the smallest stroke it is noisy.
    assert all(name.startswith("unfiltered_2mm5Hz") for name in told["velocity_noisy"])
    assert told["moving_average"] == smoothed
    # Without current the force is small and settles in the first cycles, in the smoothed and the original files.
    assert all("0A" in name for name in told["loop_drift"])
    assert {code for test in utfsm for code in codes(test)} == set(told)


def test_labels_of_one_set_are_right_and_two_of_the_other_wrong(
    utfsm: tuple[DamperTest, ...], labcontrol: tuple[DamperTest, ...]
) -> None:
    assert [*find_mislabelled(utfsm)] == []
    named = {remark.message.partition(": ")[0] for remark in find_mislabelled(labcontrol)}
    # Of the tests labelled 0.87 V, these two dissipate a quarter more than the other eight, which agree within 10 %.
    assert {Path(name).stem for name in named} == {"ensaio9.2", "ensaio10.2"}


def test_commands_of_columns_and_names_agree(utfsm: tuple[DamperTest, ...]) -> None:
    assert {test.current for test in utfsm} == {0.0, 0.25, 0.5, 0.75, 1.0}
    assert {test.frequency for test in utfsm} == {0.1, 0.25, 0.5, 1.0, 3.0, 5.0}


def test_the_static_offset_of_a_gas_filled_damper_is_found(labcontrol: tuple[DamperTest, ...]) -> None:
    # Five files of this set were zeroed before they were published; their mean force is within 6 N of zero.
    zeroed = {test.name for test in labcontrol if abs(np.mean(test.force)) < 10.0}
    assert {test.name for test in labcontrol if "force_offset" not in codes(test)} == zeroed
    assert len(zeroed) < len(labcontrol) / 5


def test_rest_before_the_motion_is_found(labcontrol: tuple[DamperTest, ...]) -> None:
    for test in labcontrol:
        first_second = test.displacement[: round(1.0 / test.dt)]
        at_rest = np.ptp(first_second) < 0.01 * np.ptp(test.displacement)
        if at_rest:
            assert "rest_before_motion" in codes(test), test.name


def test_deriving_the_velocity_agrees_with_the_measured_one(labcontrol: tuple[DamperTest, ...]) -> None:
    for test in labcontrol:
        derived = mr.test_from_arrays(
            name=test.name, time=test.time, displacement=test.displacement, force=test.force
        )
        # The derivative of the rig is smoothed over a few samples of 10 ms; the bound allows for this.
        assert np.std(derived.velocity - test.velocity) < 0.06 * np.std(test.velocity), test.name


def test_the_authors_moving_average_over_a_tenth_of_a_period_is_found(utfsm: tuple[DamperTest, ...]) -> None:
    for test in utfsm:
        found = detect_smoothing(test)
        if test.name.startswith("unfiltered"):
            assert found is None, test.name
            continue
        assert found is not None, test.name
        assert test.frequency is not None
        # Rounded down to samples: a tenth of a period of 3 Hz is 33 ms.
        assert found.window_seconds == pytest.approx(0.1 / test.frequency, abs=test.dt), test.name
        assert found.channels == ("force", "displacement"), test.name


def test_no_moving_average_is_seen_where_none_is_known(labcontrol: tuple[DamperTest, ...]) -> None:
    assert [test.name for test in labcontrol if detect_smoothing(test)] == []


def test_raw_and_smoothed_versions_are_alike_and_no_other_tests_are(utfsm: tuple[DamperTest, ...]) -> None:
    groups = alike_groups([RecordedMotion.of(test) for test in utfsm])
    facts = [
        {(utfsm[index].amplitude, utfsm[index].frequency, utfsm[index].current) for index in members}
        for members in groups
    ]
    assert all(len(each) == 1 for each in facts)
    # Thirty settings of the rig; the raw records of twenty are there too.
    assert sorted(len(members) for members in groups) == [1] * 10 + [2] * 20
