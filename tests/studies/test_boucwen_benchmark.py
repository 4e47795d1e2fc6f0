"""The Bouc-Wen benchmark study on a system that an independent method has integrated finely."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import measured_data
import numpy as np
import pytest
from command_line import ran
from scipy.integrate import solve_ivp

from studies.boucwen_benchmark.multisine import (
    INTERPOLATIONS,
    between_samples,
    newmark,
    random_multisine,
    stage_table,
)
from studies.boucwen_benchmark.oscillator import (
    Parameters,
    Period,
    Scales,
    fitted,
    linear_fit,
    screened_minima,
    steady_period,
)

TRUE = Parameters(m=2.0, c=10.0, k=5e4, alpha=5e4, g=800.0, d=-1100.0, nu=1.0)
DT = 1.0 / 750.0
N_TIME = 1024


def rms(signal: np.ndarray) -> float:
    return float(np.sqrt(np.mean(signal**2)))


@pytest.fixture(scope="module")
def force() -> np.ndarray:
    return random_multisine(N_TIME, DT, band=(5.0, 150.0), rms=50.0, rng=np.random.default_rng(3))


@pytest.fixture(scope="module")
def displacement(force: np.ndarray) -> np.ndarray:
    """A steady period by an eighth-order method of its own step, the force summed from its Fourier series."""
    omega = 2.0 * np.pi * np.fft.rfftfreq(N_TIME, DT)
    amplitude = 2.0 * np.fft.rfft(force) / N_TIME
    lines = np.abs(amplitude) > 1e-9
    omega, amplitude = omega[lines], amplitude[lines]

    def rate(t: float, state: np.ndarray) -> list[float]:
        y, v, z = state
        u = float(np.sum((amplitude * np.exp(1j * omega * t)).real))
        p = TRUE
        hysteretic = p.alpha * v - p.g * abs(v) * z - p.d * v * abs(z)
        return [v, (u - p.c * v - p.k * y - z) / p.m, hysteretic]

    time = DT * np.arange(-N_TIME // 2, N_TIME)
    solved = solve_ivp(
        rate, (time[0], time[-1]), np.zeros(3), t_eval=time, method="DOP853", rtol=1e-8, atol=1e-10
    )
    return solved.y[0, N_TIME // 2 :]


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_every_interpolation_passes_through_the_samples(force: np.ndarray, interpolation: str) -> None:
    np.testing.assert_allclose(between_samples(force, 4, interpolation)[::4], force, atol=1e-11)
    stages = stage_table(force, 3, interpolation)
    np.testing.assert_array_equal(stages[:, -1], np.roll(stages[:, 0], -1))


def test_a_band_limited_force_decides_the_accuracy(force: np.ndarray, displacement: np.ndarray) -> None:
    error = {
        name: rms(np.asarray(steady_period(TRUE, stage_table(force, 8, name), DT)) - displacement)
        for name in INTERPOLATIONS
    }
    # The kinks of |v| leave an error of the second order in the sub-step, 1e-4 of the displacement here.
    assert error["band-limited"] < 2e-4 * rms(displacement)
    assert error["cubic"] < 4e-4 * rms(displacement)
    assert error["linear"] > 20.0 * error["cubic"]


def test_newmark_agrees_and_converges_at_second_order(force: np.ndarray, displacement: np.ndarray) -> None:
    coarse, fine = (rms(newmark(TRUE, force, DT, factor=factor) - displacement) for factor in (10, 20))
    assert fine < 4e-4 * rms(displacement)
    assert coarse / fine == pytest.approx(4.0, rel=0.2)


def test_a_linear_oscillator_is_found_exactly(force: np.ndarray) -> None:
    omega = 2.0 * np.pi * np.fft.rfftfreq(N_TIME, DT)
    response = 1.0 / (-2.0 * omega**2 + 10j * omega + 1e5)
    linear = linear_fit(force, np.fft.irfft(response * np.fft.rfft(force), N_TIME), DT)
    assert linear == pytest.approx((2.0, 10.0, 1e5), rel=1e-10)


def test_the_parameters_are_recovered_from_random_starts(force: np.ndarray, displacement: np.ndarray) -> None:
    noise = 1e-6
    scales = Scales(linear=linear_fit(force, displacement, DT), displacement=rms(displacement))
    period = Period(stage_table(force, 4, "band-limited"), displacement, noise, DT)
    minima = screened_minima(period, scales, rng=np.random.default_rng(1), n_screened=16, n_descents=2)
    assert minima[0].misfit == pytest.approx(minima[1].misfit, rel=1e-3)
    # No noise was added: what is left, and the bias of the parameters, is the error of 4 sub-steps.
    assert minima[0].misfit * noise < 1e-3 * rms(displacement)
    fit = fitted(period, scales, minima[0])
    np.testing.assert_allclose(fit.parameters, TRUE, rtol=5e-3)
    assert all(error > 0.0 for error in fit.standard_errors)


def test_without_the_record_the_study_says_what_to_do(tmp_path: Path) -> None:
    study = measured_data.ROOT / "studies" / "boucwen_benchmark" / "study.py"
    result = ran(sys.executable, study, env=os.environ | {"MRWORK_DATA": str(tmp_path)})
    assert result.returncode == 0, result.stderr
    assert "MRWORK_DATA" in result.stdout
