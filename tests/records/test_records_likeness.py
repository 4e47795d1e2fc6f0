"""Tests of one motion at one command are recognised, whatever was done to the record; others are not."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest
from numpy.typing import NDArray

import mrwork as mr
from mrwork.records import DamperTest, cut
from mrwork.records.likeness import RecordedMotion, alike_groups, likeness, likest, motion_likeness
from mrwork.store.codec import built

DT = 0.002


def recorded(
    displacement: NDArray[np.float64], *, current: float | NDArray[np.float64] | None = 0.5, seed: int = 0
) -> DamperTest:
    """A damper whose force grows with the command, and a rig with noise."""
    rng = np.random.default_rng(seed)
    velocity = np.gradient(displacement, DT)
    level = 300.0 + 500.0 * (0.5 if current is None else current)
    force = 800.0 * velocity + level * np.tanh(40.0 * velocity) + 2.0 * rng.standard_normal(velocity.size)
    noisy = displacement + 1e-5 * rng.standard_normal(displacement.size)
    time = DT * np.arange(displacement.size)
    return mr.test_from_arrays(
        name=f"test {seed}", time=time, displacement=noisy, force=force, current=current
    )


def sine(
    amplitude: float, frequency: float, *, phase: float = 0.0, seconds: float = 8.0
) -> NDArray[np.float64]:
    time = DT * np.arange(round(seconds / DT))
    return np.asarray(amplitude * np.sin(2.0 * np.pi * frequency * time + phase))


def ramped(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(samples * np.minimum(DT * np.arange(samples.size) / 2.0, 1.0))


def random_motion(seed: int, *, seconds: float = 20.0) -> NDArray[np.float64]:
    """Band-limited to 3 Hz."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft(rng.standard_normal(round(seconds / DT)))
    frequency = np.fft.rfftfreq(round(seconds / DT), DT)
    samples = np.fft.irfft(np.where((frequency > 0.3) & (frequency < 3.0), spectrum, 0.0))
    return np.asarray(0.005 * samples / samples.std())


def smoothed(test: DamperTest, seconds: float) -> DamperTest:
    window = np.full(round(seconds / test.dt), 1.0)
    window /= window.size
    x, force = (np.convolve(each, window, mode="valid") for each in (test.displacement, test.force))
    return mr.test_from_arrays(
        name="smoothed", time=test.dt * np.arange(x.size), displacement=x, force=force, current=test.current
    )


def alike(one: DamperTest, other: DamperTest) -> bool:
    return likeness(RecordedMotion.of(one), RecordedMotion.of(other)) is not None


SINE = recorded(sine(0.01, 1.0))
RANDOM = recorded(random_motion(1))

VERSIONS: dict[str, Callable[[DamperTest], DamperTest]] = {
    "smoothed": lambda test: smoothed(test, 0.05),
    "a part": lambda test: cut(test, start=2.1, end=6.7),
    "every fourth sample": lambda test: cut(test, every=4),
    "in other units of force": lambda test: replace(test, sha256="other", force=1.02 * test.force),
}


@pytest.mark.parametrize(
    "test", [SINE, RANDOM, recorded(ramped(sine(0.01, 1.0)))], ids=["sine", "random", "ramped"]
)
@pytest.mark.parametrize("version", VERSIONS)
def test_versions_of_a_record_are_alike_and_have_its_force(test: DamperTest, version: str) -> None:
    other = VERSIONS[version](test)
    # A part of a record lies within the whole, and the whole has its greater part outside.
    assert alike(other, test)
    if version != "a part":
        assert alike(test, other)
    own, whole = RecordedMotion.of(other), RecordedMotion.of(test)
    assert likest(own, [whole], force="same") is not None
    assert likest(own, [whole], force="other") is None


def test_a_repeated_run_is_alike_with_its_own_noise_and_phase() -> None:
    assert alike(recorded(sine(0.0102, 1.004, phase=2.0), seed=7), SINE)
    assert alike(recorded(random_motion(1), seed=7), RANDOM)
    # Seen with its start-up, tested without, and the other way round.
    started = recorded(ramped(sine(0.01, 1.0)), seed=7)
    assert alike(SINE, started)
    assert alike(started, SINE)


