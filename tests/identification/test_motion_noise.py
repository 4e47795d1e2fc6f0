"""A fit says where the noise of the motion makes its intervals too narrow, and nothing where it does not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

import mrwork as mr
from mrwork.dampers import damper
from mrwork.records import DamperTest, build_damper_test

MODEL = "viscous_dahl"
SPEC = damper(MODEL)
STEP = 5e-6


def recorded(
    rng: int, *, force: float, displacement: float, velocity: float | str, dt: float = 1e-3
) -> DamperTest:
    """Two cycles of 10 mm at 1 Hz with noise [N, m, m/s]; a velocity by differences of readings in steps of 5 um."""
    time = dt * np.arange(round(2.0 / dt) + 1)
    phase = 2.0 * np.pi * time
    motion = {"displacement": 0.01 * np.sin(phase), "velocity": 0.02 * np.pi * np.cos(phase)}
    exact = mr.simulate_force(SPEC, SPEC.nominal, mr.Loading(dt=dt, **motion))
    noise = np.random.default_rng(rng).standard_normal((3, time.size))
    read = motion["displacement"] + displacement * noise[1]
    if isinstance(velocity, str):
        read = STEP * np.round(read / STEP)
        moving = np.gradient(read, dt)
    else:
        moving = motion["velocity"] + velocity * noise[2]
    return build_damper_test(
        name="rig", time=time, displacement=read, velocity=moving, force=exact + force * noise[0]
    )


def fitted(test: DamperTest) -> mr.Fit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mr.identify(MODEL, test, threads=1)


def says_so(fit: mr.Fit) -> bool:
    return any("noise of the motion dominates" in each for each in fit.warnings)


def held(fit: mr.Fit) -> list[bool]:
    """Whether the 95 % interval of each parameter has the one of the record."""
    return [
        each.standard_error is not None and abs(each.value - true) < 1.96 * each.standard_error
        for each, true in zip(fit.estimates, SPEC.nominal, strict=True)
    ]


@pytest.mark.parametrize("times", [1.0, 3.0])
@pytest.mark.parametrize("velocity", ["differenced", 5e-4])
def test_intervals_hold_or_the_fit_says_that_the_noise_of_the_motion_dominates(
    velocity: float | str, times: float
) -> None:
    own = velocity if isinstance(velocity, str) else times * velocity
    fits = [
        fitted(recorded(rng, force=8.0 * times, displacement=5e-6 * times, velocity=own)) for rng in range(8)
    ]
    silent = [each for fit in fits if not says_so(fit) for each in held(fit)]
    # 90 % of them, less two standard deviations of so few.
    assert not silent or np.mean(silent) > 0.9 - 2.0 * np.sqrt(0.09 / len(silent))
    # Differences are not used, which left f0 alone in its interval.
    if isinstance(velocity, str):
        assert np.mean([each for fit in fits for each in held(fit)]) > 0.7


@examples(3)
@given(rng=st.integers(0, 1000))
def test_a_motion_with_far_more_noise_than_the_force_is_told_and_an_exact_one_is_not(rng: int) -> None:
    assert says_so(fitted(recorded(rng, force=0.5, displacement=5e-6, velocity=5e-4, dt=4e-3)))
    assert not says_so(fitted(recorded(rng, force=20.0, displacement=1e-8, velocity=1e-6, dt=4e-3)))


def test_the_remedy_of_a_measured_velocity_is_its_derivation_and_of_a_derived_one_is_not() -> None:
    test = recorded(3, force=0.5, displacement=5e-6, velocity=5e-4, dt=4e-3)
    derived, _ = mr.records.repair(test, ["velocity"])
    for each, named in ((test, True), (derived, False)):
        (sentence,) = [warning for warning in fitted(each).warnings if "noise of the motion" in warning]
        assert ("--repair velocity" in sentence) == named
        assert "measure the motion with less noise" in sentence


def test_the_check_of_the_motion_counts_no_simulation_and_repeats_itself() -> None:
    test = recorded(5, force=0.5, displacement=5e-6, velocity=5e-4, dt=4e-3)
    one, other = fitted(test), fitted(test)
    assert one.warnings == other.warnings
    assert one.evaluations == other.evaluations
