"""A lag of the force channel that tests at several frequencies have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.records import DamperTest, Observation

SPEC = mr.damper("static_hysteretic")
DAMPING = SPEC.names.index("c")
DT = 4e-3
LAG = 0.012
MOTIONS = ((0.015, 0.5), (0.008, 1.0), (0.003, 3.0))


def recorded(motion: tuple[float, float], observation: Observation, rng: int) -> DamperTest:
    """Four cycles of a static hysteresis, the last three through the observation as recorded, with noise of 6 N."""
    amplitude, frequency = motion
    omega = 2.0 * np.pi * frequency
    time = DT * np.arange(round(4.0 / (frequency * DT)) + 1)
    displacement, velocity = amplitude * np.sin(omega * time), amplitude * omega * np.cos(omega * time)
    force = mr.simulate_force(
        SPEC, SPEC.nominal, mr.Loading(dt=DT, displacement=displacement, velocity=velocity)
    )
    force = observation.observe(force, DT) + 6.0 * np.random.default_rng(rng).standard_normal(time.size)
    kept = slice(round(1.0 / (frequency * DT)), None)
    return mr.test_from_arrays(
        name=f"{1e3 * amplitude:g} mm {frequency:g} Hz",
        time=time[kept] - time[kept][0],
        displacement=displacement[kept],
        velocity=velocity[kept],
        force=force[kept],
    )


def rig(observation: Observation) -> list[DamperTest]:
    return [recorded(motion, observation, rng) for rng, motion in enumerate(MOTIONS)]


def advice(fit: mr.Fit) -> list[str]:
    return [each for each in fit.warnings if "against the model" in each]


def test_a_lag_that_all_tests_have_is_told_with_the_option_that_gives_the_damping_back() -> None:
    late = rig(Observation(lag_seconds=LAG))
    fit = mr.identify(SPEC, late, threads=1)
    (sentence,) = advice(fit)
    value, _, error = sentence.partition("lag of ")[2].partition(" ms")[0].partition(" +- ")
    assert abs(float(value) - 1e3 * LAG) < 3.0 * float(error) < 0.5 * 1e3 * LAG
    option = sentence.partition("--observe ")[2].split()[0]
    taken = mr.identify(SPEC, late, observe=[option], threads=1)
    true = SPEC.nominal[DAMPING]
    assert abs(taken.theta[DAMPING] - true) < 0.25 * abs(fit.theta[DAMPING] - true)
    assert not advice(taken)


@pytest.mark.parametrize("frequencies", [1, 3])
def test_a_channel_that_is_on_time_is_not_doubted(frequencies: int) -> None:
    fit = mr.identify(SPEC, rig(Observation())[:frequencies], threads=1)
    assert not [each for each in fit.warnings if "against the model" in each or "delay" in each]


def test_damping_at_one_frequency_says_what_an_unknown_delay_would_do() -> None:
    (test,) = rig(Observation())[2:]
    stiff = replace(test, force=test.force + 4e5 * test.displacement)
    (sentence,) = [each for each in mr.identify(SPEC, stiff, threads=1).warnings if "not known" in each]
    assert "a delay of the force of 6.7 ms" in sentence
