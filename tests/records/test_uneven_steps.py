"""Samples at unequal steps: the velocity, what is compared, and what is told of rates and of a mean that was taken."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import codes, message

import mrwork as mr
from mrwork.files.grid import grid
from mrwork.records.damper_test import range_of_test
from mrwork.records.repairs import repair

Floats = NDArray[np.float64]
OMEGA = 2.0 * np.pi * 1.3
EVEN = 5e-3 * np.arange(3000)


def at_random(rng: np.random.Generator) -> Floats:
    time = np.cumsum(rng.exponential(5e-3, 3000))
    return time[np.r_[True, np.diff(time) > 1e-5]]


TIMES: dict[str, Callable[[np.random.Generator], Floats]] = {
    "intervals at random": at_random,
    "three in ten lost": lambda rng: EVEN[rng.random(EVEN.size) > 0.3],
    "a gap": lambda _: EVEN[(EVEN < 6.0) | (EVEN > 6.5)],
    "two rates": lambda _: np.r_[0.01 * np.arange(1200), 12.0 + 0.05 * np.arange(400)],
}


def uneven(time: Floats, noise: float = 1e-5) -> mr.records.DamperTest:
    """A dashpot with friction; the displacement has noise."""
    velocity = 0.01 * OMEGA * np.cos(OMEGA * time)
    displacement = 0.01 * np.sin(OMEGA * time) + noise * np.random.default_rng(7).standard_normal(time.size)
    return mr.test_from_arrays(time, displacement, 2000.0 * velocity + 500.0 * np.tanh(velocity / 5e-3))


@pytest.mark.parametrize("kind", TIMES)
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_the_velocity_is_that_of_the_samples_as_they_are(kind: str, noise: float) -> None:
    """Own local cubics over such samples, with the window that suits them best, are .1 mm/s off; splines 1 to 5."""
    test = uneven(TIMES[kind](np.random.default_rng(1)), noise)
    true = 0.01 * OMEGA * np.cos(OMEGA * test.time)
    compared = np.zeros(test.n_time, dtype=bool)
    compared[test.counted] = True
    off = np.sqrt(np.mean((test.velocity - true)[compared] ** 2))
    assert off < (0.35e-3 if noise == 0.0 else 0.25e-3)
    assert test.n_counted > (0.45 if kind == "two rates" else 0.9) * test.n_time


def test_a_change_of_the_rate_is_told_and_no_gap() -> None:
    time = TIMES["two rates"](np.random.default_rng(1))
    assert grid(time).rates == ((0, pytest.approx(0.01)), (1200, pytest.approx(0.05)))
    test = uneven(time)
    assert codes(test)[:2] == ["rate_changes", "velocity_derived"]
    assert "is 100 Hz, and from 12 s on 20 Hz; resampled every 10 ms" in message(test, "rate_changes")
    # In the slow part one of five is a sample.
    assert test.n_counted == pytest.approx(1600 - test.n_settle, abs=20)


@pytest.mark.parametrize("kind", ["intervals at random", "three in ten lost", "a gap"])
def test_other_uneven_steps_are_no_change_of_the_rate(kind: str) -> None:
    assert len(grid(TIMES[kind](np.random.default_rng(1))).rates) == 1


def sine(cycles: float, *, centred: bool, digits: int) -> mr.records.DamperTest:
    time = np.arange(0.0, cycles / 1.3, 2e-3)
    phase = OMEGA * time + 0.4
    velocity = 0.01 * OMEGA * np.cos(phase)
    force = 700.0 * np.tanh(velocity / 5e-3) + 3000.0 * velocity
    force += np.random.default_rng(0).normal(0.0, 2.0, time.size)
    force = np.round(force - centred * force.mean(), digits)
    return mr.test_from_arrays(time, 0.01 * np.sin(phase), force)


@pytest.mark.parametrize("digits", [2, 6, 15])
def test_a_mean_over_cycles_that_are_not_whole_is_told(digits: int) -> None:
    test = sine(10.5, centred=True, digits=digits)
    (said,) = [remark for remark in test.remarks if remark.code == "force_centred"]
    # The mean over half a cycle more than ten whole ones, as it was subtracted.
    time = np.arange(0.0, 10.5 / 1.3, 2e-3)
    velocity = 0.01 * OMEGA * np.cos(OMEGA * time + 0.4)
    taken = np.mean(700.0 * np.tanh(velocity / 5e-3) + 3000.0 * velocity)
    assert said.measured is not None
    assert said.measured.value == pytest.approx(-taken, rel=0.05)
    repaired, _ = repair(test, ["offset"])
    assert "force_centred" not in codes(repaired)


@pytest.mark.parametrize(("cycles", "centred"), [(10.0, True), (10.5, False)])
def test_whole_cycles_and_a_force_as_measured_are_not_asked_about(cycles: float, centred: bool) -> None:
    assert "force_centred" not in codes(sine(cycles, centred=centred, digits=6))


def test_a_test_far_slower_than_the_others_is_not_called_mislabelled() -> None:
    """Friction and a dashpot: no power of the velocity joins a slow test to fast ones."""
    tests = []
    rng = np.random.default_rng(1)
    for current, yielding, dashpot in ((0.0, 40.0, 900.0), (0.5, 450.0, 1600.0), (1.0, 740.0, 2000.0)):
        for amplitude, frequency in ((5, 1.0), (5, 2.5), (10, 1.0), (10, 2.5), (15, 1.0), (15, 2.5)):
            omega = 2.0 * np.pi * frequency
            time = np.arange(0.0, 4.0 / frequency, 2e-3)
            velocity = 1e-3 * amplitude * omega * np.cos(omega * time)
            force = yielding * np.tanh(velocity / 2e-3) + dashpot * velocity + rng.normal(0.0, 0.5, time.size)
            stroke = 1e-3 * amplitude * np.sin(omega * time)
            tests.append(
                mr.test_from_arrays(
                    time,
                    stroke,
                    force,
                    velocity=velocity,
                    current=current,
                    name=f"{amplitude} mm {frequency} Hz",
                )
            )
    assert not [remark.code for remark in mr.records.remarks.remarks_of_set(tests)]


@pytest.mark.parametrize("pause", [0.4, 0.8])
@pytest.mark.parametrize("begin", [0.0, 0.13])
def test_a_gap_ends_what_is_differentiated_and_makes_no_slow_cycle(pause: float, begin: float) -> None:
    """Five bursts of three cycles of 1 Hz; samples beside a gap were half the peak velocity off, and compared."""
    own = 5e-3 * np.arange(600)
    time = np.concatenate([burst * (3.0 + pause) + own for burst in range(5)])
    phase = 2.0 * np.pi * (np.tile(own, 5) + begin)
    velocity = 0.02 * np.pi * np.cos(phase)
    displacement = 0.01 * np.sin(phase) + 1e-6 * np.random.default_rng(1).standard_normal(time.size)
    test = mr.test_from_arrays(time, displacement, 2000.0 * velocity + 400.0 * np.tanh(velocity / 5e-3))
    rows = np.searchsorted(time + 1e-6, test.time[test.counted])
    assert np.abs(time[rows] - test.time[test.counted]).max() < 1e-6
    off = np.abs(test.velocity[test.counted] - velocity[rows])
    # At the ends of a burst polynomials have one side.
    assert off.max() < 0.3e-3
    ranges = range_of_test(test, None)
    assert ranges.frequency == pytest.approx((1.0, 1.0), rel=0.02)
    assert ranges.velocity == pytest.approx(0.02 * np.pi, rel=0.02)
    assert ranges.stroke == pytest.approx(0.01, rel=0.01)
