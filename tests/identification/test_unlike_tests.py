"""Tests of a command on which starting points are searched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrwork.identification.level_search import unlike_tests
from mrwork.records import DamperTest
from mrwork.synthetic import synthetic_test


def sine_test(amplitude: float, frequency: float) -> DamperTest:
    """A test of a sinusoidal motion [m, Hz]; its force does not matter."""
    test = synthetic_test("spencer1997")
    phase = 2.0 * np.pi * frequency * test.dt * np.arange(test.n_time)
    return replace(
        test,
        name=f"{amplitude:g}m {frequency:g}Hz",
        displacement=amplitude * np.sin(phase),
        velocity=2.0 * np.pi * frequency * amplitude * np.cos(phase),
    )


def test_few_tests_are_all_taken() -> None:
    tests = [sine_test(0.01, 1.0), sine_test(0.02, 1.0)]
    assert unlike_tests(tests, 4) == tuple(tests)


def test_the_extremes_of_stroke_and_velocity_are_taken_in_the_order_of_the_tests() -> None:
    middle = [sine_test(0.010, 2.0), sine_test(0.011, 2.0), sine_test(0.009, 2.0)]
    ends = [sine_test(0.001, 20.0), sine_test(0.1, 0.2), sine_test(0.1, 20.0)]
    tests = [middle[0], ends[0], middle[1], ends[1], ends[2], middle[2]]
    assert unlike_tests(tests, 3) == (ends[0], ends[1], ends[2])


def test_of_repeated_motions_each_test_is_taken_once() -> None:
    tests = [replace(sine_test(0.01, 1.0), name=f"repeat {number}") for number in range(5)]
    taken = unlike_tests(tests, 3)
    assert len({test.name for test in taken}) == 3
