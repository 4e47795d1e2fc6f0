"""What a sampled motion tells: its dominant frequency, its band, and its derivative."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.records.savitzky_golay import savitzky_golay, weights

_ORDER: Final = 3
_BAND_POWER: Final = 0.999
# A cubic Savitzky-Golay derivative over a window of half width m [s] is too small by (omega m)^4 / 504 for
# a sine of angular frequency omega. A window of 0.15 periods (omega m = 0.47) keeps that below 1e-4.
_WINDOW_PERIODS: Final = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Spectrum:
    """Frequency of the largest Fourier component, and the one below which 99.9 % of the power lies [Hz]."""

    dominant: float
    band_edge: float


def spectrum(displacement: NDArray[np.float64], dt: float) -> Spectrum:
    """Dominant frequency and band edge of a motion, shape (n_time,), step `dt` [s]."""
    # The Hann taper keeps records of broken cycles from leaking power up the band.
    tapered = (displacement - displacement.mean()) * np.hanning(displacement.size)
    power = np.abs(np.fft.rfft(tapered)) ** 2
    power[0] = 0.0
    frequency = np.fft.rfftfreq(displacement.size, dt)
    share = np.cumsum(power) / power.sum()
    return Spectrum(
        dominant=float(frequency[1 + int(np.argmax(power[1:]))]),
        band_edge=float(frequency[int(np.searchsorted(share, _BAND_POWER))]),
    )


@dataclass(frozen=True, slots=True)
class Smoother:
    """Savitzky-Golay filter of order 3 over `window` samples of step `dt` [s].

    The window covers 0.15 periods of the band edge: the longest, and so the least noisy, for which
    the derivative of everything in the motion's band is right to 1e-4; never below 5 samples.
    """

    window: int
    dt: float

    @classmethod
    def for_band(cls, band_edge: float, dt: float, n_time: int) -> Smoother:
        """Smoother for motions below a band edge [Hz], sampled at least 5 times."""
        longest = (n_time - 1) // 2
        half = int(0.5 * _WINDOW_PERIODS / (band_edge * dt))
        return cls(window=2 * min(max(half, 2), longest) + 1, dt=dt)

    def smooth(self, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signal without what is faster than the window."""
        return savitzky_golay(signal, self.window, _ORDER)

    def derivative(self, signal: NDArray[np.float64], order: int = 1) -> NDArray[np.float64]:
        """Time derivative of the smoothed signal."""
        return savitzky_golay(signal, self.window, _ORDER, derivative=order, step=self.dt)

    def noise(self, removed: NDArray[np.float64]) -> float:
        """Estimate the standard deviation of a signal's white noise from what `smooth` removed."""
        # A least-squares smoother removes (1 - c0) of the noise's variance, c0 its centre weight.
        return float(np.sqrt(np.var(removed) / (1.0 - self._weights(0)[self.window // 2])))

    def noise_gain(self, order: int) -> float:
        """Return the standard deviation of `derivative` (order 0: `smooth`) per unit of white noise."""
        return float(np.sqrt(np.sum(self._weights(order) ** 2)))

    def _weights(self, order: int) -> NDArray[np.float64]:
        return weights(self.window, _ORDER, derivative=order, step=self.dt)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """A motion without its noise: displacement [m], velocity [m/s], acceleration [m/s^2], shape (n_time,).

    `frequency` is the dominant one [Hz].
    """

    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    frequency: float


def motion_of(displacement: NDArray[np.float64], dt: float) -> Motion:
    """Displacement of step `dt` [s], smoothed, with its derivatives."""
    band = spectrum(displacement, dt)
    smoother = Smoother.for_band(band.band_edge, dt, displacement.size)
    return Motion(
        displacement=smoother.smooth(displacement),
        velocity=smoother.derivative(displacement),
        acceleration=smoother.derivative(displacement, order=2),
        frequency=band.dominant,
    )
