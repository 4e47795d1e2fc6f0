"""Errors beyond what derivatives tell, errors of arithmetic, and ratios to no noise are no numbers."""

import re

import numpy as np
import pytest

import mrwork as mr

TIME = np.arange(0.0, 4.0, 0.002)
FAR = re.compile(r"\d{5,} times|e[+]?\d\d times|e-1\d")


def sine(digits: int, frequency: float = 1.0, amplitude: float = 0.01) -> mr.DamperTest:
    """The force of the nominal damper under a sine, without noise but for its rounding to digits."""
    omega = 2.0 * np.pi * frequency
    displacement = amplitude * np.sin(omega * TIME)
    velocity = amplitude * omega * np.cos(omega * TIME)
    spec = mr.damper("normalised_bouc_wen")
    motion = mr.test_from_arrays(TIME, displacement, 1e3 * velocity)
    force = mr.simulate(spec, spec.nominal, motion)
    return mr.test_from_arrays(TIME, displacement, np.round(np.asarray(force), digits))


@pytest.mark.parametrize("digits", [9, 6, 3])
def test_a_record_without_noise_has_the_parameters_and_no_numbers_of_arithmetic(digits: int) -> None:
    fit = mr.identify("normalised_bouc_wen", sine(digits))
    spec = mr.damper("normalised_bouc_wen")
    np.testing.assert_allclose(fit.theta, spec.nominal, rtol=1e-5)
    said = [remark.message for remark in fit.remarks]
    assert not [message for message in said if FAR.search(message)]
    # Noise that nobody recorded moves nothing.
    assert "motion_noise" not in {remark.code for remark in fit.remarks}
    # A mass is told to be open at one frequency, by how much and by how many errors at most.
    (mass,) = (remark for remark in fit.remarks if remark.code == "mass_as_stiffness")
    assert mass.measured is not None
    assert mass.measured.value == 20.0
    assert "more than 1000 times its error" in mass.message
    errors = [estimate.in_words(by_interval=False)[1] for estimate in fit.fitted]
    assert all("e-1" not in error for error in errors)


def test_a_stiffness_of_zero_is_moved_by_no_mass_of_rounding() -> None:
    """A dashpot and friction under sines of two frequencies: of k = 0, any mass is many times the value."""
    tests = []
    for frequency in (1.0, 3.0):
        omega = 2.0 * np.pi * frequency
        displacement, velocity = 0.01 * np.sin(omega * TIME), 0.01 * omega * np.cos(omega * TIME)
        force = 2000.0 * velocity + 100.0 * np.tanh(velocity / 0.005)
        tests.append(mr.test_from_arrays(TIME, displacement, force))
    fit = mr.identify("hyperbolic_tangent_guo", tests)
    masses = [
        remark.measured.value
        for remark in fit.remarks
        if remark.code in ("mass_unknown", "mass_as_stiffness") and remark.measured
    ]
    assert all(mass > 1e-3 for mass in masses)


def test_an_error_of_more_than_a_hundred_values_is_none() -> None:
    """Corners that five samples show leave the knee of a loop open: its errors were 1e5 times the values."""
    time = np.arange(0.0, 10.0, 0.01)
    phase = (0.1 * time * 4.0) % 4.0
    displacement = 0.025 * (np.abs(phase - 2.0) - 1.0)
    velocity = np.where(phase < 2.0, -1.0, 1.0) * 0.025 * 0.4
    noise = np.random.default_rng(0).normal(0.0, 13.5, time.size)
    force = 40.0 + 180.0 * np.sign(velocity) + 900.0 * velocity + noise
    fit = mr.identify("normalised_bouc_wen", mr.test_from_arrays(time, displacement, force))
    for estimate in fit.fitted:
        size = max(abs(estimate.value), 0.5 * (estimate.upper - estimate.lower))
        assert estimate.standard_error is None or estimate.standard_error < 100.0 * size
    assert not FAR.search(str(fit))
    unknown = [estimate for estimate in fit.fitted if estimate.standard_error is None]
    assert unknown
    assert all(estimate.verdict.word not in ("identifiable", "") for estimate in unknown)
