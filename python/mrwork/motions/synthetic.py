"""Synthetic earthquakes: white noise through soil and envelope, the same for the same seed."""

from __future__ import annotations

import math

import numpy as np

from mrwork.errors import SettingError
from mrwork.motions.envelope import Envelope
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.processing import scaled_to_peak
from mrwork.motions.spectral_density import CloughPenzien, SpectralDensity

# Longest memory of a filter that is run in before the motion begins, in its time constants.
_RUN_IN = 8.0


def synthetic_motion(
    spectrum: SpectralDensity | None = None,
    *,
    rng: np.random.Generator | int = 1940,
    duration: float = 30.0,
    dt: float = 0.01,
    envelope: Envelope | None = None,
    peak: float | None = None,
    name: str = "synthetic",
) -> GroundMotion:
    """Motion drawn from a spectral density; with no argument it is the one of demo and tests.

    White noise up to half the sampling rate goes through the transfer function of the soil, so that a stretch of the
    plateau has the density asked for, without error of a discretisation, and is multiplied by the envelope.

    Parameters
    ----------
    spectrum
        `KanaiTajimi` or `CloughPenzien`; the latter on firm soil by default.
    rng
        Generator, or the seed of one.
    duration, dt
        Length and step [s].
    envelope
        Type B of Jennings by default.
    peak
        Peak ground acceleration [m/s^2] to which the motion is scaled; by default it is as it falls.

    Raises
    ------
    SettingError
        Duration, step or peak is not positive, or the duration is shorter than the step.

    Examples
    --------
    >>> motion = synthetic_motion(peak=3.0)
    >>> motion.n_time, round(motion.peak, 6)
    (3001, 3.0)
    """
    spectrum = CloughPenzien() if spectrum is None else spectrum
    envelope = Envelope() if envelope is None else envelope
    if not (math.isfinite(duration) and 0.0 < dt <= duration):
        raise SettingError(
            f"synthetic motion of {duration} s every {dt} s; give a positive step below the duration"
        )
    seed = f"seed {rng}" if isinstance(rng, int) else "a generator that was passed"
    generator = np.random.default_rng(rng)
    n_time = round(duration / dt) + 1
    n_run_in = math.ceil(_RUN_IN * _memory(spectrum) / dt)
    n_noise = n_time + n_run_in
    # Samples of white noise of two-sided density S0 over circular frequency have the variance 2 pi S0 / dt.
    noise = math.sqrt(2.0 * math.pi * spectrum.intensity / dt) * generator.standard_normal(n_noise)
    w = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n_noise, dt), dtype=np.float64)
    stationary = np.fft.irfft(np.fft.rfft(noise) * spectrum.transfer(w), n_noise)[n_run_in:]
    motion = GroundMotion(
        name=name,
        dt=dt,
        acceleration=stationary * envelope.at(dt * np.arange(n_time, dtype=np.float64)),
        source=f"{spectrum.name} filtered white noise, {seed}",
    )
    return motion if peak is None else scaled_to_peak(motion, peak)


def _memory(spectrum: SpectralDensity) -> float:
    """Longest time constant of the filter [s]."""
    eigenvalues = np.linalg.eigvals(spectrum.filter_matrices().state)
    return float(1.0 / np.abs(eigenvalues.real).min())
