"""Records that lie are told with what to check, and honest records of every kind of motion have no such warning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import measured_data
import numpy as np
import pytest
from command_line import mrwork, printed
from record_files import codes, message, write_text
from scipy.io import savemat

from mrwork.records import read_damper_tests
from mrwork.records.checks import clipped_share, coarse_step
from tools.faults.lying_records import (
    LIES,
    MODELS,
    MOTIONS,
    RIGS,
    TELLING,
    Columns,
    Lie,
    honest,
    honest_records,
)

SINE = MOTIONS[0]
LAB = RIGS[0]
DATA = measured_data.DATA / "dampers"
# What a sine through a hysteretic damper does not tell: a force that is early by less than its hysteresis is late.
SILENT = {("the force is early", -0.01), ("the force is of another test", 1.0)}


def sine() -> Columns:
    return honest("bouc_wen", SINE, LAB)


@pytest.mark.parametrize(
    ("lie", "size"),
    [pytest.param(lie, size, id=f"{lie.name} {size:g}") for lie in LIES for size in lie.sizes],
)
def test_a_lie_of_a_plain_sine_is_told(lie: Lie, size: float) -> None:
    assert lie.is_told(lie.tell(sine(), size)) == ((lie.name, size) not in SILENT)


@pytest.mark.parametrize("model", ["bouc_wen", "dahl"])
def test_honest_records_of_every_motion_have_no_warning_of_a_lie(model: str) -> None:
    told = {
        name: found
        for name, columns in honest_records((model,), rigs=(LAB, RIGS[6]))
        if (found := TELLING & set(codes(columns.test())))
    }
    assert told == {}


def test_every_model_is_honest_in_a_sine() -> None:
    told = {
        model: found for model in MODELS if (found := TELLING & set(codes(honest(model, SINE, LAB).test())))
    }
    assert told == {}


@pytest.mark.skipif(not DATA.is_dir(), reason=f"measured damper records are not at {DATA} (set MRWORK_DATA)")
def test_measured_records_have_no_warning_of_a_lie() -> None:
    tests = read_damper_tests([DATA / "utfsm", DATA / "labcontrol"])
    assert {test.name: found for test in tests if (found := TELLING & set(codes(test)))} == {}


def test_a_lie_is_told_with_its_size_and_what_to_check() -> None:
    columns = sine()
    time = columns.time
    still = columns.displacement.copy()
    still[4000:] = still[4000]
    assert message(replace(columns, displacement=still).test(), "displacement_still") == (
        "the displacement stands still for 3.98 s, first from 4.03 s on, while the force goes from one side to the "
        "other; check the sensor of the displacement and its cable, or omit that part (--from, --until)"
    )
    jumped = replace(columns, displacement=columns.displacement + 7e-3 * (time > 3.0)).test()
    assert "jumps by 7.0" in message(jumped, "displacement_jumps")
    assert "at 3 s: that is 7." in message(jumped, "displacement_jumps")
    drifting = replace(columns, displacement=columns.displacement + 5e-3 * time).test()
    assert "drifts by +5 mm/s, +40 mm over the record" in message(drifting, "displacement_drifts")
    small = replace(columns, displacement=0.5e-3 * columns.displacement).test()
    assert "spans 10 um" in message(small, "displacement_unusual")
    large = replace(columns, force=1.1e6 / np.abs(columns.force).max() * columns.force).test()
    assert message(large, "force_unusual") == (
        "the force reaches 1.1 MN, more than the 600 kN of the largest dampers; check its channel and its unit: are N "
        "taken for kN?"
    )
    slow = replace(columns, time=1000.0 / 1.5 * time).test()
    assert "has 0.0015 Hz" in message(slow, "time_unusual")
    assert "are ms taken for s?" in message(slow, "time_unusual")


@pytest.mark.parametrize(
    "rig", [rig for rig in RIGS if rig.name in ("200 kN", "400 kN")], ids=lambda rig: rig.name
)
def test_a_large_damper_is_honest_and_a_small_stroke_of_a_mount_too(rig: object) -> None:
    columns = honest("bouc_wen", SINE, rig)  # type: ignore[arg-type]
    assert not TELLING & set(codes(columns.test()))
    short = replace(columns, displacement=0.25e-3 / np.abs(columns.displacement).max() * columns.displacement)
    mount = replace(short, time=0.01 * columns.time, force=0.001 * columns.force)
    assert not TELLING & set(codes(mount.test()))


def test_a_coarse_force_is_told_by_its_step_and_not_called_clipped() -> None:
    columns = sine()
    force = 1150.0 / np.abs(columns.force).max() * columns.force
    test = replace(columns, force=400.0 * np.round(force / 400.0)).test()
    assert codes(test) == ["velocity_derived", "force_offset", "coarse"]
    assert message(test, "coarse") == (
        "the force is read in steps of 400 N, 40 % of its half range of 1000 N; measure again with a smaller range "
        "or more digits"
    )


@pytest.mark.parametrize("share", [0.002, 0.005, 0.01, 0.02, 0.03])
@pytest.mark.parametrize("rate", [1, 10])
def test_a_rounded_sine_is_not_clipped(share: float, rate: int) -> None:
    motion = np.sin(2.0 * np.pi * 0.001 * rate * np.arange(8000))
    read = share * np.round(motion / share)
    assert clipped_share(read) == 0.0 or coarse_step(read) is not None
    assert clipped_share(np.clip(read, -0.7, 0.7)) > 0.3


def test_a_force_that_stands_still_for_most_of_a_record_ends_no_check() -> None:
    columns = sine()
    force = columns.force.copy()
    force[500:7500] = force[500]
    assert "force_still" in codes(replace(columns, force=force).test())


def test_the_range_of_a_command_agrees_with_that_of_other_tests(tmp_path: Path) -> None:
    for number, top in enumerate((2.69, 2.72)):
        columns = honest("bouc_wen", SINE, LAB, rng=number)
        volts = np.where(columns.time % 2.0 < 1.0, 0.0, top)
        # The driver rings below zero after each step.
        since = columns.time % 2.0
        volts[since < 0.03] = -0.45 * np.exp(-since[since < 0.03] / 0.008)
        channels = {
            "t_s": columns.time,
            "displacement_m": columns.displacement,
            "force_n": columns.force,
            "voltage_v": volts,
        }
        write_text(tmp_path / f"test{number}.csv", channels)
    said = printed("check", tmp_path)
    assert "switches between 0 and 2.69 V, by 2.69 V; a model" in said
    assert "[numbers of test0; over these tests 2.69 to 2.72 V]" in said


def test_a_hint_for_one_file_of_a_folder_names_what_works_for_the_folder(tmp_path: Path) -> None:
    rig = tmp_path / "rig"
    rig.mkdir()
    columns = sine()
    write_text(
        rig / "test.csv",
        {"t_s": columns.time, "displacement_m": columns.displacement, "force_n": columns.force},
    )
    other = honest("bouc_wen", MOTIONS[1], LAB)
    savemat(rig / "old.mat", {"zeit": other.time, "weg": 1e3 * other.displacement, "kraft": other.force})
    refused = mrwork("check", rig)
    assert refused.returncode == 2
    assert (
        "likely --column time=zeit:s --column displacement=weg:mm --column force=kraft:N; " in refused.stderr
    )
    assert "into its row of a table of tests, as mrwork check FILES --table begins it" in refused.stderr
    # The options alone are for every file, and the other has other columns.
    options = ("--column", "time=zeit:s", "--column", "displacement=weg:mm", "--column", "force=kraft:N")
    assert "table of tests" in mrwork("check", rig, *options).stderr
    assert "table of tests" not in mrwork("check", rig / "old.mat").stderr
    printed("check", rig, "--table")
    table = rig / "tests.csv"
    table.write_text(table.read_text().replace("old.mat,fit,?,?,?", "old.mat,fit,zeit:s,weg:mm,kraft:N"))
    said = printed("check", rig)
    assert "old.mat: 8001 samples" in said
    assert "test.csv: 8001 samples" in said