OTHERS = {
    "command": recorded(sine(0.01, 1.0), current=0.6),
    "no command": recorded(sine(0.01, 1.0), current=0.0),
    "amplitude": recorded(sine(0.012, 1.0)),
    "frequency": recorded(sine(0.01, 1.05)),
    "triangle": recorded(0.01 * 2.0 / np.pi * np.arcsin(sine(1.0, 1.0))),
    "harmonic": recorded(sine(0.007, 1.0) + sine(0.004, 3.0)),
    "chirp": recorded(0.01 * np.sin(2.0 * np.pi * (0.5 + 0.2 * DT * np.arange(4000)) * DT * np.arange(4000))),
    "random": recorded(random_motion(2)),
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_other_motions_and_commands_are_not_alike(other: DamperTest) -> None:
    for test in (SINE, RANDOM):
        assert not alike(other, test)
        assert not alike(test, other)


@pytest.mark.parametrize("seconds", [10.0, 40.0])
def test_random_motions_are_told_apart_and_recognised_again(seconds: float) -> None:
    tests = [recorded(random_motion(seed, seconds=seconds), seed=seed) for seed in range(8)]
    motions = [RecordedMotion.of(test) for test in tests]
    assert [len(members) for members in alike_groups(motions)] == [1] * 8
    # From another sample on, averaged over a twentieth of a cycle.
    for test, motion in zip(tests, motions, strict=True):
        again = RecordedMotion.of(smoothed(cut(test, start=0.123), 0.04))
        assert likeness(again, motion) is not None
        assert likeness(motion, again) is not None


def test_unknown_commands_are_told_apart_by_the_force() -> None:
    unknown = recorded(sine(0.01, 1.0), current=None, seed=3)
    assert alike(unknown, SINE)
    assert not alike(unknown, recorded(sine(0.01, 1.0), current=2.0))


@pytest.mark.parametrize("test", [SINE, RANDOM, cut(RANDOM, start=4.0)], ids=["sine", "random", "a part"])
@pytest.mark.parametrize(("gain", "shift"), [(0.7, 0.0), (1.3, 0.0), (1.0, 150.0), (0.85, -100.0)])
def test_the_motion_of_a_test_with_another_force_is_that_of_another_condition(
    test: DamperTest, gain: float, shift: float
) -> None:
    whole = RANDOM if test is not SINE else SINE
    hot = RecordedMotion.of(replace(test, sha256="hot", force=gain * test.force + shift))
    seen = [RecordedMotion.of(whole)]
    assert likest(hot, seen, force="same") is None
    found = likest(hot, seen, force="other")
    assert found is not None
    assert found.force_ratio == pytest.approx(gain, rel=0.02)
    assert found.force_shift == pytest.approx(shift, abs=5.0)
    assert "another condition: temperature, pressure, pre-load?" in found.condition.message
    # Folds keep them together all the same.
    assert likest(hot, seen) is not None


def test_at_an_unknown_command_a_far_larger_force_is_of_another_command_or_condition() -> None:
    unknown = recorded(sine(0.01, 1.0), current=None, seed=3)
    stronger = RecordedMotion.of(replace(unknown, sha256="other", force=2.0 * unknown.force))
    found = likest(stronger, [RecordedMotion.of(unknown)], force="other")
    assert found is not None
    assert "command, temperature" in found.condition.message
    another = RecordedMotion.of(recorded(sine(0.01, 1.0), current=2.0))
    assert likest(another, [RecordedMotion.of(SINE)], force="other") is None


def test_a_varying_command_is_compared_with_the_motion() -> None:
    time = DT * np.arange(10000)
    steps, others = (np.repeat(np.random.default_rng(seed).integers(0, 2, 40), 250) * 1.0 for seed in (1, 2))
    motion = 0.01 * np.sin(2.0 * np.pi * time)
    test = recorded(motion, current=steps)
    assert alike(recorded(motion, current=steps, seed=5), test)
    assert not alike(recorded(motion, current=others, seed=5), test)
    assert not alike(recorded(motion, current=1.0), test)


def test_alike_tests_form_a_group_and_the_closest_is_named() -> None:
    tests = [SINE, RANDOM, smoothed(SINE, 0.05), recorded(sine(0.01, 1.0), current=1.0), cut(RANDOM, every=2)]
    motions = [RecordedMotion.of(test) for test in tests]
    assert alike_groups(motions) == [[0, 2], [1, 4], [3]]
    found = likest(motions[2], motions[:2])
    assert found is not None
    assert found.like == SINE.name
    assert "smoothed has the motion and command of test 0" in found.in_words
    assert likest(motions[3], motions[:3]) is None


def test_an_identical_file_is_alike_whatever_was_cut_from_it() -> None:
    first, last = cut(RANDOM, end=5.0), cut(RANDOM, start=15.0)
    assert alike(first, last)


def test_what_is_stored_is_small_and_survives_json() -> None:
    motion = RecordedMotion.of(RANDOM)
    stored = json.dumps(asdict(motion))
    # Displacement and force of 20 s, three digits each.
    assert len(stored) < 28000
    assert built(RecordedMotion, json.loads(stored)) == motion
    assert max(motion.displacement) == pytest.approx(1e3 * RANDOM.displacement.max(), rel=0.02)


def test_a_ramp_of_the_same_speed_and_twice_the_stroke_is_another_motion() -> None:
    def triangle(stroke: float) -> NDArray[np.float64]:
        # At 10 mm/s, out and back once.
        out = np.arange(0.0, stroke, 0.01 * DT)
        return np.concatenate([out, stroke - out])

    short, long = (RecordedMotion.of(recorded(triangle(stroke), current=None)) for stroke in (0.01, 0.02))
    assert motion_likeness(long, short) is None
    assert likest(short, [short]) is not None
