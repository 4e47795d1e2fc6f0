"""Which motions are kept for test, and what a fit predicts of them."""

from __future__ import annotations

import numpy as np
import pytest

import mrwork as mr
from mrwork.records import DamperTest
from mrwork.uncertainty.bands.held_out import median_place, uses_of

COMMANDS = (0.0, 0.5, 1.0)


def sinusoid(amplitude: float, frequency: float, current: float) -> DamperTest:
    """A sinusoid of a viscous damper; amplitude in mm."""
    time = np.arange(0.0, 3.0 / frequency, 0.005 / frequency)
    phase = 2.0 * np.pi * frequency * time
    velocity = 2e-3 * np.pi * frequency * amplitude * np.cos(phase)
    return mr.test_from_arrays(
        name=f"{amplitude:g}mm{frequency:g}Hz{current:g}A",
        time=time,
        displacement=1e-3 * amplitude * np.sin(phase),
        velocity=velocity,
        force=(1.0 + current) * 1e3 * velocity + 20.0 * np.sin(3.0 * phase),
        current=current,
    )


def uses(*motions: tuple[float, float]) -> dict[tuple[float, float], str]:
    """The use of each motion, which is that of all its commands."""
    every = [(motion, sinusoid(*motion, current)) for motion in motions for current in COMMANDS]
    found = uses_of([test for _, test in every])
    by_motion: dict[tuple[float, float], set[str]] = {}
    for (motion, _), use in zip(every, found, strict=True):
        by_motion.setdefault(motion, set()).add(use)
    assert all(len(each) == 1 for each in by_motion.values()), "a motion is split"
    return {motion: each.pop() for motion, each in by_motion.items()}


def test_extremes_are_fitted_and_whole_motions_between_them_are_kept() -> None:
    found = uses((25, 0.1), (25, 0.25), (25, 0.5), (10, 1), (5, 3), (2, 5))
    assert {found[25, 0.1], found[2, 5], found[5, 3]} == {"fit"}
    assert sorted(found.values()) == ["calibration", "fit", "fit", "fit", "fit", "test"]


@pytest.mark.parametrize("motions", [[(10, 1)], [(10, 1), (2, 5)]], ids=["one", "extremes"])
def test_where_no_motion_lies_between_others_all_are_fitted(motions: list[tuple[float, float]]) -> None:
    assert set(uses(*motions).values()) == {"fit"}


def test_a_single_motion_between_others_is_kept_for_test() -> None:
    found = uses((20, 0.2), (8, 1), (3, 4))
    assert (found[8, 1], list(found.values()).count("fit")) == ("test", 2)


def test_the_median_of_two_is_the_other() -> None:
    assert [median_place(count) for count in (1, 2, 3, 4, 5)] == [0, 1, 1, 1, 2]
