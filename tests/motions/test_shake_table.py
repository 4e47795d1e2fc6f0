"""A shake table follows as its low-pass does, and refuses or scales what is beyond its limits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from refusals import refusal

from mrwork.motions import GroundMotion, ShakeTable, scaled, sine, synthetic_motion
from mrwork.motions.synthetic import near_fault_pulse

# Nothing binds.
FREE = ShakeTable(stroke=1e3, velocity=1e3, acceleration=1e3)


def amplitude_after(table: ShakeTable, frequency: float) -> float:
    """Steady amplitude of the given motion over that of a commanded sinusoid."""
    given = table.driven(sine(amplitude=1.0, frequency=frequency, cycles=40.0, dt=1.0 / (200.0 * frequency)))
    late = given.time > 20.0 / frequency
    angle = 2.0 * np.pi * frequency * given.time[late]
    shapes = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return float(np.hypot(*np.linalg.lstsq(shapes, given.acceleration[late])[0]))


@pytest.mark.parametrize(("frequency", "damping"), [(25.0, 0.3), (25.0, 0.9), (3.0, 0.7), (60.0, 0.7)])
def test_a_sinusoid_is_given_with_the_gain_of_its_frequency(frequency: float, damping: float) -> None:
    table = ShakeTable(stroke=1e3, velocity=1e3, acceleration=1e3, bandwidth=25.0, damping=damping)
    ratio = frequency / table.bandwidth
    gain = 1.0 / abs(1.0 - ratio**2 + 2j * damping * ratio)
    # Straight lines between 200 samples of a period are smaller than the sinusoid by 8e-5.
    assert amplitude_after(table, frequency) == pytest.approx(gain, rel=1e-3)


def test_a_step_is_followed_as_the_closed_form_has_it() -> None:
    given = FREE.driven(GroundMotion(name="step", dt=0.02, acceleration=np.ones(26)))
    w, zeta = 2.0 * np.pi * FREE.bandwidth, FREE.damping
    angle = w * np.sqrt(1.0 - zeta**2) * given.time
    tail = np.exp(-zeta * w * given.time) * (np.cos(angle) + zeta / np.sqrt(1.0 - zeta**2) * np.sin(angle))
    # The record is exact at its samples, whatever its step.
    assert_allclose(given.acceleration, 1.0 - tail, rtol=0, atol=1e-12)


def test_a_slow_command_is_followed_late_by_the_delay_of_the_filter() -> None:
    command = near_fault_pulse(amplitude=0.3, period=2.0, dt=0.001)
    given = FREE.driven(command)
    late = np.interp(given.time - FREE.damping / (np.pi * FREE.bandwidth), command.time, command.acceleration)
    assert_allclose(given.acceleration, late, atol=2e-4)


def test_following_is_linear_and_keeps_the_length() -> None:
    motion = synthetic_motion(duration=5.0)
    given = FREE.driven(motion)
    assert given.duration == pytest.approx(motion.duration)
    assert given.dt <= 1.0 / (32.0 * FREE.bandwidth)
    assert_allclose(FREE.driven(scaled(motion, -2.0)).acceleration, -2.0 * given.acceleration, rtol=1e-12)


@pytest.mark.parametrize(
    ("limit", "table"),
    [
        ("stroke", ShakeTable(stroke=0.01, velocity=1e3, acceleration=1e3)),
        ("velocity", ShakeTable(stroke=1e3, velocity=0.05, acceleration=1e3)),
        ("acceleration", ShakeTable(stroke=1e3, velocity=1e3, acceleration=0.5)),
    ],
)
def test_a_motion_beyond_a_limit_is_refused_or_scaled_to_it(limit: str, table: ShakeTable) -> None:
    motion = synthetic_motion(duration=5.0, peak=3.0)
    taken = table.demand(motion)
    assert taken.limit == limit
    assert not taken.within
    assert taken.share == pytest.approx(getattr(taken, limit) / getattr(table, limit))
    refusal(table.driven, motion, match=f"takes a {limit}")
    given = table.driven(motion, beyond="scale")
    assert limit in given.changes[-1]
    left = FREE.demand(motion)
    assert_allclose(given.peak, left.acceleration / taken.share, rtol=1e-12)


def test_the_factor_of_a_refusal_is_accepted_and_hardly_more() -> None:
    table, motion = ShakeTable(stroke=0.02), synthetic_motion(duration=5.0, peak=3.0)
    said = str(refusal(table.driven, motion, match="scale the motion by"))
    factor = float(said.split("scale the motion by ")[1].split()[0])
    table.driven(scaled(motion, factor))
    refusal(table.driven, scaled(motion, 1.02 * factor), match="stroke")


def test_what_is_within_the_limits_is_not_scaled() -> None:
    motion = synthetic_motion(duration=5.0, peak=0.2)
    table = ShakeTable()
    assert table.demand(motion).within
    np.testing.assert_array_equal(
        table.driven(motion, beyond="scale").acceleration, FREE.driven(motion).acceleration
    )
