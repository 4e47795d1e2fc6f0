"""Synthetic motions have the given density, envelope and seed."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from refusals import refusal

from mrwork.motions import Envelope, KanaiTajimi, sine, synthetic_motion
from mrwork.motions.spectral_density import CloughPenzien, SpectralDensity

SPECTRA = (KanaiTajimi(), KanaiTajimi(frequency=5.0, damping=0.2), CloughPenzien())
FLAT = Envelope(rise=0.0, plateau_end=1e6, decay=0.0)


@pytest.mark.parametrize("spectrum", SPECTRA, ids=lambda spectrum: spectrum.name)
def test_transfer_function_and_state_space_are_one_filter(spectrum: SpectralDensity) -> None:
    matrices = spectrum.filter_matrices()
    w = np.geomspace(0.01, 500.0, 40)
    for frequency in w:
        resolvent = np.linalg.solve(
            1j * frequency * np.eye(len(matrices.noise)) - matrices.state, matrices.noise
        )
        expected = spectrum.transfer(np.array([frequency]))[0]
        assert matrices.output @ resolvent == pytest.approx(expected, rel=1e-9)
    assert_allclose(spectrum.density(w), spectrum.intensity * np.abs(spectrum.transfer(w)) ** 2, rtol=1e-12)


def test_at_the_frequency_of_the_soil_the_density_is_that_of_the_formula() -> None:
    spectrum = KanaiTajimi(frequency=12.0, damping=0.3, intensity=2.0)
    assert spectrum.density(np.array([0.0, 12.0])) == pytest.approx([2.0, 2.0 * (1.0 + 0.36) / 0.36])
    assert CloughPenzien().density(np.array([0.0]))[0] == 0.0


@pytest.mark.parametrize("spectrum", SPECTRA, ids=lambda spectrum: spectrum.name)
def test_drawn_motions_have_the_density(spectrum: SpectralDensity) -> None:
    rng = np.random.default_rng(1957)
    n_draws, dt = 100, 0.02
    motions = [
        synthetic_motion(spectrum, rng=rng, duration=81.9, dt=dt, envelope=FLAT) for _ in range(n_draws)
    ]
    window = np.hanning(motions[0].n_time)
    draws = np.array([np.abs(np.fft.rfft(window * motion.acceleration)) ** 2 for motion in motions])
    # Two-sided in circular frequency; mean over a band of lines, each with chi-squared scatter.
    density = dt * draws.mean(axis=0) / (2.0 * np.pi * (window**2).sum())
    w = 2.0 * np.pi * np.fft.rfftfreq(motions[0].n_time, dt)
    edges = [1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0]
    for low, high in pairwise(edges):
        band = (w >= low) & (w < high)
        # A band has 13 lines or more, of which a Hann window leaves two in three independent: 5 % is 1.5 deviations.
        assert density[band].mean() == pytest.approx(spectrum.density(w[band]).mean(), rel=0.12)


def test_the_same_seed_gives_the_same_bits_and_another_does_not() -> None:
    assert_array_equal(synthetic_motion(rng=3).acceleration, synthetic_motion(rng=3).acceleration)
    assert np.abs(synthetic_motion(rng=3).acceleration - synthetic_motion(rng=4).acceleration).max() > 0.1
    assert "seed 3" in synthetic_motion(rng=3).source


def test_the_default_motion_is_a_moderate_earthquake() -> None:
    motion = synthetic_motion()
    assert (motion.n_time, motion.dt) == (3001, 0.01)
    assert 2.0 < motion.peak < 4.5
    assert motion.acceleration[0] == 0.0
    assert synthetic_motion(peak=0.981).peak == pytest.approx(0.981, rel=1e-14)


def test_the_envelope_rises_stays_and_falls() -> None:
    envelope = Envelope()
    assert_allclose(
        envelope.at(np.array([0.0, 2.0, 4.0, 10.0, 15.0, 25.0])), [0.0, 0.25, 1.0, 1.0, 1.0, np.exp(-0.992)]
    )
    time = np.linspace(0.0, 60.0, 6001)
    assert np.abs(np.diff(envelope.at(time))).max() < 0.0051


def test_pulses_are_what_their_names_say() -> None:
    wave = sine(amplitude=2.0, frequency=5.0, cycles=3.0)
    assert (wave.peak, wave.duration) == (pytest.approx(2.0, rel=1e-5), pytest.approx(0.6))
    assert_allclose(wave.velocity[-1], 0.0, atol=1e-12)


def test_what_the_samples_do_not_hold_is_refused() -> None:
    refusal(sine, amplitude=1.0, frequency=60.0, cycles=9.0, dt=0.01, match="60 Hz.*above 50 Hz")
    refusal(synthetic_motion, duration=0.001, match="step below the duration")
    refusal(Envelope, rise=20.0, match="order")
