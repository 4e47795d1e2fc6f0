"""A lag of the force channel that tests at several frequencies have in common."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.identification.equivalent import joint_box
from mrwork.identification.identify import identify_from
from mrwork.identification.problem import Problem
from mrwork.records import DamperTest, Observation, build_damper_test

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
    return build_damper_test(
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


def test_the_checks_of_a_fit_do_not_depend_on_how_its_laws_were_found() -> None:
    """A fit from its own minimum, as a choice of laws makes it, says what the search of the same laws says."""
    late = [
        replace(test, force=(1.0 + command) * test.force, current=command, name=f"{test.name} {command} A")
        for test in rig(Observation(lag_seconds=LAG))
        for command in (0.0, 1.0)
    ]
    spec = mr.damper("static_hysteretic").with_current_laws(
        dict.fromkeys(("c", "k", "alpha", "f0"), "values:0,1"), unit="A"
    )
    searched = mr.identify(spec, late, threads=1)
    start = dict(zip(spec.names, searched.theta, strict=True))
    problem = Problem.of(spec, tuple(late), searched.settings)
    again = identify_from(
        spec,
        late,
        replace(searched.settings, starts=(start,)),
        box=joint_box(problem.form, tuple(late), np.array([0.0, 1.0])),
        trace=searched.trace,
        threads=1,
    )
    for said in ("the force is late", "far worse together than alone"):
        assert any(said in each for each in searched.warnings)
    # The two minima agree to rounding, and so do the numbers of the sentences.
    words = [[re.sub(r"[0-9.]+", "", each) for each in fit.warnings] for fit in (searched, again)]
    assert words[0] == words[1]
