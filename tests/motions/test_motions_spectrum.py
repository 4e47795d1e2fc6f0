"""The response spectrum is exact for piecewise linear acceleration."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import StateSpace, lsim

import mrwork as mr

PERIODS = np.array([0.03, 0.1, 0.35, 1.0, 2.5, 6.0])
MOTION = mr.synthetic_motion(duration=12.0)


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.2, 0.7])
def test_a_step_of_acceleration_overshoots_as_the_closed_form_says(damping: float) -> None:
    step = mr.GroundMotion(name="step", dt=0.005, acceleration=np.ones(4001))
    spectrum = mr.response_spectrum(step, PERIODS, damping=damping)
    overshoot = 1.0 + np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
    # The peak is between samples: 64 points per period find it within 1 - cos(pi / 64).
    assert_allclose(spectrum.pseudo_acceleration, overshoot, rtol=1.3e-3)
    assert (spectrum.pseudo_acceleration <= overshoot * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.4])
def test_peaks_agree_with_scipy_on_a_fine_grid(damping: float) -> None:
    motion = mr.motions.trimmed(MOTION, end=4.0)
    spectrum = mr.response_spectrum(motion, PERIODS, damping=damping)
    fine = mr.motions.resampled(motion, motion.dt / 40)
    for period, *ours in zip(
        PERIODS, spectrum.displacement, spectrum.velocity, spectrum.acceleration, strict=True
    ):
        w = 2.0 * np.pi / period
        rows = np.array([[1.0, 0.0], [0.0, 1.0], [-w * w, -2.0 * damping * w]])
        system = StateSpace(
            [[0.0, 1.0], [-w * w, -2.0 * damping * w]], [[0.0], [-1.0]], rows, np.zeros((3, 1))
        )
        _, responses, _ = lsim(system, fine.acceleration, fine.time)
        assert_allclose(ours, np.abs(responses).max(axis=0), rtol=1.5e-3)


def test_a_finer_grid_of_the_same_motion_has_the_same_spectrum() -> None:
    coarse, fine = (
        mr.response_spectrum(motion, PERIODS) for motion in (MOTION, mr.motions.resampled(MOTION, 0.00125))
    )
    for name in ("displacement", "velocity", "acceleration"):
        assert_allclose(getattr(coarse, name), getattr(fine, name), rtol=1.3e-3)


def test_stiff_oscillators_feel_the_peak_of_the_ground_and_soft_ones_its_displacement() -> None:
    spectrum = mr.response_spectrum(MOTION, [1e-4, 0.02, 3000.0])
    # The response of period T to linear pieces of slope s differs by the order of s T / (2 pi).
    assert spectrum.acceleration[0] == pytest.approx(MOTION.peak, rel=1e-2)
    assert spectrum.displacement[2] == pytest.approx(np.abs(MOTION.displacement).max(), rel=1e-2)
    assert spectrum.velocity[2] == pytest.approx(np.abs(MOTION.velocity).max(), rel=1e-2)


def test_the_spectrum_scales_with_amplitude_and_time() -> None:
    spectrum = mr.response_spectrum(MOTION, PERIODS)
    assert_allclose(
        mr.response_spectrum(mr.motions.scaled(MOTION, -3.0), PERIODS).displacement,
        3.0 * spectrum.displacement,
        rtol=1e-12,
    )
    fast = mr.response_spectrum(mr.motions.time_scaled(MOTION, 0.2), 0.2 * PERIODS)
    assert_allclose(fast.acceleration, spectrum.acceleration, rtol=1e-9)


def test_without_damping_pseudo_and_absolute_acceleration_are_one() -> None:
    spectrum = mr.response_spectrum(MOTION, PERIODS, damping=0.0)
    assert_allclose(spectrum.pseudo_acceleration, spectrum.acceleration, rtol=1e-12)
    assert_allclose(
        spectrum.pseudo_velocity * 2.0 * np.pi / PERIODS, spectrum.pseudo_acceleration, rtol=1e-12
    )


def test_periods_do_not_influence_each_other() -> None:
    together = mr.response_spectrum(MOTION, PERIODS)
    alone = [mr.response_spectrum(MOTION, period).displacement[0] for period in PERIODS]
    assert_allclose(together.displacement, alone, rtol=1e-13)
