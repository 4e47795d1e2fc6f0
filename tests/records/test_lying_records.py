"""Records that lie are told with what to check, and honest records of every kind of motion have no such warning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from record_files import codes, message

from mrwork.records.checks import clipped_share, coarse_step
from tools.faults.lying_records import (
    LIES,
    MODELS,
    MOTIONS,
    RIGS,
    TELLING,
    Columns,
    Lie,
    Rig,
    honest,
    honest_records,
)

SINE = MOTIONS[0]
LAB = RIGS[0]
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


def test_a_lie_is_told_with_its_size() -> None:
    columns = sine()
    time, still = columns.time, columns.displacement.copy()
    still[4000:] = still[4000]
    peak = np.abs(columns.force).max()
    for code, changes, words in (
        ("displacement_still", {"displacement": still}, "for 3.98 s, first from 4.03 s on"),
        (
            "displacement_jumps",
            {"displacement": columns.displacement + 7e-3 * (time > 3.0)},
            "at 3 s: that is 7.",
        ),
        (
            "displacement_drifts",
            {"displacement": columns.displacement + 5e-3 * time},
            "by +5 mm/s, +40 mm over",
        ),
        ("displacement_unusual", {"displacement": 0.5e-3 * columns.displacement}, "spans 10 um"),
        ("force_unusual", {"force": 1.1e6 / peak * columns.force}, "reaches 1.1 MN, more than the 600 kN"),
        ("time_unusual", {"time": 1000.0 / 1.5 * time}, "has 0.0015 Hz"),
    ):
        assert words in message(replace(columns, **changes).test(), code)


@pytest.mark.parametrize("rig", [RIGS[6], RIGS[7]], ids=lambda rig: rig.name)
def test_a_large_damper_is_honest_and_a_small_stroke_of_a_mount_too(rig: Rig) -> None:
    columns = honest("bouc_wen", SINE, rig)
    assert not TELLING & set(codes(columns.test()))
    short = replace(columns, displacement=0.25e-3 / np.abs(columns.displacement).max() * columns.displacement)
    mount = replace(short, time=0.01 * columns.time, force=0.001 * columns.force)
    assert not TELLING & set(codes(mount.test()))


def test_a_coarse_force_is_told_by_its_step_and_not_called_clipped() -> None:
    columns = sine()
    force = 1150.0 / np.abs(columns.force).max() * columns.force
    test = replace(columns, force=400.0 * np.round(force / 400.0)).test()
    assert codes(test) == ["velocity_derived", "force_offset", "coarse"]
    assert "in steps of 400 N, 40 % of its half range of 1000 N" in message(test, "coarse")


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
