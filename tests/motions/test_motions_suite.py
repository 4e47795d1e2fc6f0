"""Suites of synthetic motions: strata, reproducibility, plausible motions; near-fault pulses and envelopes."""

from collections import Counter

import numpy as np
import pytest

import mrwork as mr
from mrwork.motions.ground_motion import brought_to_rest, is_copy

WHOLE = mr.motions.suite(n=24, rng=3)


def energy_times(motion: mr.GroundMotion) -> tuple[float, float]:
    """Times of 5 and 95 % of the integral of the squared acceleration [s]."""
    share = np.cumsum(motion.acceleration**2)
    first, last = np.searchsorted(share / share[-1], [0.05, 0.95])
    return motion.dt * float(first), motion.dt * float(last)


def test_every_stratum_has_equally_many_motions() -> None:
    counts = Counter(motion.groups for motion in WHOLE)
    assert len(counts) == 6
    assert set(counts.values()) == {4}
    assert len({motion.name for motion in WHOLE}) == 24
    assert Counter(motion.groups[1] for motion in mr.motions.suite("soft", 5, rng=0)) == {
        "no pulse": 3,
        "near-fault pulse": 2,
    }
    assert {motion.groups[1] for motion in mr.motions.suite("soft", 3, rng=0, pulses="with")} == {
        "near-fault pulse"
    }


def test_a_suite_has_the_same_bits_for_its_seed_and_others_for_another() -> None:
    again, other = mr.motions.suite(n=24, rng=3), mr.motions.suite(n=24, rng=4)
    for one, same, another in zip(WHOLE, again, other, strict=True):
        assert np.array_equal(one.acceleration, same.acceleration)
        assert (one.name, one.source) == (same.name, same.source)
        assert one.source != another.source
    generated = [mr.motions.suite("firm", 2, rng=np.random.default_rng(5)) for _ in range(2)]
    assert np.array_equal(generated[0][1].acceleration, generated[1][1].acceleration)


def test_a_motion_does_not_depend_on_how_many_others_are_drawn() -> None:
    by_name = {motion.name: motion for motion in WHOLE}
    for motion in (*mr.motions.suite("firm", 4, rng=3), *mr.motions.suite(("soft", "medium"), 6, rng=3)):
        assert np.array_equal(motion.acceleration, by_name[motion.name].acceleration)


@pytest.mark.parametrize("motion", WHOLE, ids=lambda motion: motion.name)
def test_a_motion_of_a_suite_is_plausible(motion: mr.GroundMotion) -> None:
    # At rest before and after, up to the rounding of the integrals.
    assert motion.velocity[-1] == pytest.approx(0.0, abs=1e-12)
    assert motion.displacement[-1] == pytest.approx(0.0, abs=1e-11)
    assert abs(motion.acceleration[0]) < 0.02 * motion.peak
    assert abs(motion.acceleration[-1]) < 0.1 * motion.peak
    assert 0.03 < motion.peak / 9.80665 < 1.0
    first, last = energy_times(motion)
    assert 2.0 < last - first < 40.0
    assert motion.duration < 90.0


def test_a_softer_soil_moves_more_slowly_and_a_pulse_is_fast() -> None:
    motions = (*mr.motions.suite(n=48, rng=8), *mr.motions.suite("rock", 16, rng=8))

    def mean_velocity(group: str) -> float:
        found = [np.abs(each.velocity).max() / each.peak for each in motions if group in each.groups]
        return float(np.median(found))

    assert (
        mean_velocity("rock")
        < mean_velocity("firm soil")
        < mean_velocity("medium soil")
        < mean_velocity("soft soil")
    )
    assert mean_velocity("no pulse") < mean_velocity("near-fault pulse")


def test_the_suite_scales_to_a_peak_and_prefixes_names() -> None:
    (motion,) = mr.motions.suite("medium", 1, rng=0, peak=2.0, name="Training")
    assert motion.peak == pytest.approx(2.0, rel=1e-12)
    assert motion.name == "Training, medium 1"


def test_the_velocity_of_a_near_fault_pulse_is_its_formula() -> None:
    period, cycles, phase, amplitude = 2.0, 1.7, 0.6, 0.8
    pulse = mr.motions.near_fault_pulse(
        amplitude=amplitude, period=period, cycles=cycles, phase=phase, dt=0.001
    )
    t = pulse.time - 0.5 * pulse.duration
    w = 2.0 * np.pi / period
    wanted = 0.5 * amplitude * (1.0 + np.cos(w * t / cycles)) * np.cos(w * t + phase)
    # Trapezoids of 1 ms: the error is h^2 / 12 times the second derivative of the acceleration.
    assert pulse.velocity == pytest.approx(wanted, abs=1e-5)
    assert pulse.duration == pytest.approx(cycles * period, abs=1e-9)


def test_the_energy_of_a_gamma_envelope_has_its_duration() -> None:
    envelope = mr.motions.GammaEnvelope(significant_duration=12.0, shape=4.0)
    time = np.arange(0.0, 80.0, 1e-3)
    share = np.cumsum(envelope.at(time) ** 2)
    first, half, last = 1e-3 * np.searchsorted(share / share[-1], [0.05, 0.5, 0.95])
    assert last - first == pytest.approx(12.0, abs=0.01)
    assert half == pytest.approx(envelope.time_of(0.5), abs=0.01)
    assert envelope.at(time).max() == pytest.approx(1.0, abs=1e-6)


def test_a_motion_is_brought_to_rest_by_a_slow_correction() -> None:
    moved = mr.motions.sine(amplitude=1.0, frequency=1.0, cycles=10.25)
    rest = brought_to_rest(moved)
    assert abs(moved.velocity[-1]) > 0.1
    assert rest.velocity[-1] == pytest.approx(0.0, abs=1e-12)
    assert rest.displacement[-1] == pytest.approx(0.0, abs=1e-11)
    correction = moved.acceleration - rest.acceleration
    assert np.abs(correction).max() < 0.1
    assert (correction[0], correction[-1]) == pytest.approx((0.0, 0.0), abs=1e-15)


def test_a_copy_is_found_whatever_was_done_to_it() -> None:
    for motion in (WHOLE[0], WHOLE[13], WHOLE[23]):
        for copy in (
            mr.motions.scaled(motion, -0.2),
            mr.motions.trimmed(motion, start=2.0, end=0.8 * motion.duration),
            mr.motions.baseline_corrected(motion, order=3),
            mr.motions.resampled(motion, 0.005),
            mr.motions.time_scaled(motion, 0.2),
        ):
            assert is_copy(motion, copy), copy.changes
            assert is_copy(copy, motion), copy.changes


def test_different_motions_of_a_suite_are_no_copies() -> None:
    others = mr.motions.suite(n=24, rng=4)
    assert not any(is_copy(one, other) for one in WHOLE[::3] for other in others)
