"""Processing of a motion does what it states, and is listed in `changes`."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from refusals import refusal

import mrwork as mr
from mrwork.files.roles import TIME, Series, check_rows
from mrwork.motions.series import ACCELERATION, motion_of_series

MOTION = mr.synthetic_motion(duration=5.0)


def columns(time: np.ndarray, acceleration: np.ndarray) -> mr.GroundMotion:
    series = Series(along=time, samples=acceleration[None, :], where=lambda row: f"row {row}")
    check_rows(series, TIME, ACCELERATION)
    return motion_of_series(series, name="a", source="")


def test_a_straight_acceleration_is_integrated_exactly() -> None:
    motion = mr.GroundMotion(name="a", dt=0.1, acceleration=np.linspace(0.0, 4.0, 21))
    assert_allclose(motion.velocity, motion.time**2, rtol=1e-12, atol=1e-14)
    assert_allclose(motion.displacement, motion.time**3 / 3.0, rtol=1e-12, atol=1e-14)


def test_scaling_is_told_and_changes_nothing_else() -> None:
    twice = mr.motions.scaled(MOTION, -2.0)
    assert_allclose(twice.acceleration, -2.0 * MOTION.acceleration, rtol=0)
    assert twice.changes == ("acceleration x -2",)
    small = mr.motions.scaled_to_peak(twice, 0.981)
    assert small.peak == pytest.approx(0.981, rel=1e-14)
    assert small.changes[1].endswith("to 0.981 m/s2")
    assert_allclose(small.acceleration / small.peak, twice.acceleration / twice.peak, rtol=1e-12)


def test_a_shorter_time_axis_divides_velocity_and_its_square_displacement() -> None:
    fast = mr.motions.time_scaled(MOTION, 0.2)
    assert fast.changes == ("time axis x 0.2",)
    assert fast.duration == pytest.approx(0.2 * MOTION.duration)
    assert_allclose(fast.velocity, 0.2 * MOTION.velocity, rtol=1e-10, atol=1e-12)
    assert_allclose(fast.displacement, 0.04 * MOTION.displacement, rtol=1e-9, atol=1e-12)


def test_a_cut_keeps_the_samples_of_both_bounds() -> None:
    cut = mr.motions.trimmed(MOTION, start=1.0, end=3.0)
    assert cut.n_time == 201
    assert_allclose(cut.acceleration, MOTION.acceleration[100:301], rtol=0)
    assert cut.changes == ("cut to 1 to 3 s",)
    assert mr.motions.trimmed(MOTION, end=50.0) is MOTION


@pytest.mark.parametrize("order", [0, 1, 3])
def test_a_baseline_of_its_order_is_taken_out_whole(order: int) -> None:
    clean = mr.motions.baseline_corrected(MOTION, order=order)
    place = np.linspace(0.0, 1.0, MOTION.n_time)
    drifting = mr.GroundMotion(name="a", dt=MOTION.dt, acceleration=MOTION.acceleration + 0.3 * place**order)
    assert_allclose(
        mr.motions.baseline_corrected(drifting, order=order).acceleration, clean.acceleration, atol=1e-12
    )
    assert abs(clean.acceleration.mean()) < 1e-14
    assert f"order {order}" in clean.changes[0]


def test_a_finer_grid_is_the_same_motion() -> None:
    fine = mr.motions.resampled(MOTION, MOTION.dt / 4)
    assert_allclose(fine.acceleration[::4], MOTION.acceleration, atol=1e-12)
    assert_allclose(fine.displacement[::4], MOTION.displacement, atol=1e-12)
    assert fine.n_time == 4 * (MOTION.n_time - 1) + 1


def test_a_coarser_grid_that_folds_back_is_told() -> None:
    # 40 Hz exceeds the Nyquist frequency for 0.02 s: interpolation aliases it to 10 Hz with its full amplitude.
    fast = mr.motions.sine(amplitude=1.0, frequency=40.0, cycles=400.0, dt=0.002)
    inner = slice(100, 400)
    with pytest.warns(mr.errors.MrworkWarning, match="velocity is off"):
        folded = mr.motions.resampled(fast, 0.02)
    assert np.abs(folded.acceleration[inner]).max() > 0.9


def test_a_coarser_grid_of_a_record_that_it_holds_is_silent() -> None:
    for motion in (
        MOTION,
        mr.synthetic_motion(duration=5.0, dt=0.005),
        mr.motions.sine(amplitude=1.0, frequency=2.0, cycles=8.0, dt=0.002),
    ):
        assert mr.motions.resampled(motion, 2.0 * motion.dt).n_time == (motion.n_time + 1) // 2


def test_jitter_of_the_clock_moves_no_sample() -> None:
    jitter = 1e-6 * np.random.default_rng(3).standard_normal(200)
    motion = columns(0.01 * np.arange(200) + jitter, np.arange(200.0))
    assert motion.dt == pytest.approx(0.01, rel=1e-4)
    assert_allclose(motion.acceleration, np.arange(200.0), rtol=0)
    assert motion.changes == ()


def test_times_written_to_few_digits_are_one_step() -> None:
    motion = columns(np.round(np.arange(301) / 60.0, 3), np.arange(301.0))
    assert motion.dt == pytest.approx(1.0 / 60.0, rel=1e-3)
    assert_allclose(motion.acceleration, np.arange(301.0), rtol=0)
    assert "taken as uniform" in motion.changes[0]


def test_steps_of_other_lengths_are_read_off_straight_lines() -> None:
    time = np.delete(0.01 * np.arange(200), [50, 51, 120])
    motion = columns(time, 7.0 * time)
    assert motion.n_time == 200
    assert_allclose(motion.acceleration, 0.07 * np.arange(200), atol=1e-12)
    assert "steps that differ: 2, by up to +0.02 s" in motion.changes[0]


def test_a_long_pause_at_the_end_is_padding_only_if_it_is_zero() -> None:
    time = np.append(0.02 * np.arange(100), 600.0)
    assert columns(time, np.append(np.ones(100), 0.0)).n_time == 100
    refusal(columns, time, np.ones(101), match="gap")


@pytest.mark.parametrize(
    ("change", "options", "word"),
    [
        (mr.motions.scaled, {"factor": 0.0}, "scaled by 0"),
        (mr.motions.trimmed, {"start": 9.0}, "from 9 to inf s"),
        (mr.motions.trimmed, {"start": 2.0, "end": 1.0}, "from 2 to 1 s"),
        (mr.motions.resampled, {"dt": 6.0}, "every 6.0 s"),
    ],
)
def test_what_cannot_be_done_is_refused(
    change: Callable[..., object], options: dict[str, float], word: str
) -> None:
    refusal(change, MOTION, **options, match=word)


def test_nothing_cannot_be_scaled_to_a_peak() -> None:
    refusal(
        mr.motions.scaled_to_peak,
        mr.GroundMotion(name="a", dt=0.1, acceleration=np.zeros(9)),
        1.0,
        match="zero",
    )
