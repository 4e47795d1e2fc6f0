"""Faults of recorders, units and tables are told of a ground motion; copies count once; honest motions are silent."""

from dataclasses import replace
from pathlib import Path

import measured_data
import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from tools.faults import planted_motions
from tools.faults.planted import sweep

HONEST = mr.synthetic_motion(rng=3, duration=20.0)
TARGET = mr.motions.en_1998_spectrum(2.0, "B")


def with_samples(acceleration: np.ndarray, dt: float = HONEST.dt) -> mr.GroundMotion:  # type: ignore[type-arg]
    return replace(HONEST, acceleration=acceleration, dt=dt)


def with_a_spike() -> mr.GroundMotion:
    acceleration = HONEST.acceleration.copy()
    acceleration[1500] = 10.0 * HONEST.peak
    return with_samples(acceleration)


@pytest.mark.parametrize(
    ("motion", "code", "size"),
    [
        (with_a_spike(), "samples_wild", None),
        (
            with_samples(np.clip(HONEST.acceleration, -0.6 * HONEST.peak, 0.6 * HONEST.peak)),
            "acceleration_clipped",
            None,
        ),
        (with_samples(HONEST.acceleration + 0.03 * HONEST.peak), "acceleration_offset", None),
        (with_samples(np.zeros(500)), "acceleration_constant", 0.0),
        (with_samples(np.full(500, 0.5)), "acceleration_constant", 0.5),
        (with_samples(HONEST.acceleration, dt=1.0), "step_unusual", 1.0),
        (with_samples(HONEST.acceleration, dt=1e-5), "step_unusual", 1e-5),
        (with_samples(HONEST.acceleration * 100.0 / HONEST.peak), "acceleration_unusual", 100.0),
        (with_samples(HONEST.acceleration * 1e-3 / HONEST.peak), "acceleration_unusual", 1e-3),
    ],
)
def test_a_fault_is_told_wherever_a_motion_is_read(
    tmp_path: Path, motion: mr.GroundMotion, code: str, size: float | None
) -> None:
    (found,) = motion.remarks
    assert (found.code, found.words, found.severity) == (code, (motion.name,), "warning")
    assert found.measured is not None
    assert size is None or found.measured.value == pytest.approx(size)
    assert found.in_words in " ".join(repr(motion).split())
    pairs = zip(motion.time.tolist(), motion.acceleration.tolist(), strict=True)
    path = tmp_path / "motion.csv"
    path.write_text("\n".join(["t_s,a_mps2", *(f"{time!r},{value!r}" for time, value in pairs)]))
    with pytest.warns(mr.errors.MrworkWarning, match="ground motion motion: "):
        mr.read_motion(path)


def test_honest_motions_are_silent() -> None:
    drawn = [*mr.motions.suite(("rock", "firm", "medium", "soft"), 16, rng=5), HONEST]
    made = [
        mr.motions.sine(amplitude=1.0, frequency=1.0, cycles=20.0),
        mr.motions.near_fault_pulse(amplitude=2.0, period=1.5),
    ]
    for motion in (*drawn, *made):
        # Recorders with few digits are honest, too.
        coarse = replace(motion, acceleration=np.round(motion.acceleration, 2))
        assert motion.remarks == coarse.remarks == ()


@pytest.mark.skipif(not (measured_data.DATA / "records/real").is_dir(), reason="no measured records")
def test_measured_records_are_silent() -> None:
    records = measured_data.DATA / "records"
    motions = (*mr.read_motions(records / "real"), *mr.read_motions(str(records / "*.csv")))
    assert len(motions) == 20
    assert [motion.remarks for motion in motions] == [()] * 20


def test_planted_faults_are_told_and_honest_records_are_not() -> None:
    told, alarms = sweep(planted_motions.FAULTS, planted_motions.honest, 2 * len(planted_motions.FAULTS))
    assert set(told.values()) == {1.0}
    assert alarms == []


def test_a_motion_is_scaled_no_further_than_files_go() -> None:
    refusal(mr.motions.scaled_to_peak, HONEST, 300.0, match="beyond any earthquake")


def copy_of(motion: mr.GroundMotion, name: str, factor: float = 1.0, rest: int = 0) -> mr.GroundMotion:
    return replace(
        motion, name=name, acceleration=np.concatenate([np.zeros(rest), factor * motion.acceleration])
    )


def test_copies_in_a_suite_are_told_and_count_once() -> None:
    first, *others = mr.motions.suite("firm", 3, rng=0)
    check = mr.motions.check_suite(
        [first, copy_of(first, "twin"), copy_of(first, "far", -2.0, 300), *others], TARGET, period=0.8
    )
    assert check.copies == {first.name: ("twin", "far")}
    assert check.n_records == 3
    assert [each.words for each in check.remarks if each.code == "records_copied"] == [
        (first.name, "twin", "far")
    ]
    again = mr.motions.check_suite([first, first, *others], TARGET, period=0.8)
    assert again.n_records == 3


def test_levels_of_a_record_and_other_motions_are_no_copies() -> None:
    motions = mr.motions.suite(("firm", "soft"), 4, rng=1)
    levels = [mr.motions.scaled(motions[0], factor) for factor in (0.5, 2.0)]
    assert mr.motions.check_suite([*motions, *levels], TARGET, period=0.8).copies == {}
