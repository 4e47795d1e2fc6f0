"""Strokes of constant speed that each go one way: both together tell friction and offset, and a share says nothing."""

from collections.abc import Sequence

import numpy as np
import pytest

import mrwork as mr
from mrwork.identification.result import fit_quality
from mrwork.records.remarks import gathered_remarks, remarks_for, remarks_of_set, strokes_both_ways

FRICTION, DAMPING, OFFSET, NOISE, HALF = 180.0, 900.0, 40.0, 13.5, 0.025


def stroke(speed: float, seed: int = 0, **changed: float) -> mr.DamperTest:
    """A stroke through 50 mm at one speed [m/s], 1000 samples."""
    time = np.linspace(0.0, 2.0 * HALF / abs(speed), 1001)
    force = OFFSET + FRICTION * np.sign(speed) + DAMPING * speed
    noise = np.random.default_rng(seed).normal(0.0, NOISE, time.size)
    displacement = changed.get("centre", 0.0) - HALF * np.sign(speed) + speed * time
    command = np.full(time.size, changed.get("command", 0.5))
    return mr.test_from_arrays(
        time, displacement, np.clip(force + noise, force - 4 * NOISE, force + 4 * NOISE),
        command=command, command_unit="A", name=f"{1e3 * speed:+.0f}",
    )  # fmt: skip


def strokes(*speeds: float, **changed: float) -> list[mr.DamperTest]:
    return [stroke(speed, seed, **changed) for seed, speed in enumerate(speeds)]


def told(tests: Sequence[mr.DamperTest]) -> list[str]:
    return [remark.code for remark in remarks_of_set(tests)]


def test_friction_and_offset_of_both_ways_are_those_of_the_damper() -> None:
    tests = strokes(0.005, -0.005, 0.02, -0.02, 0.08, -0.08)
    (said,) = strokes_both_ways(tests)
    # By hand: half sums and half differences of the mean forces at each speed.
    means = np.array([test.force.mean() for test in tests]).reshape(3, 2)
    slope, friction = np.polyfit([0.005, 0.02, 0.08], 0.5 * (means[:, 0] - means[:, 1]), 1)
    assert said.measured is not None
    assert said.measured.value == pytest.approx(0.5 * means.sum(axis=1).mean(), rel=1e-6)
    assert said.measured.value == pytest.approx(OFFSET, abs=1.0)
    assert f"{friction:.4g} N and {slope:.4g} N s/m" in said.message
    assert friction == pytest.approx(FRICTION, abs=2.0)
    # What one way leaves open is not said of tests whose both ways tell it.
    assert "one_way" in {remark.code for test in tests for remark in test.remarks}
    assert "one_way" not in {remark.code for remark in gathered_remarks(tests).shared}
    codes = [remark.code for remark in remarks_for("identify", tests)]
    assert "strokes_both_ways" in codes
    assert "one_way" not in codes


def test_of_one_speed_what_resists_is_told() -> None:
    (said,) = strokes_both_ways(strokes(0.02, -0.02))
    assert "198" in said.message.split("resist 20 mm/s")[0]


@pytest.mark.parametrize(
    "tests",
    [
        strokes(0.005, 0.02, 0.08),
        # No speed is shown both ways.
        strokes(0.02, -0.08),
        # A spring would make the difference of two places.
        [stroke(0.02), stroke(-0.02, centre=0.02)],
        [stroke(0.02), stroke(-0.02, command=1.0)],
    ],
    ids=["one way", "unlike speeds", "unlike places", "unlike commands"],
)
def test_strokes_that_do_not_tell_it_keep_their_warning(tests: list[mr.DamperTest]) -> None:
    assert "strokes_both_ways" not in told(tests)
    assert "one_way" in {remark.code for remark in remarks_for("check", tests)}


def test_a_fit_in_per_cent_of_a_constant_force_is_not_shown() -> None:
    fit = mr.identify("bingham", strokes(0.005, -0.005, 0.08, -0.08))
    assert fit.rmse_n == pytest.approx(NOISE, rel=0.05)
    assert fit.fit_percent < 5.0
    summary = str(fit)
    assert f"{fit.rmse_n:.4g} N rms" in summary.splitlines()[0]
    assert "%" not in summary.splitlines()[0]
    assert [quality.fit_in_words for quality in fit.quality] == ["-"] * 4
    values = {estimate.name: estimate.value for estimate in fit.fitted}
    found = [values[name] for name in ("f_c", "c0", "f0")]
    assert found == pytest.approx([FRICTION, DAMPING, OFFSET], rel=0.03)


def test_a_stroke_along_a_spring_has_a_share() -> None:
    """Its force goes from -HALF k to HALF k, and a fit is a share of that."""
    time = np.linspace(0.0, 2.5, 1001)
    force = 100.0 + 20e3 * (0.02 * time - HALF)
    test = mr.test_from_arrays(time, 0.02 * time - HALF, force)
    quality = fit_quality(test, force + 1.0, substeps=1)
    assert not quality.constant
    # Counted is the second half: 250 N / sqrt(12) about its mean.
    assert quality.fit_percent == pytest.approx(100.0 * (1.0 - 1.0 / np.std(force[test.counted])))
