"""The second part of the study of chapter 6: sheets, every floor with its band, and dampers that push one way."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import mrwork as mr
from studies.chapter_6.identified_damper import FORCE_NOISE, identified_damper, virtual_test
from studies.chapter_6.thesis_findings import (
    CONSTANT,
    DIRECT,
    OFF,
    ONE,
    PAIR,
    QUANTITIES,
    SHOWN,
    TWO,
    arrangements_found,
    floors_found,
    sheets_at,
    worse_found,
)
from studies.common.frame import FRAME, RECORDS, bench, pair, record_title

FOLDER = Path(os.environ.get("MRWORK_DATA", "../shared/data")) / "records"
CONSTANTS = (0.68, 1.88)
measured = pytest.mark.skipif(
    not (FOLDER / "hachinohe_1968_ns.csv").is_file(),
    reason=f"no measured records in {FOLDER}; set MRWORK_DATA",
)


def static_force(device: mr.Device, displacement: float) -> float:
    """Force of one damper of a device that is held at a displacement, without current."""
    loading = mr.Loading(
        dt=1e-3,
        displacement=np.full(4, displacement),
        velocity=np.zeros(4),
        command=0.0,
        command_unit="A",
    )
    return float(mr.simulate_force(device.spec, np.asarray(device.theta), loading)[-1])


@measured
def test_draws_that_are_the_published_damper_make_bands_of_no_width() -> None:
    over = bench(FOLDER, names=("Hachinohe",), threads=1)
    floors = floors_found(over, CONSTANTS, np.tile(np.asarray(pair().theta), (2, 1)))
    for table in floors.values():
        assert list(table) == [OFF, CONSTANT, *DIRECT]
        for label, by_record in table.items():
            for quantities in by_record.values():
                for found in quantities.values():
                    np.testing.assert_array_equal(found["low"], found["ratios"])
                    np.testing.assert_array_equal(found["high"], found["ratios"])
                    if label == OFF:
                        np.testing.assert_array_equal(found["ratios"], 1.0)
            drift, displacement = (quantities[name]["values"] for name in ("peak_drift", "peak_displacement"))
            # The first storey stands on the ground.
            assert drift[0] == displacement[0]
    for level, laws in worse_found(floors).items():
        for law, quantities in laws.items():
            for quantity in QUANTITIES:
                each, (of_floors,) = quantities[quantity.name], floors[level][law].values()
                ratios = of_floors[quantity.name]["ratios"]
                assert each["than_off"] == each["surely"] == sum(ratio > 1.0 for ratio in ratios)
                assert each["worst"] == max(ratios)
                assert (each["widest"], each["within"], each["of"]) == (0.0, 5, 5)
        assert {each["than_constant"] for each in laws[CONSTANT].values()} == {0}


@measured
def test_one_way_dampers_push_the_frame_to_where_its_stiffness_balances_them() -> None:
    over = bench(FOLDER, threads=1)
    table = arrangements_found(over, CONSTANTS, quick=True)["0.1 g"]
    assert list(table) == [OFF, CONSTANT, *SHOWN]
    for arrangement, count in ((ONE, 1), (TWO, 2)):
        (found,) = table[OFF][arrangement].values()
        displacement = 1e-3 * found["before"]
        # What holds a floor of a chain against a force at the first is the first storey alone.
        stiffness = FRAME.stiffness[0, 0] + FRAME.stiffness[0, 1]
        assert displacement < 0.0
        assert count * static_force(pair(), displacement) == pytest.approx(
            -stiffness * displacement, rel=1e-4
        )
        assert found["after"] == pytest.approx(found["before"], abs=1e-5)
    for arrangements in table.values():
        (found,) = arrangements[PAIR].values()
        assert found["before"] == 0.0
        assert abs(found["after"]) < 1e-4


@measured
def test_sheets_are_of_one_motion_and_only_one_run_has_current() -> None:
    over = bench(FOLDER, names=("Hachinohe",), threads=1)
    for sheet in sheets_at(over, 0, CONSTANTS[0]):
        np.testing.assert_array_equal(
            sheet.controlled.ground_acceleration, sheet.reference.ground_acceleration
        )
        assert not sheet.reference.current.any()
        assert sheet.controlled.current.max() > 0.1
    assert [sheet.label for sheet in sheets_at(over, 1, CONSTANTS[1])] == [CONSTANT, *SHOWN]


def test_the_identified_damper_is_the_one_of_the_test_within_its_noise() -> None:
    test = virtual_test()
    found = identified_damper(5, most_steps=10, threads=1)
    spread = found.theta.std(axis=0)
    assert found.theta.shape == (5, len(np.asarray(pair().theta)))
    np.testing.assert_array_equal(found.theta[:, -1], np.asarray(pair().theta)[-1])
    assert np.all(spread[:-1] > 0.0)
    # The model has the noise of the force, and that of the displacement comes on top.
    assert FORCE_NOISE * (1.0 - 3.0 / np.sqrt(2.0 * test.n_time)) < found.error < 1.2 * FORCE_NOISE
    for name, each in found.found.items():
        assert abs(each["median"] / each["truth"] - 1.0) < 0.1, name


def test_every_record_has_its_title() -> None:
    for title, file in RECORDS:
        assert record_title(Path(file).stem) == title
