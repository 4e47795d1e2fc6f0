"""Properties of a sampled motion: dominant frequency, band, smoothed derivatives, cycles and turning points."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import factorial
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def weights(window: int, order: int, *, derivative: int = 0, step: float = 1.0) -> Array:
    """Weights of a derivative at the centre of a window, shape (window,), to be convolved with the signal.

    The least-norm solution of the conditions that polynomials up to `order` are differentiated exactly (Savitzky,
    Golay, Analytical Chemistry 36, 1964, 1627-1639).
    """
    half = window // 2
    powers = np.arange(half, -half - 1.0, -1.0) ** np.arange(order + 1.0)[:, None]
    wanted = np.zeros(order + 1)
    wanted[derivative] = factorial(derivative) / step**derivative
    return np.asarray(np.linalg.lstsq(powers, wanted, rcond=None)[0])


def savitzky_golay(
    signal: Array, window: int, order: int, *, derivative: int = 0, step: float = 1.0
) -> Array:
    """Derivative of a signal, shape (n_time,), from polynomials of `order` fitted to `window` samples about each.

    Half a window from either end it is that of the polynomial of the outermost window. `window` is odd, above `order`
    and at most n_time.
    """
    half = window // 2
    result = np.empty_like(signal)
    result[half : signal.size - half] = _inner_sums(
        signal, weights(window, order, derivative=derivative, step=step)
    )
    at = np.arange(float(window))

    def beyond(outermost: Array, at_which: Array) -> Array:
        polynomial = np.polyder(np.polyfit(at, outermost, order), derivative)
        return np.asarray(np.polyval(polynomial, at_which) / step**derivative)

    result[:half] = beyond(signal[:window], at[:half])
    result[signal.size - half :] = beyond(signal[-window:], at[window - half :])
    return result


def _inner_sums(signal: Array, weights: Array) -> Array:
    """Convolution of a signal with as many weights as a window has, wherever the whole window lies within it."""
    half = weights.size // 2
    n_inner = signal.size - 2 * half
    along = weights[::-1]

    def shifted(by: int) -> Array:
        return signal[half + by : half + by + n_inner]

    # Weights that are even or odd to rounding are taken as such, as in `scipy.ndimage.correlate1d`.
    if np.all(np.abs(weights - along) <= np.finfo(float).eps):
        total = shifted(0) * along[half]
        for by in range(-half, 0):
            total += (shifted(by) + shifted(-by)) * along[half + by]
    elif np.all(np.abs(weights + along)[:half] <= np.finfo(float).eps):
        total = shifted(0) * along[half]
        for by in range(-half, 0):
            total += (shifted(by) - shifted(-by)) * along[half + by]
    else:
        total = shifted(half) * along[-1]
        for by in range(-half, half):
            total += shifted(by) * along[half + by]
    return np.asarray(total)


_ORDER: Final = 3
_BAND_POWER: Final = 0.999
# A cubic Savitzky-Golay derivative over a window of half width m [s] is too small by (omega m)^4 / 504 for
# a sine of angular frequency omega. A window of 0.15 periods (omega m = 0.47) keeps that below 1e-4.
_WINDOW_PERIODS: Final = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionBand:
    """Frequency of the largest Fourier component, and the one below which 99.9 % of the power lies [Hz]."""

    dominant: float
    band_edge: float


def spectrum(displacement: NDArray[np.float64], dt: float) -> MotionBand:
    """Dominant frequency and band edge of a motion, shape (n_time,), step `dt` [s]."""
    # The Hann taper keeps records of broken cycles from leaking power up the band.
    tapered = (displacement - displacement.mean()) * np.hanning(displacement.size)
    power = np.abs(np.fft.rfft(tapered)) ** 2
    power[0] = 0.0
    frequency = np.fft.rfftfreq(displacement.size, dt)
    share = np.cumsum(power) / power.sum()
    return MotionBand(
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
class SmoothMotion:
    """A motion without its noise: displacement [m], velocity [m/s], acceleration [m/s^2], shape (n_time,).

    `frequency` is the dominant one [Hz].
    """

    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    frequency: float


def motion_of(displacement: NDArray[np.float64], dt: float) -> SmoothMotion:
    """Displacement of step `dt` [s], smoothed, with its derivatives."""
    band = spectrum(displacement, dt)
    smoother = Smoother.for_band(band.band_edge, dt, displacement.size)
    return SmoothMotion(
        displacement=smoother.smooth(displacement),
        velocity=smoother.derivative(displacement),
        acceleration=smoother.derivative(displacement, order=2),
        frequency=band.dominant,
    )


# A crossing counts only after the stroke has been this share of its spread on the other side,
# so that noise around the middle of the stroke does not make cycles of its own.
_DEAD_BAND: Final = 0.5
# Turns less far apart than this share of the peak-to-peak stroke are wiggles.
_LEAST_STROKE: Final = 0.5


def upward_crossings(displacement: NDArray[np.float64]) -> NDArray[np.intp]:
    """Samples at which the stroke passes its mean upwards, shape (n_crossings,)."""
    centred = displacement - np.mean(displacement)
    side = np.where(np.abs(centred) < _DEAD_BAND * np.std(centred), 0.0, np.sign(centred))
    decided = np.flatnonzero(side)
    turns = decided[1:][(side[decided[:-1]] < 0) & (side[decided[1:]] > 0)]
    upward = np.flatnonzero((centred[:-1] < 0) & (centred[1:] >= 0)) + 1
    if turns.size == 0 or upward.size == 0:
        return np.empty(0, dtype=np.intp)
    nearest = np.searchsorted(upward, turns, side="right") - 1
    return upward[nearest[nearest >= 0]]


def whole_cycles(displacement: NDArray[np.float64]) -> tuple[slice, ...]:
    """Samples of each cycle, from one upward crossing to the next."""
    crossings = upward_crossings(displacement)
    return tuple(slice(int(first), int(last)) for first, last in pairwise(crossings))


def turning_points(
    displacement: NDArray[np.float64], velocity: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turns between two strokes of at least half the peak-to-peak each.

    Parameters
    ----------
    displacement, velocity
        Without noise, shape (n_time,) [m, m/s].

    Returns
    -------
    place, direction
        Shape (n_turns,): where the velocity vanishes, in samples and fractions of them, and the sign of the
        velocity before.
    """
    before = np.flatnonzero((velocity[:-1] != 0.0) & (velocity[:-1] * velocity[1:] <= 0.0))
    place = before + velocity[before] / (velocity[before] - velocity[before + 1])
    stroke = np.diff(np.interp(place, np.arange(displacement.size), displacement))
    wide = np.abs(stroke) > _LEAST_STROKE * np.ptp(displacement)
    chosen = np.flatnonzero(wide[:-1] & wide[1:]) + 1
    return place[chosen], np.sign(velocity[before[chosen]])
